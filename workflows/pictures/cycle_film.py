"""Film of a part and its contact over one cycle."""

from typing import Any

import numpy as np

from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures import opened as book
from tribodyn.workflows.pictures.figures import heading, length_unit, scale_bar, status_name
from tribodyn.workflows.pictures.loop_plots import loop_of, loop_size
from tribodyn.workflows.pictures.matplotlib_names import BoundaryNorm, Figure, ListedColormap, Swatch, mpl
from tribodyn.workflows.pictures.render import MovingPart
from tribodyn.workflows.pictures.shots import shoot, show
from tribodyn.workflows.pictures.theme import BLUE, INK, LAYOUT, MOTION_MAP, RED, STATUS, STYLE
from tribodyn.workflows.result.contact_states import instant_status, over_a_cycle, shown_states
from tribodyn.workflows.result.result import Result

AT_ONCE = (STICKS, SLIPS, SEPARATES)  # what a pair can do at an instant


class CycleFilm:
    """A film over one cycle of a state: its figure, and how an instant gets into it.

    row : of the wear history, or point of the response; that whose contact works most where None
    count : of images, evenly over the period
    deformation, wear : factors by which displacement and depth are exaggerated, chosen by size where None
    Raises  Refusal where nothing is kept of the cycle"""

    def __init__(
        self, result: Result, row: int | None, count: int, deformation: float | None = None, wear: float | None = None
    ):
        loops, patch = result.loops, result.patch
        if loops is None:
            raise Refusal("the result keeps no cycle of a contact: its scene needs pictures.plots = true")
        states = {state.number: state for state in shown_states(result) if state.number in loops.row.tolist()}
        if row is None:
            row = int(loops.row[np.argmax(loop_size(result).sum(axis=(1, 2)))])
        if row not in states:
            raise Refusal(f"the result keeps no cycle of row {row}: it has those of {', '.join(map(str, states))}")
        self.state, self.count = states[row], count
        at = loops.row.tolist().index(row)
        self._status = instant_status(result, at)
        size = loop_size(result)[at]
        busiest, component = (int(index) for index in np.unravel_index(int(np.argmax(size)), size.shape))
        self._loop = loop_of(result, at, busiest, component)
        shown = [c for c in book.contacts(result) if busiest in range(*c.pairs.indices(len(patch.area)))]
        self._contact = book.opened(result, shown[0]) if shown else None
        self._moving = None
        if self.state.field is not None and result.part is not None and len(patch.faces):
            self._moving = MovingPart(result, deformation, wear)
            _, positions = over_a_cycle(result, self.state.field, count)
            self._vibration = positions - positions.mean(axis=0)
            self._factor = self._moving.vibration_scale(self._moving.swing(self.state))
            self._top = float(self._moving.amplitude(self.state).max())
        self._wear = self._moving.wear if self._moving is not None else wear or 1.0
        with mpl.rc_context(STYLE):
            self.figure = Figure(figsize=LAYOUT.film, layout="constrained")
            self._draw(result)

    @property
    def name(self) -> str:
        """Name of the film's files."""
        return f"cycle_{self.state.number}"

    def show(self, number: int) -> None:
        """Put an instant into the figure."""
        sample = number * self._status.shape[1] // self.count
        for axes, image in zip(self._panels, self._shots(number, sample), strict=True):
            axes.images[0].set_data(image)
        x, force = self._loop.displacement, self._loop.force
        self._mark.set_data(x[sample : sample + 1], force[sample : sample + 1])
        share = number / self.count
        self._now.set_xdata([share, share])
        self._clock.set_text(f"{share:.2f} of the period")

    def _draw(self, result: Result) -> None:
        views = [name for name, part in (("part", self._moving), ("contact", self._contact)) if part is not None]
        if views:
            halves: Any = self.figure.subfigures(2, 1, height_ratios=[1.9, 1])
            upper, lower = halves
            self._panels = list(np.atleast_1d(upper.subplots(1, len(views))))
            self._start(upper, views)
        else:
            lower, self._panels = self.figure.subfigures(1, 1), []
        loop_axes, status_axes = lower.subplots(1, 2, width_ratios=[1, 1.6])
        self._draw_loop(loop_axes)
        self._draw_status(status_axes, result)
        hertz = "" if result.wear is None else f", {self.state.omega / (2 * np.pi):.4g} Hz"
        heading(self.figure, result, f"one cycle, {self.state.label}{hertz}")
        self._clock = self.figure.text(0.99, 0.985, "", ha="right", va="top")

    def _start(self, figure: Any, views: list[str]) -> None:
        for axes, name, image in zip(self._panels, views, self._shots(0, 0), strict=True):
            show(axes, image)
            if name == "part" and self._moving is not None:
                unit, factor = length_unit(self._top)
                label = f"distance from the mean position / {unit}"
                scale_bar(figure, axes, MOTION_MAP, 0.0, factor * self._top, label)
                axes.set_title(self._moving.factors(self._factor))
            elif self._contact is not None:
                axes.set_title(f"opened {self._contact.sides}")

    def _shots(self, number: int, sample: int) -> list[np.ndarray]:
        images = []
        if self._moving is not None:
            vibration = self._vibration[number]
            points = self._moving.points(self.state, self._factor * vibration)
            values = np.linalg.norm(vibration, axis=1)
            view = self._moving.view(points, values, (0.0, self._top))
            images.append(self._moving.marked(shoot(view, self._moving.camera, LAYOUT.film_part), points))
        if self._contact is not None:
            contact_state = self._contact.restrict(self.state)
            paint = book.StatusPaint(self._status[self._contact.contact.pairs, sample])
            view = self._contact.view(contact_state.depth, self._wear, paint)
            images.append(shoot(view, self._contact.camera, LAYOUT.film_part, book.AXES))
        return images

    def _draw_loop(self, axes: Any) -> None:
        x, force = self._loop.displacement, self._loop.force
        axes.plot(np.append(x, x[0]), np.append(force, force[0]), color=BLUE)
        self._mark = axes.plot([], [], "o", color=RED, ms=7, zorder=5)[0]
        axes.set_xlabel(self._loop.label_x)
        axes.set_ylabel(self._loop.label)
        axes.locator_params(nbins=5)

    def _draw_status(self, axes: Any, result: Result) -> None:
        """Status of every pair over the period, pairs in the order of their contact."""
        patch = result.patch
        colors = [STATUS[bits][1] for bits in AT_ONCE]
        norm = BoundaryNorm([0.5, 1.5, 3.0, 5.0], 3)
        axes.imshow(
            self._status, aspect="auto", cmap=ListedColormap(colors), norm=norm, interpolation="nearest",
            extent=(0, 1, len(self._status) - 0.5, -0.5),
        )  # fmt: skip
        self._now = axes.axvline(0, color=INK)
        axes.grid(False)
        axes.set_xlabel("share of the period")
        axes.set_ylabel("contact pair")
        present = [bits for bits in AT_ONCE if (self._status == bits).any()]
        swatches = [Swatch(facecolor=STATUS[b][1], label=status_name(b, patch.components)) for b in present]
        axes.legend(handles=swatches, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
