"""Plane polygons of facets: their outlines, areas and cuts, and the place of a point on a curved facet."""

import numpy as np

from tribodyn.fem.surface import tabulate


def tangent_planes(normal: np.ndarray) -> np.ndarray:
    """Two directions (n, 2, 3) normal to each normal and to each other."""
    least = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first = np.cross(normal, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normal, first)], axis=1)


def reference_corners(corners: int) -> np.ndarray:
    return np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]) if corners == 4 else np.array([[0.0, 0], [1, 0], [0, 1]])


def polygon_areas(polygon: np.ndarray) -> np.ndarray:
    """Signed areas of polygons (n, m, 2)."""
    x, y = polygon[..., 0], polygon[..., 1]
    return np.asarray((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1) / 2)


def clip_polygons(subject: np.ndarray, region: np.ndarray) -> np.ndarray:
    """Polygons (n, m, 2) cut by convex ones (n, k, 2), counterclockwise; vertices may repeat, none left is all equal.

    Source  Sutherland and Hodgman, Communications of the ACM 17, 1974, for all polygons at once: a vertex that is cut
        off moves to where its edges cross the line, so that each cut doubles no more than the vertices"""
    for k in range(region.shape[1]):
        start, end = region[:, k], region[:, (k + 1) % region.shape[1]]
        edge = end - start
        offset = subject - start[:, None]
        inside = edge[:, None, 0] * offset[..., 1] - edge[:, None, 1] * offset[..., 0]
        following, next_inside = np.roll(subject, -1, axis=1), np.roll(inside, -1, axis=1)
        crosses = (inside >= 0) != (next_inside >= 0)
        t = np.divide(inside, inside - next_inside, out=np.zeros_like(inside), where=crosses)
        crossing = subject + t[..., None] * (following - subject)
        m = subject.shape[1]
        candidates = np.stack([subject, crossing], axis=2).reshape(len(subject), 2 * m, 2)
        is_kept = np.stack([inside >= 0, crosses], axis=2).reshape(len(subject), 2 * m)
        count = is_kept.sum(axis=1)
        width = max(int(count.max(initial=0)), 1)
        order = np.argsort(~is_kept, axis=1, kind="stable")[:, :width]
        packed = np.take_along_axis(candidates, order[..., None], axis=1)
        last = np.maximum(count - 1, 0)[:, None]
        place = np.minimum(np.arange(width)[None], last)
        subject = np.take_along_axis(packed, place[..., None], axis=1)
        subject[count == 0] = 0.0
    return subject


def locate_on_facets(points: np.ndarray, at: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Reference coordinates (2, n) of the point of each facet that lies at `at` as seen along the normal to e.

    points : (n, k, 3) facets; at : (n, 3); e : (n, 2, 3). Far outside a facet its map at the middle is taken as linear
    """
    k = points.shape[1]
    xi = np.full((2, len(at)), 0.5 if k in (9, 4) else 1 / 3)
    first = xi
    open_ = np.arange(len(at))
    for iteration in range(25):
        N, slopes = tabulate(k, xi[:, open_])
        local = points[open_]
        off = np.einsum("nix,nx->ni", e[open_], at[open_] - np.einsum("an,nax->nx", N, local))
        J = e[open_] @ (slopes.T @ local).transpose(0, 2, 1)
        det = J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0]
        det = np.where(det == 0, np.inf, det)
        step = (
            np.stack([J[:, 1, 1] * off[:, 0] - J[:, 0, 1] * off[:, 1], J[:, 0, 0] * off[:, 1] - J[:, 1, 0] * off[:, 0]])
            / det
        )
        xi[:, open_] += step
        if iteration == 0:
            first = xi.copy()
        open_ = open_[np.abs(step).max(axis=0) > 1e-13]
        if not len(open_):
            break
    lost = ~(np.abs(xi - 0.5).max(axis=0, initial=0) < 3.0)
    lost[open_] |= np.abs(xi[:, open_] - 0.5).max(axis=0, initial=0) > 1.0
    xi[:, lost] = first[:, lost]
    return xi
