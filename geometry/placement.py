"""Move, turn and scale a mesh; extract one volume of a mesh; measure the overlap of two bodies."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tribodyn.geometry.element_library import skfem
from tribodyn.refusal import Refusal

MAX_SAMPLES = 1000  # elements of a body that are looked at
SHARE = 0.01  # of them inside another body, from which on the two overlap: a press fit reaches into no middle
BLOCK = 2_000_000  # points times triangles at once


def rotation(axis: Sequence[float] | np.ndarray, angle: float) -> np.ndarray:
    """Rotation (3, 3) about an axis through the origin by an angle [rad], by Rodrigues' formula."""
    a = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    return np.asarray(np.eye(3) + np.sin(angle) * cross(a) + (1 - np.cos(angle)) * cross(a) @ cross(a))


def cross(a: np.ndarray) -> np.ndarray:
    """(3, 3) matrix of a x: what multiplies a vector by a, crosswise."""
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def place(mesh: Any, scale: float, turn: np.ndarray, shift: np.ndarray) -> Any:
    """The mesh with nodes at turn @ (scale x) + shift; turn (3, 3) is a rotation, shift (3,) [m]."""
    if scale == 1.0 and not shift.any() and np.array_equal(turn, np.eye(3)):
        return mesh
    return replace(mesh, doflocs=np.ascontiguousarray(turn @ (scale * mesh.doflocs) + shift[:, None]))


def extract_volume(mesh: Any, node_sets: Mapping[str, np.ndarray], volume: str) -> tuple[Any, dict[str, np.ndarray]]:
    """One volume group of a mesh as a mesh of its own, which shares no nodes with the rest.

    Returns mesh and node_sets as geometry.mesh.read gives them, of the groups that reach into the volume; a surface
        group inside the mesh becomes a face of it
    Raises  Refusal where there is no such volume"""
    volumes = mesh.subdomains or {}
    if volume not in volumes:
        raise Refusal(f"the mesh has no volume '{volume}'; it has {', '.join(sorted(volumes)) or 'none'}")
    elements = np.sort(volumes[volume])
    corners, t = np.unique(mesh.t[:, elements], return_inverse=True)
    first = skfem.MeshTet1 if mesh.elem.refdom.nnodes == 4 else skfem.MeshHex1
    extracted = type(mesh).from_mesh(first(np.ascontiguousarray(mesh.p[:, corners]), t.reshape(mesh.t.shape[0], -1)))
    locations = extracted.doflocs.copy()
    mesh_dofs = mesh.dofs.element_dofs[:, elements]
    extracted_dofs = extracted.dofs.element_dofs
    locations[:, extracted_dofs] = mesh.doflocs[:, mesh_dofs]
    number = np.full(mesh.doflocs.shape[1], -1)
    number[mesh_dofs] = extracted_dofs
    place = np.full(mesh.p.shape[1], -1)
    place[corners] = np.arange(len(corners))
    facets = {tuple(sorted(facet)): i for i, facet in enumerate(extracted.facets.T.tolist())}
    boundaries = {}
    for name, group in (mesh.boundaries or {}).items():
        inside = [facets.get(tuple(sorted(facet))) for facet in place[mesh.facets[:, group]].T.tolist()]
        inner_facets = np.array([i for i in inside if i is not None], dtype=int)
        if len(inner_facets):
            boundaries[name] = np.unique(inner_facets)
    position = np.full(mesh.t.shape[1], -1)
    position[elements] = np.arange(len(elements))
    subdomains = {name: np.sort(at[at >= 0]) for name, of in volumes.items() if ((at := position[of]) >= 0).any()}
    sets = {name: np.sort(at[at >= 0]) for name, of in node_sets.items() if ((at := number[of]) >= 0).any()}
    result = replace(extracted, doflocs=locations).with_boundaries(boundaries).with_subdomains(subdomains)
    return result, sets


def overlap(first: Any, second: Any) -> tuple[float, np.ndarray] | None:
    """Share of the elements of one mesh whose middles lie in the other one, and the mean of their places (3,) [m].

    first, second : skfem MeshHex2 or MeshTet2; None where less than SHARE of them do"""
    middles = _middles(first)
    picked = middles[np.unique(np.linspace(0, len(middles) - 1, MAX_SAMPLES).astype(int))]
    corners = second.doflocs[:, np.unique(second.t)]
    candidates = picked[((picked > corners.min(axis=1)) & (picked < corners.max(axis=1))).all(axis=1)]
    if len(candidates) < SHARE * len(picked):
        return None
    triangles = _triangles(second)
    step = max(BLOCK // len(triangles), 1)
    parts = [_winding(candidates[i : i + step], triangles) for i in range(0, len(candidates), step)]
    inside = candidates[np.abs(np.concatenate(parts)) > 0.5]
    return (len(inside) / len(picked), inside.mean(axis=0)) if len(inside) >= SHARE * len(picked) else None


def _middles(mesh: Any) -> np.ndarray:
    """(n, 3) middles of elements; the mean of the corners would lie elsewhere in a ring of few elements."""
    element, at = mesh.elem(), mesh.refdom.p.mean(axis=1, keepdims=True)
    nodes = mesh.dofs.element_dofs
    weight = [float(np.ravel(element.lbasis(at, a)[0])[0]) for a in range(len(nodes))]
    return np.asarray(np.einsum("a,xan->nx", weight, mesh.doflocs[:, nodes]))


def _triangles(mesh: Any) -> np.ndarray:
    """(n, 3, 3) corners of the triangles of the surface, its edges taken as straight, numbered outward."""
    facets = np.flatnonzero(mesh.f2t[1] < 0)
    points = mesh.doflocs.T[mesh.facets[:, facets].T]
    n = points.shape[1]
    thirds = [(0, i, i + 1) for i in range(1, n - 1)]
    corners = np.concatenate([points[:, list(third)] for third in thirds])
    body_centre = np.tile(mesh.doflocs[:, mesh.t].mean(axis=1).T[mesh.f2t[0, facets]], (len(thirds), 1))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("nx,nx->n", normal, corners.mean(axis=1) - body_centre) < 0
    corners[inward] = corners[inward, ::-1]
    return np.asarray(corners)


def _winding(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(k,) how often a surface (n, 3, 3) winds around points (k, 3): 1 inside, 0 outside.

    Source  solid angle of a triangle: van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30, 1983"""
    a, b, c = np.moveaxis(triangles[None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    triple = np.einsum("knx,knx->kn", a, np.cross(b, c))
    lower = la * lb * lc + sum(np.einsum("knx,knx->kn", u, v) * l for u, v, l in ((a, b, lc), (b, c, la), (c, a, lb)))
    return np.asarray(np.arctan2(triple, lower).sum(axis=1) / (2 * np.pi))
