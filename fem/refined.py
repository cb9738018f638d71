"""Solutions in double precision from a factor in single precision, which takes half the memory.

The factor of the scaled matrix is the preconditioner of conjugate gradients, for many right-hand sides at once. Plain
refinement would need a condition number well below 1e7, which bending of a fine mesh exceeds; conjugate gradients
take a few iterations more for each of the few soft motions that the factor has wrong. Where rounding makes the
matrix indefinite, that of a slightly stiffer one is factorised.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, diags_array


class Refined:
    """Conjugate gradients preconditioned by a factor that is nearly one of the matrix.

    K : (n, n) symmetric positive definite, double precision
    nearly : makes the factor of a matrix with a diagonal near one; what it solves is of single precision
    iterations : of all calls of `solve` so far
    Raises  ArithmeticError where the factor cannot be made; RuntimeError, as `solve`, where it is too far off
    Source  preconditioned conjugate gradients: Saad 2003, algorithm 9.1; scaling by the diagonal: Higham 2021,
        doi 10.1137/19M1298263, section 2
    """

    residual = 1e-12  # beside the right-hand side, both scaled
    most = 300  # iterations
    at_once = 16  # right-hand sides: six arrays of their size are held
    stiffer = (0.0, 1e-7, 1e-6, 1e-5)  # added to the scaled diagonal; the rounding of single precision is 6e-8
    name = "MKL PARDISO in single precision, with conjugate gradients"
    tolerance = 1e-10  # that eigenvalues from its solutions can have

    def __init__(self, K: csr_matrix, nearly: Callable[[csr_matrix], Any]) -> None:
        diagonal = K.diagonal()
        if not (diagonal > 0).all():
            raise ArithmeticError("a number on the diagonal is not positive")
        self._K, self._scale, self.iterations = K, 1 / np.sqrt(diagonal), 0
        scaling = diags_array(self._scale)
        scaled = csr_matrix(scaling @ K @ scaling)
        for stiffer in self.stiffer:
            scaled.setdiag(1.0 + stiffer)
            try:
                self._factor = nearly(scaled)
            except ArithmeticError:
                if stiffer == self.stiffer[-1]:
                    raise
            else:
                break

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution of the same shape as rhs, (n,) or (n, k)."""
        columns = np.asarray(rhs, float).reshape(len(rhs), -1)
        found = np.empty(columns.shape)
        for start in range(0, columns.shape[1], self.at_once):
            found[:, start : start + self.at_once] = self._solve(columns[:, start : start + self.at_once])
        return found.reshape(np.shape(rhs))

    def _solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution (n, k) of some right-hand sides."""
        scale = self._scale[:, None]
        r = scale * rhs
        wanted = self.residual * np.linalg.norm(r, axis=0)
        x = np.zeros_like(r)
        z = self._nearly(r)
        p, rz = z.copy(), np.sum(r * z, axis=0)
        for _ in range(self.most):
            if (np.linalg.norm(r, axis=0) <= wanted).all():
                return np.asarray(scale * x)
            self.iterations += 1
            q = scale * (self._K @ (scale * p))
            step = _over(rz, np.sum(p * q, axis=0))
            x += step * p
            r -= step * q
            z = self._nearly(r)
            after = np.sum(r * z, axis=0)
            p = z + _over(after, rz) * p
            rz = after
        raise RuntimeError(f"the factor in single precision is too far off: no solution in {self.most} iterations")

    def _nearly(self, r: np.ndarray) -> np.ndarray:
        """By the factor, each column at a size that single precision can hold."""
        size = np.linalg.norm(r, axis=0)
        return np.asarray(self._factor.solve(r * _over(np.ones_like(size), size)) * size)


def _over(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a / b, and 0 where b is: of a right-hand side without any force."""
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0)
