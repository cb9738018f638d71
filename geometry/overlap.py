"""Whether a body lies in another one: elements whose middle is inside the other body's surface."""

from __future__ import annotations

from typing import Any

import numpy as np

MOST = 1000  # elements of a body that are looked at
SHARE = 0.01  # of them inside another body, from which on the two overlap: a press fit reaches into no middle
BLOCK = 2_000_000  # points times triangles at once


def overlap(one: Any, other: Any) -> tuple[float, np.ndarray] | None:
    """Share of the elements of one mesh whose middles lie in the other one, and the mean of their places (3,) [m].

    one, other : skfem MeshHex2 or MeshTet2; None where less than SHARE of them do
    """
    middles = _middles(one)
    picked = middles[np.unique(np.linspace(0, len(middles) - 1, MOST).astype(int))]
    corners = other.doflocs[:, np.unique(other.t)]
    near = picked[((picked > corners.min(axis=1)) & (picked < corners.max(axis=1))).all(axis=1)]
    if len(near) < SHARE * len(picked):
        return None
    triangles = _triangles(other)
    step = max(BLOCK // len(triangles), 1)
    parts = [_winding(near[i : i + step], triangles) for i in range(0, len(near), step)]
    inside = near[np.abs(np.concatenate(parts)) > 0.5]
    return (len(inside) / len(picked), inside.mean(axis=0)) if len(inside) >= SHARE * len(picked) else None


def _middles(mesh: Any) -> np.ndarray:
    """(n, 3) middles of elements: those of their corners lie elsewhere where few elements go around a ring."""
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
    found = np.concatenate([points[:, list(third)] for third in thirds])
    behind = np.tile(mesh.doflocs[:, mesh.t].mean(axis=1).T[mesh.f2t[0, facets]], (len(thirds), 1))
    normal = np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0])
    inward = np.einsum("nx,nx->n", normal, found.mean(axis=1) - behind) < 0
    found[inward] = found[inward, ::-1]
    return np.asarray(found)


def _winding(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(k,) how often a surface (n, 3, 3) winds around points (k, 3): 1 inside, 0 outside.

    Source  solid angle of a triangle: van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30, 1983
    """
    a, b, c = np.moveaxis(triangles[None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    triple = np.einsum("knx,knx->kn", a, np.cross(b, c))
    below = la * lb * lc + sum(np.einsum("knx,knx->kn", u, v) * l for u, v, l in ((a, b, lc), (b, c, la), (c, a, lb)))
    return np.asarray(np.arctan2(triple, below).sum(axis=1) / (2 * np.pi))
