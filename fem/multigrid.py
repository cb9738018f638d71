"""Solutions of a stiffness matrix by conjugate gradients with algebraic multigrid, where no factor fits the memory.

The multigrid is pyamg's: smoothed aggregation that knows the rigid motions. Every right-hand side is an iteration of
its own, so that a factor, where it fits, is far faster.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import cg

from tribodyn.extras import package


class Multigrid:
    """Conjugate gradients preconditioned by smoothed aggregation.

    K : (n, n) positive definite; shapes : (n, k) motions that it hardly resists, the rigid ones of the free structure
    iterations : of all solves so far
    Raises  ValueError where pyamg is missing; RuntimeError, as `solve`, where it does not converge
    Source  Vanek, Mandel, Brezina 1996, doi 10.1007/BF02238511
    """

    residual = 1e-11  # beside the right-hand side
    most = 2000  # iterations
    name = "conjugate gradients with algebraic multigrid"
    tolerance = 1e-9  # that eigenvalues from its solutions can have

    def __init__(self, K: csr_matrix, shapes: np.ndarray | None = None) -> None:
        pyamg = package("pyamg")
        self._K = K
        self.iterations = 0
        levels = pyamg.smoothed_aggregation_solver(
            K, B=shapes, presmoother=("gauss_seidel", {"sweep": "symmetric"}),
            postsmoother=("gauss_seidel", {"sweep": "symmetric"}), max_coarse=500,
        )  # fmt: skip
        self._preconditioner = levels.aspreconditioner()

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution of the same shape as rhs, (n,) or (n, k)."""
        columns = np.asarray(rhs, float).reshape(len(rhs), -1)
        found = np.stack([self._one(column) for column in columns.T], axis=1) if columns.shape[1] else columns.copy()
        return found.reshape(np.shape(rhs))

    def _one(self, rhs: np.ndarray) -> np.ndarray:
        def counted(_: Any) -> None:
            self.iterations += 1

        found, trouble = cg(
            self._K, rhs, rtol=self.residual, maxiter=self.most, M=self._preconditioner, callback=counted
        )
        if trouble:
            raise RuntimeError(f"conjugate gradients do not converge in {self.most} iterations: take a direct solver")
        return np.asarray(found)


def rigid_motions(points: np.ndarray) -> np.ndarray:
    """(3 n, 6) rigid motions of nodes (n, 3), of order 1; DOF 3 * node + component."""
    x = points - points.mean(axis=0)
    x = x / (np.abs(x).max() or 1.0)
    found = np.zeros((len(points), 3, 6))
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        found[:, axis, axis] = 1.0
        found[:, a, 3 + axis], found[:, b, 3 + axis] = -x[:, b], x[:, a]
    return found.reshape(-1, 6)
