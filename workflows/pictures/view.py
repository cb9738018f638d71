"""What the pictures in three dimensions share: motion over a cycle, factors of exaggeration, surfaces.

pyvista is imported by the functions here and nowhere else."""

from typing import Any

import numpy as np

from tribodyn.extras import package
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.workflows.pictures.theme import LAYOUT
from tribodyn.workflows.result.result import PartMesh, Patch, Result


def at_rest(displacement: np.ndarray, harmonics: tuple[int, ...]) -> np.ndarray:
    """Static part (...) of coefficients (..., n_coeff) on these harmonics, none where harmonic 0 is not kept [m]."""
    return displacement[..., 0] if harmonics[0] == 0 else np.zeros(displacement.shape[:-1])


def swing(displacement: np.ndarray, harmonics: tuple[int, ...]) -> np.ndarray:
    """Vibration at the instant when the part is farthest from its mean position.

    displacement : (n_node, 3, n_coeff) on these harmonics [m]
    Returns (n_node, 3) [m]"""
    dynamic = cycle(displacement, harmonics)
    farthest = int(np.argmax(np.sum(dynamic**2, axis=(0, 1))))
    return np.asarray(dynamic[..., farthest])


def cycle(displacement: np.ndarray, harmonics: tuple[int, ...]) -> np.ndarray:
    """Vibration about the mean position (..., n_instant) over one cycle from coefficients (..., n_coeff) [m]."""
    basis = HarmonicBasis(harmonics, max(LAYOUT.instants, 2 * harmonics[-1] + 1))
    return np.asarray(displacement @ (basis.synthesis * (basis.order > 0)).T)


def deformation_scale(displacement: np.ndarray, size: float) -> float:
    """Factor that draws the largest of some displacements (..., 3) as a twelfth of the part."""
    largest = float(np.linalg.norm(displacement, axis=-1).max())
    return nice(size / 12 / largest) if largest > 0 else 1.0


def rest_scale(static: np.ndarray, points: np.ndarray, body: np.ndarray) -> float:
    """Factor that draws displacements at rest (n_state, n_node, 3), by which bodies hardly enter each other.

    Bodies (n_node,) that slide along each other at points (n_node, 3), as a bolt through its nut, do so by no more than
    a share of the thinnest"""
    scale, each = deformation_scale(static, float(np.ptp(points, axis=0).max())), range(int(body.max()) + 1)
    means = np.stack([static[:, body == b].mean(axis=1) for b in each])
    spread = float(np.linalg.norm(means[:, None] - means[None], axis=-1).max())
    least = min(float(np.ptp(points[body == b], axis=0).min()) for b in each)
    return min(scale, nice(LAYOUT.sunk * least / spread)) if spread > 0 else scale


def wear_scale(patch: Patch, depth: np.ndarray) -> float:
    """Factor, at least 1, that draws the largest depth on one body as a tenth of the patch."""
    target = 0.1 * float(np.sqrt(patch.area.sum()))
    return max(1.0, nice(target / (0.5 * depth.max()))) if depth.max() > 0 else 1.0


def nice(value: float) -> float:
    """The largest of 1, 2, 5, 10, ... (or 0.5, 0.2, ...) that is not above a value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(f"{max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)):.6g}")


def grid_of(part: PartMesh, points: np.ndarray | None = None, cells: np.ndarray | None = None) -> Any:
    """The mesh of a part as a pyvista grid, or some of its cells; points : (n_node, 3) of its nodes as drawn [m]."""
    pv = package("pyvista")

    kind = int(getattr(pv.CellType, part.kind.upper()))
    return pv.UnstructuredGrid(
        {kind: part.cells if cells is None else cells}, part.points if points is None else points
    )


def surface(grid: Any, subdivision: int = 0) -> Any:
    """The surface of a grid, faces of curved elements cut into smaller ones so many times."""
    return grid.extract_surface(nonlinear_subdivision=subdivision, algorithm="dataset_surface")


def polygons(faces: np.ndarray) -> np.ndarray:
    return np.column_stack([np.full(len(faces), faces.shape[1]), faces]).ravel()


def looking(result: Result) -> tuple[np.ndarray, np.ndarray]:
    """Where to look from, and what is up: a little aside of the face of body 1, a sector with its outside upwards."""
    part, patch, wheel = result.part, result.patch, result.facts.around
    points = patch.points if part is None else part.points
    normal = patch.frames[:, 2].mean(axis=0)
    if wheel is not None:
        axis = wheel.axis / np.linalg.norm(wheel.axis)
        outside = points.mean(axis=0) - axis * (points.mean(axis=0) @ axis)
        outside /= np.linalg.norm(outside)
        sideways = np.cross(axis, outside)
        side = 1.0 if normal @ sideways >= 0 else -1.0
        return 0.8 * axis + 0.6 * side * sideways + 0.3 * outside, outside
    lengthwise = patch.points.mean(axis=0) - points.mean(axis=0)
    lengthwise -= normal * (lengthwise @ normal)
    if np.linalg.norm(lengthwise) < 1e-6 * np.ptp(points, axis=0).max():
        lengthwise = patch.frames[:, 0].mean(axis=0)
    lengthwise = lengthwise / np.linalg.norm(lengthwise)
    sideways = np.cross(normal, lengthwise)
    return 0.5 * normal + 0.45 * lengthwise + 0.9 * sideways, -normal
