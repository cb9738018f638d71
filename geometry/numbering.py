"""How the nodes of second-order elements are numbered, once for all, by where they lie.

A node beyond the corners lies at the mean of the corners that support it: two for an edge, four for a face, eight
for the middle. From that follow reference coordinates, and from two lists of reference coordinates follows the
permutation between any two programs."""

import numpy as np

from tribodyn.refusal import Refusal

# The order of meshio, which is VTK's.
HEX_CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float
)
HEX_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
HEX_FACES = ((0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7))
TET_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
TET_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
QUAD_CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
QUAD_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))


def _reference(corners: np.ndarray, *supports: tuple[tuple[int, ...], ...]) -> np.ndarray:
    offset = [corners[list(support)].mean(axis=0) for group in supports for support in group]
    return np.vstack([corners, *offset])


REFERENCE_POINTS = {
    "hexahedron27": _reference(HEX_CORNERS, HEX_EDGES, HEX_FACES, (tuple(range(8)),)),
    "hexahedron20": _reference(HEX_CORNERS, HEX_EDGES),
    "tetra10": _reference(TET_CORNERS, TET_EDGES),
    "quad9": _reference(QUAD_CORNERS, QUAD_EDGES, (tuple(range(4)),)),
}


def permutation(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Find where each target node stands in the source's numbering.

    source, target : (n, d) reference coordinates of the same nodes in two numberings, on the same reference element
    Returns (n,) so that source[result] equals target
    Raises Refusal: the two do not list the same nodes"""
    distance = np.abs(source[None, :, :] - target[:, None, :]).max(axis=2)
    order = distance.argmin(axis=1)
    if len(source) != len(target) or distance.min(axis=1).max() > 1e-9:
        raise Refusal("the two node numberings do not describe the same element: give both on one reference element")
    return order
