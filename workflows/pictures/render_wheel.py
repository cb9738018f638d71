"""Pictures of a wheel, drawn off-screen with pyvista: all blades, each with its phase, or its own motion if mistuned.

A wave repeats every blade one phase later, in its own turned frame: what one blade does, the others do."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from tribodyn.extras import package
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.travelling_wave import at_sector
from tribodyn.workflows.pictures import view as drawing
from tribodyn.workflows.pictures.figures import heading, length_unit, named, present, scale_bar
from tribodyn.workflows.pictures.offscreen import check
from tribodyn.workflows.pictures.shots import Layer, View, frame, shoot, show, with_room
from tribodyn.workflows.pictures.theme import BLUE, INK, LAYOUT, MOTION_MAP, ORANGE, STYLE
from tribodyn.workflows.result.contact_states import shown_states
from tribodyn.workflows.result.model_facts import Around
from tribodyn.workflows.result.result import PartMesh, Result


class BladeSurface:
    """All blades of a wheel as one surface, seen nearly along its axis.

    nodes : (n_point,) of the part on its surface; size : largest distance of the part from the axis [m]"""

    def __init__(self, wheel: Around, part: PartMesh):
        shell = drawing.surface(drawing.grid_of(part))
        self.nodes = cKDTree(part.points).query(shell.points)[1]
        self._faces = _repeated(np.asarray(shell.faces), len(self.nodes), wheel.sectors)
        self._wheel, axis = wheel, wheel.axis
        self.size = float(np.linalg.norm(np.cross(part.points, axis), axis=1).max())
        across = np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [0.0, 0.0, 1.0])
        sideways = np.cross(axis, across)
        corners = 1.15 * self.size * np.array([x * across + y * sideways for x in (-1, 1) for y in (-1, 1)])
        self.camera = frame(corners, axis + 0.25 * across, across, 1.0, 1.0)

    def shot(self, static: np.ndarray, motion: np.ndarray, scale: float, largest: float) -> np.ndarray:
        """The image of blades displaced by `static` and `motion` ([N,] n_point, 3), coloured up to `largest`."""
        points = static + scale * motion
        positions = np.concatenate([self._wheel.sector(blade, n) for n, blade in enumerate(points)])
        surface = package("pyvista").PolyData(positions, self._faces)
        values = np.linalg.norm(motion, axis=2).ravel()
        layer = Layer(surface, values=values, map=MOTION_MAP, limits=(0.0, largest), edges=False)
        return shoot(View([layer]), self.camera, LAYOUT.wheel)


def wheel_picture(result: Result, wheel: Around, deformation: float | None = None) -> Figure:
    """All blades at one instant in each shown state, coloured by how far they are from their mean position."""
    part, fields = present(result.part), present(result.fields)
    states = [state for state in shown_states(result) if state.field is not None]
    blades = BladeSurface(wheel, part)
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(figsize=(3.4 * len(states) + 0.2, 4.4), layout="constrained")
        for axes, state in zip(np.atleast_1d(figure.subplots(1, len(states))), states, strict=True):
            wave = fields.displacement[state.field or 0]
            motion = np.stack(list(instants(wheel, result.harmonics, wave)))
            largest = float(np.linalg.norm(motion, axis=-1).max())
            scale = deformation or drawing.deformation_scale(drawing.swing(wave, result.harmonics), 2 * blades.size)
            static = (part.points + drawing.at_rest(wave, result.harmonics))[blades.nodes]
            (image,), corner = with_room([blades.shot(static, motion[:, blades.nodes], scale, largest)])
            show(axes, image, blades.camera, "xyz", corner)
            axes.set_title(f"{state.label}\nvibration × {scale:g}")
            _bar(figure, axes, largest)
        heading(figure, result, f"wheel of {wheel.sectors} sectors, engine order {wheel.engine_order}")
    return figure


def _bar(figure: Figure, axes: Any, largest: float) -> None:
    unit, factor = length_unit(largest)
    scale_bar(figure, axes, MOTION_MAP, 0.0, factor * largest, f"vibration at one instant / {unit}")


def instants(wheel: Around, harmonics: tuple[int, ...], displacement: np.ndarray) -> Iterator[np.ndarray]:
    """Vibration (n_node, 3) [m] of every blade in its own frame, at the instant when blade 0 begins its period.

    displacement : (n_node, 3, n_coeff) of blade 0 [m]"""
    basis = HarmonicBasis(harmonics, 2 * harmonics[-1] + 1)
    functions = basis.functions(np.zeros(1))[0] * (basis.order > 0)
    for n in range(wheel.sectors):
        yield at_sector(basis, displacement, wheel.engine_order, wheel.sectors, n) @ functions


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
    Colours and factor of exaggeration are the same in all. Raises  RenderingUnavailable"""

    name = "mistuned_wheel"

    def __init__(
        self, scene: str, wheel: Around, part: PartMesh, harmonics: tuple[int, ...], states: Sequence[WheelState],
        count: int = 1,
    ):  # fmt: skip
        check()

        self.count, self._states, self._sectors = count, tuple(states), wheel.sectors
        self._blades = BladeSurface(wheel, part)
        nodes = self._blades.nodes
        self._static, self._swings = [], []
        for state in states:
            displacement = state.displacement[:, nodes]
            self._static.append(part.points[nodes] + drawing.at_rest(displacement, harmonics))
            self._swings.append(drawing.cycle(displacement, harmonics))
        sizes = [np.linalg.norm(swing, axis=2) for swing in self._swings]
        self._largest = max(float(size.max()) for size in sizes)
        self._first = int(sizes[-1].max(axis=(0, 1)).argmax())
        self._scale = drawing.nice(2 * self._blades.size / 12 / self._largest) if self._largest > 0 else 1.0
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
        of_height, by_height = length_unit(max(float(state.heights.max()) for state in self._states))
        self._views = list(rows[0])
        blades = np.arange(self._sectors)
        for at, (state, (view, upper, lower)) in enumerate(zip(self._states, rows.T, strict=True)):
            view.imshow(self._shot(at, 0))
            view.axis("off")
            view.set_title(f"{state.label}\nvibration × {self._scale:g}")
            _bar(self.figure, view, self._largest)
            upper.bar(blades, by_height * state.heights, color=BLUE, width=0.8)
            upper.axhline(by_height * state.heights.mean(), color=INK, lw=0.8, ls="--")
            lower.bar(blades, 1e9 * state.volume, color=ORANGE, width=0.8)
            lower.set_xlabel("blade")
            if at == 0:
                upper.set_ylabel(f"amplitude\n/ {of_height}")
                lower.set_ylabel("worn volume\n/ mm³")
        self.figure.suptitle(named(scene, f"wheel of {self._sectors} mistuned blades"), x=0.01, ha="left")

    def _shot(self, at: int, number: int) -> np.ndarray:
        instants = self._swings[at].shape[-1]
        motion = self._swings[at][..., (self._first + number * instants // self.count) % instants]
        return self._blades.shot(self._static[at], motion, self._scale, self._largest)


def _repeated(faces: np.ndarray, n_point: int, count: int) -> np.ndarray:
    """Faces of copies of a surface of so many points, one behind the other, as VTK wants them."""
    index, at = np.ones(len(faces), bool), 0
    while at < len(faces):
        index[at] = False  # the number of corners that follow
        at += int(faces[at]) + 1
    return np.concatenate([faces + k * n_point * index for k in range(count)])
