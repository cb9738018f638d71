"""Pictures of a wheel, drawn off-screen with pyvista: all blades, each with its phase.

A wave repeats every blade one phase later, in its own turned frame: what one blade does, the others do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from tribodyn.fem.cyclic import rotation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.travelling_wave import at_sector
from tribodyn.workflows.pictures import triad
from tribodyn.workflows.pictures import view as drawing
from tribodyn.workflows.pictures.figures import heading, length_unit, scale_bar
from tribodyn.workflows.pictures.shots import Camera, Layer, View, frame, shoot
from tribodyn.workflows.pictures.style import MOTION_MAP, STYLE
from tribodyn.workflows.result.result import PartMesh, Result
from tribodyn.workflows.result.states import shown_states


@dataclass(frozen=True)
class Wheel:
    """n_sectors, engine_order, axis as the scene says; turn : (3, 3) by one pitch, to the neighbour on the left."""

    n_sectors: int
    engine_order: int
    axis: np.ndarray

    @property
    def turn(self) -> np.ndarray:
        """(3, 3) rotation by one pitch, from a blade to the one on its left."""
        return rotation(tuple(self.axis), 2 * np.pi / self.n_sectors)

    def blade(self, points: np.ndarray, n: int) -> np.ndarray:
        """Points (..., 3) of blade 0 where blade n has them."""
        return points @ np.linalg.matrix_power(self.turn, n).T

    def radius(self, points: np.ndarray) -> float:
        """Largest distance of points (n, 3) from the axis [m]."""
        return float(np.linalg.norm(np.cross(points, self.axis), axis=1).max())

    def camera(self, radius: float) -> Camera:
        """The camera that sees the whole wheel, nearly along its axis."""
        across = np.cross(self.axis, [0.0, 1.0, 0.0] if abs(self.axis[1]) < 0.9 else [0.0, 0.0, 1.0])
        aside = np.cross(self.axis, across)
        corners = 1.15 * radius * np.array([x * across + y * aside for x in (-1, 1) for y in (-1, 1)])
        return frame(corners, self.axis + 0.25 * across, across, 1.0, 1.0)


@dataclass(frozen=True)
class Shell:
    """The surface of some cells of a part, which follows the nodes of the part.

    nodes : (n_point,) nodes of the part on the surface; faces : as VTK wants them
    """

    nodes: np.ndarray
    faces: np.ndarray

    @classmethod
    def of(cls, part: PartMesh, cells: np.ndarray, cell_type: int) -> Shell:
        at_rest = drawing.surface(part.points, cells, cell_type, 0)
        return cls(cKDTree(part.points).query(at_rest.points)[1], np.asarray(at_rest.faces))

    def at(self, points: np.ndarray) -> Any:
        """The surface where the nodes of the part are at points (n_node, 3) [m]."""
        import pyvista as pv

        return pv.PolyData(points[self.nodes], self.faces)


def wheel_of(result: Result) -> Wheel | None:
    """The wheel of a result, None where its part stands alone."""
    around = result.facts.around
    return None if around is None else Wheel(around.sectors, around.engine_order, around.axis)


def wheel_picture(result: Result, wheel: Wheel, deformation: float | None = None) -> Figure:
    """All blades at one instant in each shown state, coloured by how far they are from their mean position."""
    part, fields = result.part, result.fields
    assert part is not None
    assert fields is not None
    import pyvista as pv

    states = [state for state in shown_states(result) if state.field is not None]
    radius = wheel.radius(part.points)
    shell = Shell.of(part, part.cells, getattr(pv.CellType, part.kind.upper()))
    camera = wheel.camera(radius)
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(figsize=(3.4 * len(states) + 0.2, 4.4), layout="constrained")
        for axes, state in zip(np.atleast_1d(figure.subplots(1, len(states))), states, strict=True):
            wave = fields.displacement[state.field or 0]
            moved = list(instants(wheel, result.harmonics, wave))
            largest = max(float(np.linalg.norm(m, axis=-1).max()) for m in moved)
            scale = deformation or drawing.deformation_scale(drawing.swing(wave, result.harmonics), 2 * radius)
            rest = part.points + drawing.at_rest(wave, result.harmonics)
            unit, factor = length_unit(largest)
            layers = []
            for n, vibration in enumerate(moved):
                values = factor * np.linalg.norm(vibration, axis=-1)[shell.nodes]
                blade = shell.at(wheel.blade(rest + scale * vibration, n))
                layers.append(Layer(blade, values=values, map=MOTION_MAP, limits=(0.0, factor * largest), edges=False))
            (image,), corner = triad.with_room([shoot(View(layers), camera, (1000, 1000))])
            axes.imshow(image)
            axes.axis("off")
            triad.draw(axes, camera, "xyz", corner, triad.room(image))
            axes.set_title(f"{state.label}\nvibration × {scale:g}", fontsize=10)
            scale_bar(figure, axes, MOTION_MAP, 0.0, factor * largest, f"vibration at one instant / {unit}")
        heading(figure, result, f"wheel of {wheel.n_sectors} sectors, engine order {wheel.engine_order}")
    return figure


def instants(wheel: Wheel, harmonics: tuple[int, ...], displacement: np.ndarray) -> Iterator[np.ndarray]:
    """Vibration (n_node, 3) [m] of every blade in its own frame, at the instant when blade 0 begins its period.

    displacement : (n_node, 3, n_coeff) of blade 0 [m]
    """
    basis = HarmonicBasis(harmonics, 2 * harmonics[-1] + 1)
    functions = basis.functions(np.zeros(1))[0] * (basis.order > 0)
    for n in range(wheel.n_sectors):
        yield at_sector(basis, displacement, wheel.engine_order, wheel.n_sectors, n) @ functions
