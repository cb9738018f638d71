"""Which node of the mesh stands where a pair of a contact does."""

import numpy as np

from tribodyn.workflows.result.faces import Face


def node_of_pair(face: Face) -> np.ndarray:
    """(n_pair,) node of the mesh that stands where the pair does, -1 where none does."""
    node = np.full(len(face.points), -1)
    at = face.weights.tocoo()
    current = at.data > 1 - 1e-4
    node[at.col[current]] = face.nodes[at.row[current]]
    return node
