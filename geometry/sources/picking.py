"""Faces of a body picked by where they lie: within a box, nearest to a point, by their normal.

Only facets of the boundary are picked; faces of a CAD file have groups "face N" of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

SMOOTH = np.cos(np.radians(30.0))  # facets that meet at less belong to one face


def outline(mesh: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Boundary facets (k,), their centres (k, 3) [m] and outward unit normals (k, 3)."""
    facets = np.flatnonzero(mesh.f2t[1] < 0)
    corners = mesh.p[:, mesh.facets[:, facets]]
    centre = corners.mean(axis=1)
    last = corners.shape[1] - 1
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, last] - corners[:, 0], axis=0)
    body = mesh.p[:, mesh.t[:, mesh.f2t[0, facets]]].mean(axis=1)
    normal *= np.sign((normal * (centre - body)).sum(axis=0))
    return facets, centre.T, (normal / np.linalg.norm(normal, axis=0)).T


def within_box(mesh: Any, low: Sequence[float], high: Sequence[float]) -> np.ndarray:
    """Boundary facets whose corners all lie in a box [m]; raises ValueError where there are none."""
    facets, _, _ = outline(mesh)
    corners = mesh.p[:, mesh.facets[:, facets]]
    slack = 1e-6 * float(np.ptp(mesh.p, axis=1).max())
    inside = (corners >= np.reshape(low, (3, 1, 1)) - slack) & (corners <= np.reshape(high, (3, 1, 1)) + slack)
    return _some(facets[inside.all(axis=(0, 1))], mesh, f"lies within the box {list(low)} to {list(high)}")


def by_normal(mesh: Any, direction: Sequence[float], degrees: float = 5.0) -> np.ndarray:
    """Boundary facets whose outward normal points along a direction to within an angle; raises ValueError likewise."""
    facets, _, normal = outline(mesh)
    along = np.asarray(direction, dtype=float)
    if along.shape != (3,) or not along.any():
        raise ValueError(f"a normal must be three numbers that are not all zero, got {list(direction)}")
    here = normal @ (along / np.linalg.norm(along)) >= np.cos(np.radians(degrees))
    return _some(facets[here], mesh, f"faces {list(direction)} to within {degrees:g} degrees")


def nearest(mesh: Any, point: Sequence[float]) -> np.ndarray:
    """The smooth face nearest to a point [m]: its nearest facet and all that go on from it without an edge."""
    facets, centre, normal = outline(mesh)
    place = np.full(mesh.facets.shape[1], -1)
    place[facets] = np.arange(len(facets))
    edges = mesh.f2e[:, facets]
    owner: dict[int, list[int]] = {}
    for i, around in enumerate(edges.T.tolist()):
        for edge in around:
            owner.setdefault(edge, []).append(i)
    start = int(np.linalg.norm(centre - np.asarray(point, dtype=float), axis=1).argmin())
    found, queue = {start}, [start]
    while queue:
        i = queue.pop()
        for edge in edges[:, i].tolist():
            for j in owner[edge]:
                if j not in found and normal[i] @ normal[j] >= SMOOTH:
                    found.add(j)
                    queue.append(j)
    return np.asarray(np.sort(facets[sorted(found)]))


def _some(facets: np.ndarray, mesh: Any, what: str) -> np.ndarray:
    if not len(facets):
        low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
        extent = " to ".join("(" + ", ".join(f"{x:.4g}" for x in corner) + ")" for corner in (low, high))
        raise ValueError(f"no face of the boundary {what}: the body reaches from {extent} m")
    return facets
