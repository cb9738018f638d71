"""Mass and stiffness that are never assembled, for meshes whose matrices do not fit the memory.

A product gathers the displacement of some elements, takes its gradients at their quadrature points by one dense
product, turns these into stresses, and goes back the same way.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numba import njit
from scipy.sparse import csr_matrix, identity, kron
from scipy.sparse.linalg import LinearOperator
from skfem import ElementHex1, ElementTetP1

from tribodyn.fem.assembly import materials_of
from tribodyn.fem.elasticity import at_elements, densities, of_elements, tensor_blocks
from tribodyn.fem.elements import connectivity, mapped, scatter
from tribodyn.refusal import Refusal

AT_ONCE = 32  # elements; memory and speed only
VOIGT = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])  # place of a component of strain or stress


@dataclass(frozen=True)
class Elements:
    """Elements of one body and their mass, for products.

    nodes : (n_a, n_e) of the whole, first those at corners; basis : (n_q, n_a) shape functions
    weight : (n_q, n_e) |J| w [m3], for a mass times the density
    """

    nodes: np.ndarray
    weight: np.ndarray
    basis: np.ndarray

    def astype(self, kind: Any) -> Self:
        """The same in another precision."""
        return replace(self, **{name: of.astype(kind) for name, of in vars(self).items() if name != "nodes"})

    def batches(self) -> Iterator[slice]:
        """Some elements at a time."""
        return (slice(at, at + AT_ONCE) for at in range(0, self.nodes.shape[1], AT_ONCE))

    def add_product(self, x: np.ndarray, total: np.ndarray) -> None:
        """Add forces under displacements x to a total, both (n_node, 3, k)."""
        for own in self.batches():
            moved = np.ascontiguousarray(x[self.nodes[:, own]].transpose(0, 2, 3, 1))
            at_points = self.basis @ moved.reshape(len(moved), -1)
            self.respond(at_points.reshape(len(self.weight), -1, 3, *moved.shape[2:]), own)
            _scatter((self.basis.T @ at_points).reshape(moved.shape), self.nodes, own.start, total)

    def respond(self, at_points: np.ndarray, own: slice) -> None:
        """From displacements at points (n_q, 1, 3, k, n_e) of some elements to forces, in place."""
        at_points *= self.weight[:, None, None, None, own]

    def sizes(self, own: slice) -> np.ndarray:
        """Diagonal (n_a, n_e, 3) of the matrices of some elements."""
        return np.repeat((self.basis.T**2 @ self.weight[:, own])[..., None], 3, axis=2)


@dataclass(frozen=True)
class Elastic(Elements):
    """Elements of one body and their stiffness.

    basis : (n_q * 3, n_a) gradients of shape functions in the reference element
    inverse : (n_q, 3, 3, n_e) d X_i / d x_j at [j, i] [1/m]; law : (6, 6, n_e) [Pa], in Voigt's order
    linear : (n_a, n_corner) linear functions of the corners, at the nodes
    """

    inverse: np.ndarray
    law: np.ndarray
    linear: np.ndarray

    def respond(self, at_points: np.ndarray, own: slice) -> None:
        """From reference gradients at points (n_q, 3, 3, k, n_e) of some elements to weighted stresses, in place."""
        _stresses(at_points, self.inverse, self.weight, self.law, own.start)

    def gradients(self, own: slice) -> np.ndarray:
        """(n_e, n_q, 3, n_a) of the shape functions of some elements [1/m]."""
        slopes = self.basis.reshape(len(self.weight), 3, -1)
        return np.asarray(np.einsum("qjie,qia->eqja", self.inverse[..., own], slopes, optimize=True))

    def tensor(self, own: slice) -> np.ndarray:
        """Elasticity tensors (n_e, 3, 3, 3, 3) of some elements [Pa]."""
        return self.law[..., own].transpose(2, 0, 1)[:, VOIGT[:, :, None, None], VOIGT]

    def sizes(self, own: slice) -> np.ndarray:
        """Diagonal (n_a, n_e, 3) of the matrices of some elements."""
        g, C = self.gradients(own), self.tensor(own)
        return np.asarray(np.einsum("eijil,eqja,eqla,qe->aei", C, g, g, self.weight[:, own], optimize=True))

    def of_corners(self, n_node: int) -> csr_matrix:
        """Stiffness (3 n_node, 3 n_node) of linear elements in place of these."""
        corners = self.nodes[: self.linear.shape[1]].T
        blocks = [
            tensor_blocks(self.gradients(own) @ self.linear, self.weight[:, own].T, self.tensor(own))
            for own in self.batches()
        ]
        return scatter(corners, n_node, np.concatenate(blocks))


# the kernels take whole arrays and the first element of a batch: slices have other types, compiled for seconds each
@njit(cache=True)
def _scatter(force: np.ndarray, nodes: np.ndarray, start: int, total: np.ndarray) -> None:
    for a in range(nodes.shape[0]):
        for e in range(force.shape[3]):
            for i in range(3):
                for k in range(total.shape[2]):
                    total[nodes[a, start + e], i, k] += force[a, i, k, e]


@njit(cache=True, fastmath={"contract"})
def _stresses(slopes: np.ndarray, inverse: np.ndarray, weight: np.ndarray, law: np.ndarray, start: int) -> None:
    """In place of reference gradients (n_q, 3, 3, k, n_e) of displacements: weighted stresses, pulled back.

    Buffers of constant shape let the compiler work on several elements at once
    """
    kind, n = slopes.dtype, slopes.shape[4]
    s, h, J = np.zeros((3, 3, AT_ONCE), kind), np.zeros((3, 3, AT_ONCE), kind), np.zeros((3, 3, AT_ONCE), kind)
    C, t, w = np.zeros((6, 6, AT_ONCE), kind), np.zeros((6, AT_ONCE), kind), np.zeros(AT_ONCE, kind)
    for a in range(6):
        for b in range(6):
            for e in range(n):
                C[a, b, e] = law[a, b, start + e]
    for q in range(slopes.shape[0]):
        for e in range(n):
            w[e] = weight[q, start + e]
            for i in range(3):
                for j in range(3):
                    J[i, j, e] = inverse[q, i, j, start + e]
        for k in range(slopes.shape[3]):
            for i in range(3):
                for j in range(3):
                    for e in range(n):
                        s[i, j, e] = slopes[q, i, j, k, e]
            for i in range(3):
                for j in range(3):
                    for e in range(AT_ONCE):
                        h[i, j, e] = J[i, 0, e] * s[0, j, e] + J[i, 1, e] * s[1, j, e] + J[i, 2, e] * s[2, j, e]
            for a in range(6):
                for e in range(AT_ONCE):
                    shear = C[a, 3, e] * (h[1, 2, e] + h[2, 1, e]) + C[a, 4, e] * (h[0, 2, e] + h[2, 0, e])
                    shear += C[a, 5, e] * (h[0, 1, e] + h[1, 0, e])
                    long = C[a, 0, e] * h[0, 0, e] + C[a, 1, e] * h[1, 1, e] + C[a, 2, e] * h[2, 2, e]
                    t[a, e] = w[e] * (long + shear)
            for i in range(3):
                for j in range(3):
                    x, y, z = VOIGT[j]
                    for e in range(AT_ONCE):
                        s[i, j, e] = J[0, i, e] * t[x, e] + J[1, i, e] * t[y, e] + J[2, i, e] * t[z, e]
                    for e in range(n):
                        slopes[q, i, j, k, e] = s[i, j, e]


class Elementwise(LinearOperator):
    """A symmetric matrix over free DOFs of a mesh: the sum over its elements, and a sparse rest.

    elements : of all bodies; n_node : of the mesh; free : (n,) DOFs, node * 3 + component; rest : (n, n) sparse
    """

    def __init__(self, elements: Sequence[Any], n_node: int, free: np.ndarray, rest: csr_matrix) -> None:
        super().__init__(rest.dtype, (len(free),) * 2)
        self.elements, self.n_node, self.free, self.rest = tuple(elements), n_node, free, rest

    def restricted(self, free: np.ndarray) -> Elementwise:
        """The matrix over some of its DOFs."""
        return Elementwise(self.elements, self.n_node, self.free[free], self.rest[free][:, free])

    def astype(self, kind: Any) -> Elementwise:
        """The matrix in another precision."""
        return Elementwise([one.astype(kind) for one in self.elements], self.n_node, self.free, self.rest.astype(kind))

    def __add__(self, more: csr_matrix) -> Elementwise:
        """The matrix and a sparse one (n, n)."""
        return Elementwise(self.elements, self.n_node, self.free, csr_matrix(self.rest + more))

    def diagonal(self) -> np.ndarray:
        """(n,)."""
        found = np.zeros((self.n_node, 3))
        for one in self.elements:
            for own in one.batches():
                np.add.at(found, one.nodes[:, own], one.sizes(own))
        return found.ravel()[self.free] + self.rest.diagonal()

    def linear(self) -> tuple[csr_matrix, csr_matrix]:
        """What linear elements on the corners have: displacements (n, m) by those of corners, and stiffness (m, m)."""
        corner, entries = np.ones(self.n_node, bool), []
        for one in self.elements:
            found, first = np.unique(one.nodes, return_index=True)
            place, element = np.divmod(first, one.nodes.shape[1])
            corners = one.nodes[: one.linear.shape[1], element].T
            corner[found] = place < corners.shape[1]
            entries.append((one.linear[place].ravel(), np.repeat(found, corners.shape[1]), corners.ravel()))
        alone = np.setdiff1d(np.arange(self.n_node), np.concatenate([rows for _, rows, _ in entries]))
        entries.append((np.ones(len(alone)), alone, alone))
        values, rows, columns = (np.concatenate(of) for of in zip(*entries, strict=True))
        by = csr_matrix((values, (rows, columns)), shape=(self.n_node,) * 2)
        by.eliminate_zeros()
        own = self.free[corner[self.free // 3]]
        by = kron(by, identity(3), format="csr")[self.free][:, own]
        stiffness = sum(one.of_corners(self.n_node) for one in self.elements)[own][:, own]
        return by, csr_matrix(stiffness + by.T @ self.rest @ by)

    def _matmat(self, x: np.ndarray) -> np.ndarray:
        whole = np.zeros((self.n_node * 3, x.shape[1]), self.dtype)
        whole[self.free] = x
        total = np.zeros((self.n_node, 3, x.shape[1]), self.dtype)
        for one in self.elements:
            one.add_product(whole.reshape(total.shape), total)
        return total.reshape(whole.shape)[self.free] + self.rest @ x

    def _matvec(self, x: np.ndarray) -> np.ndarray:
        return self._matmat(x.reshape(-1, 1)).ravel()


def matrices(mesh: Any, material: Any) -> tuple[Elementwise, Elementwise]:
    """Mass and stiffness as `elasticity.assemble` has them.

    Raises  ValueError where elements are linear, or as `assemble` does
    """
    mass, stiffness = [], []
    first, second = np.array([0, 1, 2, 1, 0, 0]), np.array([0, 1, 2, 2, 2, 1])  # as VOIGT counts
    for piece, own in materials_of(mesh, material):
        one, nodes = piece.mesh, connectivity(piece.mesh)
        if nodes.shape[1] == 8 or any(getattr(of, "linear_reduced", False) for of in of_elements(one, own)[0]):
            raise Refusal('reduction.solver: "multigrid" needs elements of second order, and these are linear ones')
        corner = ElementHex1() if nodes.shape[1] == 27 else ElementTetP1()
        places = np.asarray(one.elem().doflocs).T
        linear = np.stack([corner.lbasis(places, i)[0] for i in range(len(corner.doflocs))], axis=1)
        _, (N, *_), (slopes, *_), J, weight = zip(*mapped(one), strict=True)
        law = at_elements(one, own, "tensor")[:, first, second][:, :, first, second]
        nodes, law, inverse, weight = (
            np.ascontiguousarray(np.moveaxis(of, 0, -1))
            for of in (piece.node + nodes, law, np.linalg.inv(np.concatenate(J)), np.concatenate(weight))
        )
        mass.append(Elements(nodes, weight * densities(one, own), N))
        stiffness.append(Elastic(nodes, weight, slopes.reshape(-1, len(nodes)), inverse, law, linear))
    n_node = mesh.doflocs.shape[1]
    free, nothing = np.arange(3 * n_node), csr_matrix((3 * n_node,) * 2)
    return Elementwise(mass, n_node, free, nothing), Elementwise(stiffness, n_node, free, nothing)
