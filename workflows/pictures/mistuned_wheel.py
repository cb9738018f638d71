"""A wheel of blades that differ: all blades at one instant, each with its own amplitude and wear; picture and film."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from tribodyn.workflows.pictures import view as drawing
from tribodyn.workflows.pictures.figures import length_unit, named, scale_bar
from tribodyn.workflows.pictures.render import check
from tribodyn.workflows.pictures.render_wheel import Shell, Wheel
from tribodyn.workflows.pictures.shots import Layer, View, shoot
from tribodyn.workflows.pictures.style import BLUE, INK, MOTION_MAP, ORANGE, STYLE
from tribodyn.workflows.result.result import PartMesh

PIXELS = (900, 900)


@dataclass(frozen=True)
class WheelState:
    """What is shown of a wheel.

    label : its title; displacement : (N, n_node, 3, n_coeff) of every blade in its own frame [m]
    heights : (N,) amplitude of the response of every blade [m]; volume : (N,) worn at the contacts of every blade [m3]
    """

    label: str
    displacement: np.ndarray
    heights: np.ndarray
    volume: np.ndarray


class MistunedWheelFilm:
    """A film over one cycle: a column for each state, the wheel above, amplitude and wear of every blade below.

    count : instants, evenly over the period, the first one that of the largest swing
    Colours and factor of exaggeration are the same in all. Raises  RenderingUnavailable
    """

    name = "mistuned_wheel"

    def __init__(
        self, scene: str, wheel: Wheel, part: PartMesh, harmonics: tuple[int, ...], states: Sequence[WheelState],
        count: int = 1,
    ):  # fmt: skip
        check()
        import pyvista as pv

        self.count, self._states, self._wheel = count, tuple(states), wheel
        shell = Shell.of(part, part.cells, getattr(pv.CellType, part.kind.upper()))
        self._faces = _repeated(shell.faces, len(shell.nodes), wheel.n_sectors)
        radius = wheel.radius(part.points)
        self._camera = wheel.camera(radius)
        self._rest, self._swings = [], []
        for state in states:
            moved = state.displacement[:, shell.nodes]
            self._rest.append(part.points[shell.nodes] + drawing.at_rest(moved, harmonics))
            self._swings.append(drawing.cycle(moved, harmonics))
        sizes = [np.linalg.norm(swing, axis=2) for swing in self._swings]
        self._largest = max(float(size.max()) for size in sizes)
        self._first = int(sizes[-1].max(axis=(0, 1)).argmax())
        self._scale = drawing.nice(2 * radius / 12 / self._largest) if self._largest > 0 else 1.0
        with mpl.rc_context(STYLE):
            self.figure = Figure(figsize=(5.0 * len(states) + 0.4, 7.4), layout="constrained")
            self._draw(scene)

    def show(self, number: int) -> None:
        """Put an instant into the figure."""
        for at, axes in enumerate(self._views):
            axes.images[0].set_data(self._shot(at, number))

    def _draw(self, scene: str) -> None:
        rows: Any = self.figure.subplots(
            3, len(self._states), squeeze=False, height_ratios=(4.2, 1.0, 1.0), sharey="row", sharex=False
        )
        unit, factor = length_unit(self._largest)
        of_height, by_height = length_unit(max(float(state.heights.max()) for state in self._states))
        self._views = list(rows[0])
        blades = np.arange(self._wheel.n_sectors)
        for at, (state, (view, upper, lower)) in enumerate(zip(self._states, rows.T, strict=True)):
            view.imshow(self._shot(at, 0))
            view.axis("off")
            view.set_title(f"{state.label}\nvibration × {self._scale:g}", fontsize=10)
            scale_bar(self.figure, view, MOTION_MAP, 0.0, factor * self._largest, f"vibration at one instant / {unit}")
            upper.bar(blades, by_height * state.heights, color=BLUE, width=0.8)
            upper.axhline(by_height * state.heights.mean(), color=INK, lw=0.8, ls="--")
            lower.bar(blades, 1e9 * state.volume, color=ORANGE, width=0.8)
            lower.set_xlabel("blade")
            if at == 0:
                upper.set_ylabel(f"amplitude\n/ {of_height}")
                lower.set_ylabel("worn volume\n/ mm³")
        self.figure.suptitle(
            named(scene, f"wheel of {self._wheel.n_sectors} blades that differ"), x=0.01, ha="left", fontsize=12
        )

    def _shot(self, at: int, number: int) -> np.ndarray:
        import pyvista as pv

        instants = self._swings[at].shape[-1]
        moved = self._swings[at][..., (self._first + number * instants // self.count) % instants]
        points = self._rest[at] + self._scale * moved
        placed = np.concatenate([self._wheel.blade(blade, n) for n, blade in enumerate(points)])
        values = np.linalg.norm(moved, axis=2).ravel()
        wheel, limits = pv.PolyData(placed, self._faces), (0.0, self._largest)
        layer = Layer(wheel, values=values, map=MOTION_MAP, limits=limits, edges=False)
        return shoot(View([layer]), self._camera, PIXELS)


def _repeated(faces: np.ndarray, n_point: int, count: int) -> np.ndarray:
    """Faces of copies of a surface of so many points, one behind the other, as VTK wants them."""
    index, at = np.ones(len(faces), bool), 0
    while at < len(faces):
        index[at] = False  # the number of corners that follow
        at += int(faces[at]) + 1
    return np.concatenate([faces + k * n_point * index for k in range(count)])
