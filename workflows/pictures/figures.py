"""What all figures share: axes in the common style, headings with the scene's name, units that read well, files."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from tribodyn.hbm.contact.contact_law import SEPARATES
from tribodyn.output_file import replacing
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.matplotlib_names import (
    Figure,
    FuncFormatter,
    LogLocator,
    MaxNLocator,
    Normalize,
    NullFormatter,
    PowerNorm,
    ScalarMappable,
    Swatch,
    mpl,
)
from tribodyn.workflows.pictures.theme import FORMATS, LAYOUT, RED, STATUS, STYLE
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.summary import LARGEST_BEND, size_of

Part = TypeVar("Part")


@contextmanager
def axes_of(
    width: float = 6.4, height: float = 3.9, rows: int = 1, share: bool = True, columns: int = 1
) -> Iterator[tuple[Figure, Any]]:
    """A figure in the common style with its axes: one, or an array where there are several rows or columns."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure, figure.subplots(rows, columns, sharex=share and columns == 1)


def present(part: Part | None) -> Part:
    """A part of a result that a picture is only drawn with."""
    if part is None:
        raise ValueError("this picture was asked for of a result that lacks what it shows")
    return part


def heading(figure: Figure, result: Result, title: str) -> None:
    """A title over a figure of several axes."""
    figure.suptitle(titled(result, title), x=0.01, ha="left")


def titled(result: Result, title: str) -> str:
    """A title with the name of the scene."""
    return named(result.provenance["scene_name"], title)


def named(scene: str, title: str) -> str:
    """What a picture shows behind the name of its scene, alone where there is none."""
    return f"{scene.replace('_', ' ')}: {title}" if scene else title[:1].upper() + title[1:]


def log_axis(axis: Any, low: float, high: float) -> None:
    """A logarithmic axis (axes.xaxis or axes.yaxis) with ticks at 1, 2 and 5 in plain numbers where it spans little."""
    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    if low > 0 and high < 100 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high > 5 * low else range(1, 10)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def save(figure: Figure, stem: Path, formats: Sequence[str] = ("png",), dpi: int | None = None) -> list[Path]:
    """Write a figure in some formats; returns the paths. Raises Refusal for a format that is not known."""
    written = []
    with mpl.rc_context(STYLE):
        for name in formats:
            if name not in FORMATS:
                raise Refusal(f'no picture format "{name}": take one of {", ".join(FORMATS)}')
            path = stem.with_name(f"{stem.name}.{name}")
            written.append(write_figure(figure, path, dpi=dpi or LAYOUT.dpi))
    return written


def write_figure(figure: Figure, path: Path, **options: Any) -> Path:
    """Write a figure as a whole or not at all; its path."""
    with replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix.removeprefix("."), **options)
    return path


def length_unit(largest: float) -> tuple[str, float]:
    """Unit and factor in which lengths [m] of this size read well."""
    if largest >= 0.5e-3:
        return "mm", 1e3
    return ("nm", 1e9) if 0 < largest < 0.5e-6 else ("µm", 1e6)


def pressure_unit(largest: float) -> tuple[str, float]:
    """Unit and factor in which pressures [Pa] of this size read well."""
    return ("MPa", 1e-6) if largest >= 1e5 or largest == 0 else ("kPa", 1e-3) if largest >= 100 else ("Pa", 1.0)


def status_name(bits: int, components: Sequence[str]) -> str:
    """What a status is called; a contact without friction neither sticks nor slips."""
    if tuple(components) != ("n",):
        return STATUS[bits][0]
    return "separation" if bits == SEPARATES else "opens and closes" if bits & SEPARATES else "closed"


def status_legend(figure: Figure, present: set[int], components: Sequence[str]) -> None:
    """A legend of contact states below a figure."""
    shown = {status_name(bits, components): STATUS[bits][1] for bits in STATUS if bits in present}
    swatches = [Swatch(facecolor=color, label=name) for name, color in shown.items()]
    figure.legend(handles=swatches, loc="outside lower center", ncols=min(4, len(swatches)), title="over the cycle")


def force_unit(largest: float) -> tuple[str, float]:
    """Unit and factor in which forces [N] of this size read well."""
    if largest >= 1e3:
        return "kN", 1e-3
    return ("mN", 1e3) if 0 < largest < 1 else ("N", 1.0)


def area_energy_unit(largest: float) -> tuple[str, float]:
    """Unit and factor in which energies per area [J/m2] of this size read well."""
    units = [("J/m²", 1.0), ("mJ/m²", 1e3), ("µJ/m²", 1e6), ("nJ/m²", 1e9)]
    return next((unit for unit in units if unit[1] * largest >= 0.5), units[-1] if largest > 0 else units[0])


def scale_bar(
    figure: Figure, axes: Any, map_: str, low: float, high: float, label: str, power: float | None = None
) -> None:
    """A horizontal scale with ticks below a view; power : of the values that the colours go by, 1 where None."""
    if not high > low:
        high = low + (abs(low) or 1.0) * 1e-9
        label += f": {low:.3g} everywhere"
    norm = Normalize(low, high) if power is None else PowerNorm(power, low, high)
    bar = figure.colorbar(ScalarMappable(norm, map_), ax=axes, location="bottom", shrink=0.7, aspect=28)
    bar.set_label(label)
    if label.endswith("everywhere"):
        bar.set_ticks([])
        return
    bar.locator = MaxNLocator(4)
    bar.update_ticks()


def positive_range(values: np.ndarray) -> tuple[float, float]:
    """The smallest and the largest of some values above zero."""
    above = np.asarray(values, float)
    above = above[np.isfinite(above) & (above > 0)]
    return (float(above.min()), float(above.max())) if len(above) else (1.0, 10.0)


def shade_beyond_linear_model(axes: Any, result: Result, scale: float) -> None:
    """Shade the amplitudes that a linear model does not describe, where the axes reach them."""
    low, high = axes.get_ylim()
    limit = scale * LARGEST_BEND * size_of(result)
    if low < limit < high:
        axes.axhspan(limit, high, color=RED, alpha=0.08, lw=0)
        axes.text(
            0.99, limit, "beyond the linear model", transform=axes.get_yaxis_transform(), color=RED, ha="right",
            va="bottom",
        )  # fmt: skip
        axes.set_ylim(low, high)
