"""Pictures of a wheel, drawn off-screen with pyvista: one blade from both sides, and all of them, each with its phase.

A wave repeats every blade one phase later, in its own turned frame: what one blade does, the others do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from tribodyn.fem.cyclic import rotation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.travelling_wave import at_sector
from tribodyn.workflows.pictures import view as drawing
from tribodyn.workflows.pictures.style import WEAR_MAP
from tribodyn.workflows.pictures.view import BODY, SHADE
from tribodyn.workflows.result.result import PartMesh, Patch, Result

WAVE_MAP = "magma"
CLOSE = 5  # shrouds in the close view
GLASS = 0.25  # opacity of shrouds that stand before their contacts


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


@dataclass(frozen=True)
class _Shell:
    """The surface of some cells of a part, which follows the nodes of the part.

    nodes : (n_point,) nodes of the part on the surface; faces : as VTK wants them
    """

    nodes: np.ndarray
    faces: np.ndarray

    @classmethod
    def of(cls, part: PartMesh, cells: np.ndarray, cell_type: int) -> _Shell:
        at_rest = drawing.surface(part.points, cells, cell_type, 0)
        return cls(cKDTree(part.points).query(at_rest.points)[1], np.asarray(at_rest.faces))

    def at(self, points: np.ndarray) -> Any:
        """The surface where the nodes of the part are at points (n_node, 3) [m]."""
        import pyvista as pv

        return pv.PolyData(points[self.nodes], self.faces)


def wheel_of(result: Result) -> Wheel | None:
    """The wheel of a result, None where its part stands alone."""
    if "sectors" not in result.facts:
        return None
    facts = result.facts
    return Wheel(int(str(facts["sectors"])), int(str(facts["engine_order"])), np.asarray(facts["axis"]))


def worn_sector(
    result: Result, wheel: Wheel, path: Path, deformation: float | None = None, wear: float | None = None
) -> Path:
    """One blade, preloaded and at its largest swing: the depth on its right face above, status on its left below."""
    import pyvista as pv

    patch, part, fields = result.patch, result.part, result.fields
    assert patch is not None
    assert part is not None
    assert fields is not None
    assert result.wear is not None
    size = float(np.ptp(part.points, axis=0).max())
    static = drawing.at_rest(fields.displacement, result.harmonics)
    rest_scale = deformation or drawing.deformation_scale(static, size)
    depth = np.stack([result.depth_after(row) for row in fields.row])
    wear = wear or 1.0
    left = left_patch(patch, part.points, wheel)
    cell_type = getattr(pv.CellType, part.kind.upper())
    resting = drawing.surface(part.points, part.cells, cell_type, 0).extract_feature_edges(40)
    view = drawing.plotter((2, len(static)), 640)
    for column, row in enumerate(fields.row):
        vibration = drawing.swing(fields.displacement[column], result.harmonics)
        scale = deformation or drawing.deformation_scale(vibration, size)
        points = part.points + rest_scale * static[column] + scale * vibration
        for face in (patch, left):
            points -= 0.5 * wear * drawing.sunk(part.points, face, depth[column])
        body = drawing.surface(points, part.cells, cell_type, 2)
        for line, face in enumerate((patch, left)):
            view.subplot(line, column)
            view.add_mesh(body, color=BODY, **SHADE, smooth_shading=True, split_sharp_edges=True)
            view.add_mesh(resting, color="#9aa1ab", line_width=1)
            lifted = points[face.nodes] + 2e-3 * size * face.frames[:, 2]
            if line == 0:
                worn = pv.PolyData(lifted, drawing.polygons(face.faces))
                label = "total wear depth / mm"
                drawing.add_field(view, worn, 1e3 * depth[column], 1e3 * depth.max(), label, WEAR_MAP, f"0 {column}")
            else:
                drawing.add_status(view, face, lifted, result.wear.status[row])
            _look_at_blade(view, part.points, face)
        view.subplot(0, column)
        scales = f"static × {rest_scale:g}, vibration × {scale:g}, depth on this body × {wear:g}"
        drawing.title(view, result, row, scales)
    return drawing.save(view, path)


def worn_wheel(result: Result, wheel: Wheel, path: Path, deformation: float | None = None) -> Path:
    """All blades at one instant, then some shrouds with the depth and the status of their contacts."""
    import pyvista as pv

    patch, part, fields = result.patch, result.part, result.fields
    assert patch is not None
    assert part is not None
    assert fields is not None
    assert result.wear is not None
    depth = np.stack([result.depth_after(row) for row in fields.row])
    cell_type = getattr(pv.CellType, part.kind.upper())
    height = np.linalg.norm(np.cross(part.points, wheel.axis), axis=1)
    radius = float(height.max())
    shrouds = (height[part.cells] > (1 - 1e-6) * height[patch.nodes].min()).all(axis=1)
    whole, ring = (_Shell.of(part, cells, cell_type) for cells in (part.cells, part.cells[shrouds]))
    view = drawing.plotter((3, len(fields.row)))
    for column, row in enumerate(fields.row):
        wave = fields.displacement[column]
        swing = drawing.swing(wave, result.harmonics)
        largest = float(np.linalg.norm(swing, axis=-1).max())
        scale = deformation or drawing.deformation_scale(swing, 2 * radius)
        moved = list(instants(wheel, result.harmonics, wave))
        rest = part.points + drawing.at_rest(wave, result.harmonics)
        view.subplot(0, column)
        for n, vibration in enumerate(moved):
            blade = whole.at(wheel.blade(rest + scale * vibration, n))
            blade[f"swing {column}"] = 1e3 * np.linalg.norm(vibration, axis=-1)[whole.nodes]
            view.add_mesh(
                blade, scalars=f"swing {column}", cmap=WAVE_MAP, clim=(0, 1e3 * largest), **SHADE,
                show_scalar_bar=n == 0, scalar_bar_args=drawing.bar("vibration at one instant / mm", column),
            )  # fmt: skip
        _look_along_axis(view, wheel, np.zeros(3), 0.25, 1.5 * radius)
        drawing.title(view, result, row, f"engine order {wheel.engine_order}, vibration × {scale:g}")
        for line in (1, 2):
            view.subplot(line, column)
            for n in range(-(CLOSE // 2), CLOSE // 2 + 1):
                here = wheel.blade(rest + moved[n % wheel.n_sectors], n)
                glass = ring.at(here)
                view.add_mesh(glass, color=BODY, opacity=GLASS, **SHADE)
                view.add_mesh(glass.extract_feature_edges(40), color="#9aa1ab", line_width=1)
                place = here[patch.nodes]
                if line == 1:
                    worn = pv.PolyData(place, drawing.polygons(patch.faces))
                    label, most = "total wear depth / mm", 1e3 * depth.max()
                    drawing.add_field(view, worn, 1e3 * depth[column], most, label, WEAR_MAP, f"1 {column}")
                else:
                    drawing.add_status(view, patch, place, result.wear.status[row], legend=n == 0)
            width = CLOSE * 2 * np.pi / wheel.n_sectors * radius
            _look_along_axis(view, wheel, patch.points.mean(axis=0), 0.55, 0.22 * width)
    return drawing.save(view, path)


def instants(wheel: Wheel, harmonics: tuple[int, ...], displacement: np.ndarray) -> Iterator[np.ndarray]:
    """Vibration (n_node, 3) [m] of every blade in its own frame, at the instant when blade 0 begins its period.

    displacement : (n_node, 3, n_coeff) of blade 0 [m]
    """
    basis = HarmonicBasis(harmonics, 2 * harmonics[-1] + 1)
    functions = basis.functions(np.zeros(1))[0] * (basis.order > 0)
    for n in range(wheel.n_sectors):
        yield at_sector(basis, displacement, wheel.engine_order, wheel.n_sectors, n) @ functions


def left_patch(patch: Patch, points: np.ndarray, wheel: Wheel) -> Patch:
    """The patch on the left face of the same blade, where the next one touches it; pairs in the same order."""
    return patch.moved(points, patch.points @ wheel.turn.T, -patch.frames @ wheel.turn.T)


def _look_at_blade(view: Any, points: np.ndarray, face: Patch) -> None:
    """Camera on the side of a face, the blade standing upright."""
    normal = face.frames[:, 2].mean(axis=0)
    centre = points.mean(axis=0)
    up = face.points.mean(axis=0) - centre
    up -= normal * (up @ normal)
    up /= np.linalg.norm(up)
    aside = np.cross(up, normal)
    view.camera.focal_point = centre
    view.camera.position = centre + 2.0 * (0.9 * normal + 0.55 * aside + 0.1 * up) * np.ptp(points, axis=0).max()
    view.camera.up = up
    view.reset_camera()
    view.camera.zoom(0.8)


def _look_along_axis(view: Any, wheel: Wheel, centre: np.ndarray, tilt: float, reach: float) -> None:
    """Parallel view against the axis of the wheel, a little from above.

    tilt : slope of the line of sight; reach : half the height of the view [m], a fifth of it is left below for a legend
    """
    radial = centre - wheel.axis * (centre @ wheel.axis)
    size = np.linalg.norm(radial)
    across = np.cross(wheel.axis, [0.0, 1.0, 0.0] if abs(wheel.axis[1]) < 0.9 else [0.0, 0.0, 1.0])
    up = radial / size if size > 0 else across / np.linalg.norm(across)
    view.enable_parallel_projection()
    view.camera.focal_point = centre - 0.1 * reach * up
    view.camera.position = view.camera.focal_point + 3.0 * (wheel.axis + tilt * up)
    view.camera.up = up
    view.camera.parallel_scale = reach
    view.camera.clipping_range = (0.1, 10.0)
