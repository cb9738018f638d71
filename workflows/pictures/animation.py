"""Films of a result: its contact over wear, and its part and contact over one cycle of a state.

Camera, factors of exaggeration and colour scales are the same in all images of a film.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg

from tribodyn.workflows.pictures import film
from tribodyn.workflows.pictures.film_of_cycle import CycleFilm
from tribodyn.workflows.pictures.film_of_wear import WearFilm
from tribodyn.workflows.pictures.mistuned_wheel import MistunedWheelFilm
from tribodyn.workflows.pictures.render import check
from tribodyn.workflows.pictures.style import STYLE
from tribodyn.workflows.result.result import Result

Over = Literal["wear", "cycle"]

RATE = 12.0  # images per second
IMAGES = 48  # of a film, fewer where there are fewer wear steps
DPI = 100


def write(
    result: Result,
    folder: Path,
    over: Over,
    row: int | None = None,
    formats: Sequence[str] = ("mp4",),
    images: int = IMAGES,
    dpi: int = DPI,
    deformation: float | None = None,
    wear: float | None = None,
) -> list[Path]:
    """Write a film of a result into a folder, named wear or cycle_ROW; returns its paths.

    over : "wear" shows depth, status and pressure of the opened contact at the wear steps; "cycle" shows part and
        status by pair over one cycle of a state
    row : of the wear history, or point of the response, whose cycle is shown; that whose contact works most by default
    dpi : dots per inch; a film is 12.8 by 7.2 inches
    deformation, wear : factors by which displacement and depth are exaggerated, chosen by size where None
    Raises  ValueError: the result has nothing of the kind to show; RenderingUnavailable
    """
    if images < 2:
        raise ValueError(f"a film of {images} images: ask for 2 at least")
    if not 20 <= dpi <= 400:
        raise ValueError(f"--dpi {dpi}: give a film 20 to 400 dots per inch")
    if over not in ("wear", "cycle"):
        raise ValueError(f'no film over "{over}": take wear or cycle')
    check()
    made = WearFilm(result, images, wear) if over == "wear" else CycleFilm(result, row, images, deformation, wear)
    folder.mkdir(parents=True, exist_ok=True)
    return film.write(drawn(made, dpi), folder / made.name, formats, RATE)


def drawn(made: WearFilm | CycleFilm | MistunedWheelFilm, dpi: int = DPI) -> Iterator[np.ndarray]:
    """The images (height, width, 3) of a film, all with the layout of the first."""
    with mpl.rc_context(STYLE):
        canvas = FigureCanvasAgg(made.figure)
        made.figure.set_dpi(dpi)
        for number in range(made.count):
            made.show(number)
            canvas.draw()
            if number == 0:
                made.figure.set_layout_engine("none")
            yield np.asarray(canvas.buffer_rgba())[..., :3].copy()
