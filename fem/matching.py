"""Nodes of one face that lie on the nodes of another."""

from __future__ import annotations

import numpy as np
import scipy

from tribodyn.refusal import Refusal

TOLERANCE = 1e-4  # largest distance of two matching nodes, as a part of the length of the first face


class Mismatch(Refusal):
    """Nodes of two faces that should meet do not."""


def partners(points: np.ndarray, others: np.ndarray, what: str, length: float | None = None) -> np.ndarray:
    """Which of the others lies at each point.

    points : (k, 3), others : (m, 3), m >= k [m]; what : the two faces, for the error
    length : that the tolerance is a part of, by default that of the first face [m]
    Returns (k,) numbers of the others, all different
    Raises  Mismatch, naming what and the worst place, where a point has no partner
    """
    distance, partner = scipy.spatial.cKDTree(others).query(points)
    lost = distance > TOLERANCE * (_length(points) if length is None else length)
    if lost.any() or len(np.unique(partner)) < len(partner):
        worst = points[distance.argmax()]
        raise Mismatch(
            f"{what} do not match: {lost.sum()} of {len(partner)} nodes of the first have no partner on the second, "
            f"the farthest at ({worst[0]:.4g}, {worst[1]:.4g}, {worst[2]:.4g}) m is {distance.max():.3g} m away; "
            "mesh both with the same grid"
        )
    return partner


def facing_partners(
    points: np.ndarray, normals: np.ndarray, others: np.ndarray, reach: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Which of the others lies over each point along its normal, and how far (k,) [m], negative below.

    points, normals : (k, 3); others : (m, 3); reach : farthest distance along the normal [m]
    Returns None where a point has no partner of its own
    """
    _, partner = scipy.spatial.cKDTree(others).query(points)
    apart = others[partner] - points
    opening = np.einsum("kx,kx->k", apart, normals)
    across = np.linalg.norm(apart - opening[:, None] * normals, axis=1)
    far = (across > TOLERANCE * _length(points)) | (np.abs(opening) > reach)
    return None if far.any() or len(np.unique(partner)) < len(partner) else (partner, opening)


def _length(points: np.ndarray) -> float:
    """Largest extent of some points (k, 3)."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))
