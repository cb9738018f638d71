"""Film of a contact over its wear."""

from typing import Any, ClassVar

import numpy as np

from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures import opened as book
from tribodyn.workflows.pictures.figures import (
    force_unit,
    heading,
    length_unit,
    present,
    pressure_unit,
    scale_bar,
    status_legend,
)
from tribodyn.workflows.pictures.matplotlib_names import Figure, mpl
from tribodyn.workflows.pictures.shots import shoot, show
from tribodyn.workflows.pictures.theme import BLUE, LAYOUT, ORANGE, PRESSURE_MAP, RED, STYLE, WEAR_MAP
from tribodyn.workflows.pictures.view import wear_scale
from tribodyn.workflows.pictures.wear_plots import cycle_axis
from tribodyn.workflows.result.contact_states import ContactState, shown_cycles, state_of
from tribodyn.workflows.result.faces import Meeting
from tribodyn.workflows.result.result import Result

ROOT = 1 / 3  # power of the scale of pressure: the first pressures are many times the last
PANELS = ("depth", "status", "pressure")


class WearFilm:
    """A film over wear: its figure, and how a state gets into it.

    images : wear states at the most, evenly chosen among the rows that curves show
    wear : factor by which the depth is exaggerated, chosen by size where None
    Raises  Refusal where the result has no worn contact with faces"""

    def __init__(self, result: Result, images: int, wear: float | None = None):
        patch, history = result.patch, result.wear
        if history is None or not result.wear_steps or not book.contacts(result):
            raise Refusal("the result holds no worn contact with faces: there is no film over wear")
        last = int(np.flatnonzero(history.cycles <= shown_cycles(history))[-1])
        rows = np.unique(np.linspace(0, last, images).round().astype(int))
        self.contact = book.opened(result, _most_worn(result, rows))
        self.states = [self.contact.restrict(state_of(result, int(row))) for row in rows]
        depth = np.stack([state.depth for state in self.states])
        self._pressure_top = max(float(_pressure(state).max()) for state in self.states)
        self._depth_top = float(depth.max())
        self.scale = wear or wear_scale(self.contact.contact.patch, depth)
        with mpl.rc_context(STYLE):
            self.figure = Figure(figsize=LAYOUT.film, layout="constrained")
            halves: Any = self.figure.subfigures(2, 1, height_ratios=[1.8, 1])
            upper, lower = halves
            self._panels = dict(zip(PANELS, upper.subplots(1, 3), strict=True))
            present = {int(bits) for s in self.states if s.status is not None for bits in s.status}
            status_legend(upper, present, patch.components)
            self._bars(upper)
            self._marks = _curves(result, lower.subplots(1, 3), rows)
            heading(self.figure, result, f"wear of the {self.contact.sides}, relief × {self.scale:g}")
            for name, axes in self._panels.items():
                show(axes, self._shot(self.states[-1], name))
                axes.set_title(" ")

    @property
    def count(self) -> int:
        """Number of images."""
        return len(self.states)

    name: ClassVar[str] = "wear"
    """Of the film's files."""

    def show(self, number: int) -> None:
        """Put a state into the figure."""
        state = self.states[number]
        for name, axes in self._panels.items():
            axes.images[0].set_data(self._shot(state, name))
        self._panels["depth"].set_title(state.label)
        for mark, x, y in self._marks:
            mark.set_data(x[number : number + 1], y[number : number + 1])

    def _shot(self, state: ContactState, name: str) -> np.ndarray:
        view = self.contact.view(state.depth, self.scale, self._paint(state, name))
        return shoot(view, self.contact.camera, LAYOUT.film_contact, book.AXES)

    def _paint(self, state: ContactState, name: str) -> book.Paint:
        if name == "status":
            return book.StatusPaint(np.zeros(len(state.depth), int) if state.status is None else state.status)
        if name == "depth":
            return book.FieldPaint(state.depth, (0.0, self._depth_top), WEAR_MAP)
        return book.FieldPaint(np.maximum(_pressure(state), 0) ** ROOT, (0.0, self._pressure_top**ROOT), PRESSURE_MAP)

    def _bars(self, figure: Any) -> None:
        unit, factor = length_unit(self._depth_top)
        scale_bar(figure, self._panels["depth"], WEAR_MAP, 0, factor * self._depth_top, f"total wear depth / {unit}")
        unit, factor = pressure_unit(self._pressure_top)
        highest, label = factor * self._pressure_top, f"mean pressure / {unit}"
        scale_bar(figure, self._panels["pressure"], PRESSURE_MAP, 0, highest, label, ROOT)


def _most_worn(result: Result, rows: np.ndarray) -> Meeting:
    """The contact that has lost most volume in the last of some rows."""
    volume = present(result.wear).depth[rows[-1]] * result.patch.area
    return max(book.contacts(result), key=lambda contact: float(volume[contact.pairs].sum()))


def _pressure(state: ContactState) -> np.ndarray:
    return np.zeros(len(state.depth)) if state.pressure is None else state.pressure


def _curves(result: Result, panels: Any, rows: np.ndarray) -> list[tuple[Any, np.ndarray, np.ndarray]]:
    """Depth, amplitude and preload against cycles, each with a mark; returns mark, x and y of the rows."""
    wear = present(result.wear)
    depth, marks = wear.depth.max(axis=1), []
    (unit_d, d), (unit_a, a) = length_unit(depth.max()), length_unit(wear.amplitude.max())
    unit_f, f = force_unit(wear.preload.max())
    for axes, label, values, color in zip(
        panels,
        (f"largest total depth / {unit_d}", f"amplitude / {unit_a}", f"preload / {unit_f}"),
        (d * depth, a * wear.amplitude, f * wear.preload),
        (BLUE, ORANGE, BLUE),
        strict=True,
    ):
        scale = cycle_axis(axes, wear)
        axes.plot(scale * wear.cycles, values, color=color)
        axes.set_ylabel(label)
        axes.locator_params(axis="x", nbins=5)
        mark = axes.plot([], [], "o", color=RED, ms=7, zorder=5)[0]
        marks.append((mark, scale * wear.cycles[rows], values[rows]))
    panels[1].set_yscale("log" if wear.amplitude.max() > 30 * wear.amplitude.min() > 0 else "linear")
    return marks
