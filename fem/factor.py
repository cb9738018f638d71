"""Sparse factorisation of a symmetric matrix: PARDISO where it is installed, else SuperLU after METIS."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, triu
from scipy.sparse.linalg import splu

# Smallest over largest eigenvalue that still counts as regular: a clamped thin part reaches 1e-12, rounding 1e-16.
SINGULAR = 1e-14


class Factor(Protocol):
    """name : of the solver; solve : (n,) or (n, k) right-hand sides -> solution of the same shape."""

    name: str

    def solve(self, rhs: np.ndarray) -> np.ndarray: ...


def factorise(K: Any, definite: bool = True, solver: str | None = None) -> Factor:
    """Factorise a sparse symmetric real matrix once, for many right-hand sides.

    K : (n, n) scipy.sparse; definite : K is positive definite (False for a shifted, indefinite matrix)
    solver : "pardiso" or "superlu", the best available unless told
    Raises  ValueError where K is singular, as when a body can still move rigidly
    """
    K = csr_matrix(K)
    if solver is None:
        solver = "pardiso" if pardiso_available() else "superlu"
    try:
        factor: Factor = Pardiso(K, definite) if solver == "pardiso" else SuperLU(K)
        regular = reciprocal_condition(K, factor) > SINGULAR
    except (RuntimeError, ArithmeticError):
        regular = False
    if not regular:
        raise ValueError(
            "the stiffness matrix is singular: some body can move rigidly; clamp it, or give it contact or load nodes "
            "that stay as masters"
        )
    return factor


def reciprocal_condition(K: csr_matrix, factor: Factor) -> float:
    """Estimate |smallest| / |largest| eigenvalue by three inverse iterations from a fixed start; 0 where it fails."""
    x = np.random.default_rng(0).standard_normal(K.shape[0])
    smallest = np.inf
    for _ in range(3):
        x /= np.linalg.norm(x)
        x = factor.solve(x)
        if not np.isfinite(x).all() or not x.any():
            return 0.0
        smallest = 1 / float(np.linalg.norm(x))
    return float(smallest / abs(K).sum(axis=1).max())


def pardiso_available() -> bool:
    """Whether pypardiso and its MKL library load."""
    try:
        import pypardiso  # noqa: F401
    except (ImportError, OSError):
        return False
    return True


class Pardiso:
    """MKL PARDISO on the upper triangle, mtype 2 (positive definite) or -2 (indefinite)."""

    def __init__(self, K: csr_matrix, definite: bool = True) -> None:
        from pypardiso import PyPardisoSolver
        from pypardiso.pardiso_wrapper import PyPardisoError

        self.name = "MKL PARDISO, " + ("Cholesky" if definite else "LDL^T")
        self._upper = triu(K, format="csr")
        self._upper.sort_indices()
        self._solver = PyPardisoSolver(mtype=2 if definite else -2)
        try:
            self._solver.factorize(self._upper)
        except (PyPardisoError, ValueError) as error:
            raise ArithmeticError(str(error)) from error

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution of the same shape as rhs, (n,) or (n, k)."""
        return self._solver.solve(self._upper, np.asarray(rhs, dtype=float))

    def __del__(self) -> None:
        if hasattr(self, "_solver"):
            self._solver.free_memory(everything=True)


class SuperLU:
    """SuperLU in symmetric mode after a METIS nested dissection."""

    def __init__(self, K: csr_matrix) -> None:
        import pymetis

        self.name = "SuperLU after METIS"
        graph = K - csr_matrix((K.diagonal(), (np.arange(K.shape[0]),) * 2), shape=K.shape)
        graph.eliminate_zeros()
        order, _ = pymetis.nested_dissection(xadj=graph.indptr, adjncy=graph.indices)
        self._order = np.asarray(order)
        permuted = csc_matrix(K[self._order][:, self._order])
        self._lu = splu(permuted, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution of the same shape as rhs, (n,) or (n, k)."""
        solution = np.empty(np.shape(rhs))
        solution[self._order] = self._lu.solve(np.asarray(rhs, dtype=float)[self._order])
        return solution
