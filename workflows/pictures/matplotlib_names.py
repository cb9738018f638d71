"""Matplotlib and Pillow, which the extra `pictures` brings, imported where they are first used: a run needs neither."""

from typing import TYPE_CHECKING, Any

from tribodyn.extras import Deferred

mpl: Any = Deferred("matplotlib")
if TYPE_CHECKING:
    from matplotlib.figure import Figure as Figure
else:
    Figure = Deferred("matplotlib.figure", "Figure")
BoundaryNorm: Any = Deferred("matplotlib.colors", "BoundaryNorm")
FFMpegWriter: Any = Deferred("matplotlib.animation", "FFMpegWriter")
FuncFormatter: Any = Deferred("matplotlib.ticker", "FuncFormatter")
Image: Any = Deferred("PIL.Image")
ImageDraw: Any = Deferred("PIL.ImageDraw")
ListedColormap: Any = Deferred("matplotlib.colors", "ListedColormap")
LogLocator: Any = Deferred("matplotlib.ticker", "LogLocator")
MaxNLocator: Any = Deferred("matplotlib.ticker", "MaxNLocator")
Normalize: Any = Deferred("matplotlib.colors", "Normalize")
NullFormatter: Any = Deferred("matplotlib.ticker", "NullFormatter")
PolyCollection: Any = Deferred("matplotlib.collections", "PolyCollection")
PowerNorm: Any = Deferred("matplotlib.colors", "PowerNorm")
ScalarMappable: Any = Deferred("matplotlib.cm", "ScalarMappable")
Swatch: Any = Deferred("matplotlib.patches", "Patch")
Triangulation: Any = Deferred("matplotlib.tri", "Triangulation")
