"""Element geometry in batches: shape functions, gradients and weights at the quadrature points.

Nodes are the columns of the mesh's `doflocs`; a displacement DOF is node * 3 + component (x, y, z)."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix

from tribodyn.geometry.element_library import skfem
from tribodyn.refusal import Refusal


def coordinates(mesh: Any) -> np.ndarray:
    """Coordinates of all nodes (n_node, 3) [m]."""
    return np.asarray(mesh.doflocs.T)


def connectivity(mesh: Any) -> np.ndarray:
    """Nodes of the elements (n_element, 27, 10 or 8), in scikit-fem's local order.

    Raises  Refusal where the mesh is not of 27-node or 8-node hexahedra or 10-node tetrahedra"""
    if not isinstance(mesh, skfem.MeshHex1 | skfem.MeshTet2):  # MeshHex2 is a MeshHex1
        raise Refusal(
            f"the mesh is a {type(mesh).__name__}, but elasticity needs hexahedra or second-order tetrahedra "
            "(MeshTet2); raise the element order of the geometry"
        )
    return np.asarray(mesh.dofs.element_dofs.T)


def batches(
    mesh: Any, order: int = 5, size: int = 256, only: np.ndarray | None = None
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield elements (n_e,), N (n_q, n_a) [-], grad N (n_e, n_q, 3, n_a) [1/m], weight, as `mapped_batches` does."""
    for elements, N, dN, J, weight in mapped_batches(mesh, order, size, only):
        yield elements, N, np.linalg.solve(J, dN[None]), weight


def mapped_batches(
    mesh: Any, order: int = 5, size: int = 256, only: np.ndarray | None = None
) -> Iterator[tuple[np.ndarray, ...]]:
    """Yield (elements, N, dN, J, weight) for some elements at a time.

    order : polynomial order of the quadrature rule; 5 is exact for the mass of straight-sided elements, with 27 Gauss
        points in a hexahedron and 14 points in a tetrahedron
    size : elements at a time; memory only; only : numbers of elements, all by default
    Yields elements (n_e,), N (n_q, n_a) [-], dN (n_q, 3, n_a) in the reference element [-], J (n_e, n_q, 3, 3) [m] with
        d x_j / d X_i at [i, j], weight |J| w (n_e, n_q) [m3]
    Raises  Refusal where an element is folded"""
    nodes, points = connectivity(mesh), coordinates(mesh)
    element = mesh.elem()
    X, w = skfem.quadrature.get_quadrature(element, order)
    values, slopes = zip(*(element.lbasis(X, a) for a in range(nodes.shape[1])), strict=True)
    N = np.stack(np.broadcast_arrays(*values)).T
    dN = np.stack([np.stack(np.broadcast_arrays(*s)) for s in slopes]).transpose(2, 1, 0)  # n_q, 3 local, n_a
    numbers = np.arange(len(nodes)) if only is None else only
    for start in range(0, len(numbers), size):
        elements = numbers[start : start + size]
        J = dN @ points[nodes[elements]][:, None]
        det = np.linalg.det(J)
        folded = (np.sign(det) != np.sign(det[:, :1])).any(axis=1) | (det[:, 0] == 0)
        if folded.any():
            where = points[nodes[elements[folded.argmax()]]].mean(axis=0)
            raise Refusal(f"the mesh has a folded element near ({where[0]:.4g}, {where[1]:.4g}, {where[2]:.4g}) m")
        yield elements, N, dN, J, np.abs(det) * w


def scatter(nodes: np.ndarray, n_node: int, blocks: np.ndarray) -> csr_matrix:
    """Sum element matrices into a sparse matrix over node * k + component.

    nodes : (n_element, n_a); blocks : (n_element, n_a, n_a, k, k) symmetric element matrices, k components per node
    Returns (n_node * k, n_node * k)"""
    k = blocks.shape[-1]
    key = (nodes[:, :, None].astype(np.int64) * n_node + nodes[:, None, :]).ravel()
    pattern, place = np.unique(key, return_inverse=True)
    flat = blocks.reshape(len(key), k * k)
    data = np.stack([np.bincount(place, flat[:, c], len(pattern)) for c in range(k * k)], axis=1)
    indptr = np.searchsorted(pattern, np.arange(n_node + 1, dtype=np.int64) * n_node)
    matrix = bsr_matrix((data.reshape(-1, k, k), pattern % n_node, indptr), shape=(n_node * k, n_node * k)).tocsr()
    matrix.sort_indices()
    return matrix
