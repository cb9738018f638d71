"""Pictures of a wheel, drawn off-screen with pyvista: all blades, each with its phase.

A wave repeats every blade one phase later, in its own turned frame: what one blade does, the others do."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from tribodyn.extras import package
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.travelling_wave import at_sector
from tribodyn.workflows.pictures import view as drawing
from tribodyn.workflows.pictures.figures import heading, length_unit, present, scale_bar
from tribodyn.workflows.pictures.matplotlib_names import Figure, mpl
from tribodyn.workflows.pictures.shots import Layer, frame, shoot, show
from tribodyn.workflows.pictures.theme import LAYOUT, MOTION_MAP, STYLE
from tribodyn.workflows.result.contact_states import shown_states
from tribodyn.workflows.result.model_facts import Around
from tribodyn.workflows.result.result import PartMesh, Result


class BladeSurface:
    """All blades of a wheel as one surface, seen nearly along its axis.

    nodes : (n_point,) of the part on its surface; size : largest distance of the part from the axis [m]"""

    def __init__(self, wheel: Around, part: PartMesh):
        shell = drawing.surface(drawing.grid_of(part)).triangulate()
        self.nodes = cKDTree(part.points).query(shell.points)[1]
        blades = len(self.nodes) * np.arange(wheel.sectors)[:, None, None]
        self._faces = drawing.polygons((shell.regular_faces + blades).reshape(-1, 3))
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
        return shoot([layer], self.camera, LAYOUT.wheel)


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
            show(axes, blades.shot(static, motion[:, blades.nodes], scale, largest))
            axes.set_title(f"{state.label}\nvibration × {scale:g}")
            unit, factor = length_unit(largest)
            scale_bar(figure, axes, MOTION_MAP, 0.0, factor * largest, f"vibration at one instant / {unit}")
        heading(figure, result, f"wheel of {wheel.sectors} sectors, engine order {wheel.engine_order}")
    return figure


def instants(wheel: Around, harmonics: tuple[int, ...], displacement: np.ndarray) -> Iterator[np.ndarray]:
    """Vibration (n_node, 3) [m] of every blade in its own frame, at the instant when blade 0 begins its period.

    displacement : (n_node, 3, n_coeff) of blade 0 [m]"""
    basis = HarmonicBasis(harmonics, 2 * harmonics[-1] + 1)
    functions = basis.functions(np.zeros(1))[0] * (basis.order > 0)
    for n in range(wheel.sectors):
        yield at_sector(basis, displacement, wheel.engine_order, wheel.sectors, n) @ functions
