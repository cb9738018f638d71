"""Curves of a result, drawn with matplotlib: each function draws one figure, `draw` writes all that can be drawn."""

from collections.abc import Callable, Sequence
from pathlib import Path

from tribodyn.workflows.pictures import maps
from tribodyn.workflows.pictures.figures import save
from tribodyn.workflows.pictures.loop_plots import has_friction, hysteresis
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.response_plots import output_amplitudes, response
from tribodyn.workflows.pictures.wear_plots import COURSES
from tribodyn.workflows.result.contact_states import has_states
from tribodyn.workflows.result.result import Result


def draw(result: Result, folder: Path, formats: Sequence[str] = ("png",), dpi: int | None = None) -> list[Path]:
    """Write every figure that the result has data for; returns their paths."""
    return [path for name, make in figures(result).items() for path in save(make(result), folder / name, formats, dpi)]


def figures(result: Result) -> dict[str, Callable[[Result], Figure]]:
    """The figures that a result has data for, by name."""
    worn = result.wear_steps > 0
    mapped = len(result.patch.faces) > 0 and has_states(result)
    candidates: list[tuple[str, Callable[[Result], Figure], bool]] = [
        ("frf", response, result.response is not None or result.wear is not None),
        ("outputs", output_amplitudes, result.response is not None and len(result.response.displacements) > 1),
        *((name, draw, worn) for name, draw in COURSES.items()),
        ("hysteresis", hysteresis, result.loops is not None and has_friction(result)),
        ("normal", hysteresis, result.loops is not None and not has_friction(result)),
        ("patch", maps.patch_maps, mapped),
        ("status_maps", maps.status_maps, mapped and worn),
    ]
    drawn = {name: function for name, function, possible in candidates if possible}
    if result.stress_field is not None:
        from tribodyn.workflows.pictures import fatigue_pictures  # only results that hold stress need it

        drawn |= fatigue_pictures.figures(result)
    return drawn
