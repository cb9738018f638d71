"""Nodes of one face that lie on the nodes of another."""

import numpy as np
import scipy

from tribodyn.refusal import Refusal

TOLERANCE = 1e-4  # largest distance of two matching nodes, as a part of the length of the first face


class Mismatch(Refusal):
    """Nodes of two faces that should meet do not."""


def partners(points: np.ndarray, candidates: np.ndarray, label: str, length: float | None = None) -> np.ndarray:
    """The candidate that lies at each point.

    points : (k, 3), candidates : (m, 3), m >= k [m]; label : the two faces, for the error
    length : reference of the relative tolerance, by default the length of the first face [m]
    Returns (k,) numbers of candidates, all different
    Raises  Mismatch, naming the faces and the worst place, where a point has no partner"""
    distance, partner = scipy.spatial.cKDTree(candidates).query(points)
    unmatched = distance > TOLERANCE * (_length(points) if length is None else length)
    if unmatched.any() or len(np.unique(partner)) < len(partner):
        x, y, z = points[distance.argmax()]
        raise Mismatch(
            f"{label} do not match: {unmatched.sum()} of {len(partner)} nodes of the first have no partner on the "
            f"second, the farthest at ({x:.4g}, {y:.4g}, {z:.4g}) m is {distance.max():.3g} m away; "
            "mesh both with the same grid"
        )
    return partner


def facing_partners(
    points: np.ndarray, normals: np.ndarray, candidates: np.ndarray, reach: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """The candidate that lies over each point along its normal, and how far (k,) [m], negative below.

    points, normals : (k, 3); candidates : (m, 3); reach : farthest distance along the normal [m]
    Returns None where a point has no partner of its own"""
    _, partner = scipy.spatial.cKDTree(candidates).query(points)
    offset = candidates[partner] - points
    opening = np.einsum("kx,kx->k", offset, normals)
    across = np.linalg.norm(offset - opening[:, None] * normals, axis=1)
    far = (across > TOLERANCE * _length(points)) | (np.abs(opening) > reach)
    return None if far.any() or len(np.unique(partner)) < len(partner) else (partner, opening)


def _length(points: np.ndarray) -> float:
    """Largest extent of some points (k, 3)."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))
