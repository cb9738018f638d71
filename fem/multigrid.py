"""Solutions and modes of a stiffness that is never assembled, by two levels, where no factor fits the memory.

The coarse level is the stiffness of linear elements on the same corners, an eighth of the DOFs, and is factorised.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

import numpy as np
from scipy.sparse.linalg import LinearOperator, lobpcg

from tribodyn.refusal import SolverFailure

if TYPE_CHECKING:
    from tribodyn.fem.elementwise import Elementwise


class Multigrid:
    """Conjugate gradients, preconditioned in single precision by Chebyshev smoothing and linear elements.

    K : positive definite; coarse : stiffness of linear elements, see `Elementwise.linear` -> its factor
    iterations : of all solves so far, each for up to `at_once` right-hand sides
    Raises  what `coarse` does; RuntimeError, as `solve`, where it does not converge
    Source  smoother: Lottes 2023, doi 10.1002/nla.2518, Chebyshev polynomials of the fourth kind
    """

    residual = 1e-10  # beside the right-hand side
    most = 500  # iterations
    at_once = 8  # right-hand sides; memory only
    degree = 4  # of the polynomial
    of_modes = 1e-5  # residual beside omega^2 M phi; an eigenvalue has about its square
    more = 4  # modes that are iterated besides, so that the wanted ones converge soon

    def __init__(self, K: Elementwise, coarse: Callable[[Any], Any]) -> None:
        self.iterations = 0
        self._K, self._single, own = K, K.astype(np.float32), np.float32
        by, stiffness = K.linear()
        self._coarse, self._by = coarse(stiffness), by.astype(own)
        self.name = f"conjugate gradients with linear elements by {self._coarse.name}"
        self._inverse = (1 / K.diagonal()).astype(own)[:, None]
        x = np.random.default_rng(0).standard_normal((K.shape[0], 1)).astype(own)
        for _ in range(20):  # power iteration
            x = self._inverse * (self._single @ (x / np.linalg.norm(x)))
        self._largest = own(1.1 * np.linalg.norm(x))

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution of the same shape as rhs, (n,) or (n, k)."""
        columns = np.asarray(rhs, float).reshape(len(rhs), -1)
        found = np.empty_like(columns)
        for start in range(0, columns.shape[1], self.at_once):
            own = slice(start, start + self.at_once)
            found[:, own] = self._some(columns[:, own])
        return found.reshape(np.shape(rhs))

    def lowest(self, M: Elementwise, n: int) -> tuple[np.ndarray, np.ndarray]:
        """The n lowest eigenvalues (n,) of K phi = lambda M phi, and phi (N, n), by preconditioned conjugate gradients.

        Source  Knyazev 2001, doi 10.1137/S1064827500366124
        """

        def about(r: np.ndarray) -> np.ndarray:
            r = r.reshape(len(r), -1)
            return self._cycle(r, np.linalg.norm(r, axis=0))

        near = LinearOperator(M.shape, matvec=about, matmat=about, dtype=float)
        found = about(np.random.default_rng(0).standard_normal((M.shape[0], n + self.more)))
        for _ in range(self.most // 10):
            with catch_warnings():
                simplefilter("ignore", UserWarning)  # that it is not below its tolerance, an absolute one
                values, found = lobpcg(self._K, found, M, near, largest=False, maxiter=8, tol=1e-300)
            pushed = (M @ found[:, :n]) * values[:n]
            missed = np.linalg.norm(self._K @ found[:, :n] - pushed, axis=0)
            if (missed <= self.of_modes * np.linalg.norm(pushed, axis=0)).all():
                return values[:n], found[:, :n]
        raise SolverFailure(f"{n} modes do not converge: take a direct solver")

    def _some(self, rhs: np.ndarray) -> np.ndarray:
        size = np.linalg.norm(rhs, axis=0)
        r, x = rhs / np.where(size > 0, size, 1.0), np.zeros(rhs.shape)
        along, before = np.zeros(rhs.shape), np.ones(rhs.shape[1])
        for _ in range(self.most):
            left = np.linalg.norm(r, axis=0)
            if left.max() <= self.residual:
                return np.asarray(x * size)
            z = self._cycle(r, left)
            now = np.einsum("ij,ij->j", r, z)
            along *= now / before
            along += z
            pushed = self._K @ along
            step = now / np.maximum(np.einsum("ij,ij->j", along, pushed), np.finfo(float).tiny)
            x += step * along
            pushed *= step
            r -= pushed
            before = np.maximum(now, np.finfo(float).tiny)
            self.iterations += 1
        raise SolverFailure(f"conjugate gradients do not converge in {self.most} iterations: take a direct solver")

    def _cycle(self, r: np.ndarray, size: np.ndarray) -> np.ndarray:
        """About K^-1 r, in single precision; size : (k,) of the columns of r."""
        r = (r / np.maximum(size, np.finfo(float).tiny)).astype(np.float32)
        x, last = self._smoothed(r)
        r -= self._single @ last
        more = self._by @ self._coarse.solve((self._by.T @ r).astype(float)).astype(np.float32)
        x += more
        r -= self._single @ more
        return np.asarray((x + self._smoothed(r)[0]) * size)

    def _smoothed(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A polynomial of K times r, and its last step; r becomes the residual before that step."""
        step = self._inverse * r * np.float32(4 / 3 / self._largest)
        x = step.copy()
        for i in range(2, self.degree + 1):
            r -= self._single @ step
            step *= np.float32((2 * i - 3) / (2 * i + 1))
            step += self._inverse * r * np.float32((8 * i - 4) / (2 * i + 1) / self._largest)
            x += step
        return x, step
