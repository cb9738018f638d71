"""A mesh moved, turned and scaled; one volume taken out of a mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import skfem


def rotation(axis: Sequence[float] | np.ndarray, angle: float) -> np.ndarray:
    """Rotation (3, 3) about an axis through the origin by an angle [rad], by Rodrigues' formula."""
    a = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    return np.asarray(np.eye(3) + np.sin(angle) * cross(a) + (1 - np.cos(angle)) * cross(a) @ cross(a))


def cross(a: np.ndarray) -> np.ndarray:
    """(3, 3) matrix of a x: what multiplies a vector by a, crosswise."""
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def placed(mesh: Any, scale: float, turn: np.ndarray, shift: np.ndarray) -> Any:
    """The mesh with nodes at turn @ (scale x) + shift; turn (3, 3) is a rotation, shift (3,) [m]."""
    if scale == 1.0 and not shift.any() and np.array_equal(turn, np.eye(3)):
        return mesh
    return replace(mesh, doflocs=np.ascontiguousarray(turn @ (scale * mesh.doflocs) + shift[:, None]))


def taken(mesh: Any, node_sets: Mapping[str, np.ndarray], volume: str) -> tuple[Any, dict[str, np.ndarray]]:
    """One volume group of a mesh as a mesh of its own, which shares no nodes with the rest.

    Returns mesh and node_sets as geometry.mesh.read gives them, of the groups that reach into the volume; a surface
        group inside the mesh becomes a face of it
    Raises  ValueError where there is no such volume
    """
    volumes = mesh.subdomains or {}
    if volume not in volumes:
        raise ValueError(f"the mesh has no volume '{volume}'; it has {', '.join(sorted(volumes)) or 'none'}")
    elements = np.sort(volumes[volume])
    corners, t = np.unique(mesh.t[:, elements], return_inverse=True)
    first = skfem.MeshTet1 if mesh.elem.refdom.nnodes == 4 else skfem.MeshHex1
    own = type(mesh).from_mesh(first(np.ascontiguousarray(mesh.p[:, corners]), t.reshape(mesh.t.shape[0], -1)))
    locations = own.doflocs.copy()
    old = mesh.dofs.element_dofs[:, elements]
    new = own.dofs.element_dofs
    locations[:, new] = mesh.doflocs[:, old]
    number = np.full(mesh.doflocs.shape[1], -1)
    number[old] = new
    place = np.full(mesh.p.shape[1], -1)
    place[corners] = np.arange(len(corners))
    facets = {tuple(sorted(facet)): i for i, facet in enumerate(own.facets.T.tolist())}
    boundaries = {}
    for name, group in (mesh.boundaries or {}).items():
        inside = [facets.get(tuple(sorted(facet))) for facet in place[mesh.facets[:, group]].T.tolist()]
        found = np.array([i for i in inside if i is not None], dtype=int)
        if len(found):
            boundaries[name] = np.unique(found)
    position = np.full(mesh.t.shape[1], -1)
    position[elements] = np.arange(len(elements))
    subdomains = {name: np.sort(at[at >= 0]) for name, of in volumes.items() if ((at := position[of]) >= 0).any()}
    sets = {name: np.sort(at[at >= 0]) for name, of in node_sets.items() if ((at := number[of]) >= 0).any()}
    result = replace(own, doflocs=locations).with_boundaries(boundaries).with_subdomains(subdomains)
    return result, sets
