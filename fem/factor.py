"""Sparse factorisation of a symmetric matrix: PARDISO where it is installed, else SuperLU after METIS; or multigrid."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, triu
from scipy.sparse.linalg import splu

from tribodyn.fem.multigrid import Multigrid

# Relative residual of the softest direction that still counts as regular. Measured: a plate 2000 times longer than
# thick reaches 0.05, a body that can move rigidly 6 to 1000.
SINGULAR = 0.5
NO_MEMORY = -2  # error code of PARDISO


class SingularStiffness(ValueError):
    """A body can move rigidly, or the matrix is singular to working precision."""


class Factor(Protocol):
    """name : of the solver; solve : (n,) or (n, k) right-hand sides -> solution of the same shape."""

    name: str

    def solve(self, rhs: np.ndarray) -> np.ndarray: ...


def factorise(K: Any, definite: bool = True, solver: str | None = None, shapes: np.ndarray | None = None) -> Factor:
    """Factorise a sparse symmetric real matrix once, for many right-hand sides.

    K : (n, n) scipy.sparse; definite : K is positive definite (False for a shifted, indefinite matrix)
    solver : "pardiso" or "superlu", the best available by default; "multigrid" has no factor and iterates
    shapes : (n, k) motions that K hardly resists, for multigrid
    Raises  SingularStiffness where K is singular, as when a body can still move rigidly; MemoryError
    """
    K = csr_matrix(K)
    if solver is None:
        solver = "pardiso" if pardiso_available() else "superlu"
    elif solver not in ("pardiso", "superlu", "multigrid"):
        raise ValueError(f"no solver '{solver}': there are pardiso, superlu, multigrid")
    try:
        factor: Factor
        if solver == "multigrid":
            factor = Multigrid(K, shapes)
        else:
            factor = Pardiso(K, definite) if solver == "pardiso" else SuperLU(K, definite)
        regular = softest_residual(K, factor.solve) < SINGULAR
    except (RuntimeError, ArithmeticError):
        regular = False
    if not regular:
        raise SingularStiffness(
            "the stiffness matrix is singular to working precision: some body can move rigidly, or is too thin; "
            "clamp it, or keep some of its nodes as masters"
        )
    return factor


def softest_residual(K: Any, solve: Callable[[np.ndarray], np.ndarray]) -> float:
    """|K x - b| / |b| for b along the softest direction, found by two inverse iterations from a fixed start.

    A rigid-body motion cannot be balanced by K, whatever the factorisation made of its pivots.
    """
    x = np.random.default_rng(0).standard_normal(K.shape[0])
    residual = np.inf
    for _ in range(2):
        b = x / np.linalg.norm(x)
        x = solve(b)
        residual = float(np.linalg.norm(K @ x - b))
        if not np.isfinite(residual) or not x.any():
            return np.inf
    return residual


def pardiso_available() -> bool:
    """Whether pypardiso and its MKL library load.

    MKL chooses its kernels by where arrays happen to lie in memory, and rounds by that; the variable
    set here, before it loads, forbids it.
    """
    os.environ.setdefault("MKL_CBWR", "AUTO")
    # pypardiso searches the whole environment, a second of processor at each solver, if it is not told where MKL lies
    for path in sorted(Path(sys.prefix).glob("lib/libmkl_rt*")) + sorted(Path(sys.prefix).glob("Library/bin/mkl_rt*")):
        os.environ.setdefault("PYPARDISO_MKL_RT", str(path))
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
        self._solver = PyPardisoSolver(mtype=2 if definite else -2, size_limit_storage=0)  # keeps no copy of the matrix
        # METIS, and no iterative refinement unless pivots were perturbed: MKL's defaults refine twice, 5 times slower
        for place, value in {1: 1, 2: 2, 8: 0, 10: 8}.items():
            self._solver.set_iparm(place, value)
        try:
            self._solver.factorize(self._upper)
        except (PyPardisoError, ValueError) as error:
            if getattr(error, "value", None) == NO_MEMORY:
                raise MemoryError(f"the memory is not enough for the factors of {K.shape[0]} equations") from error
            raise ArithmeticError(str(error)) from error

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution of the same shape as rhs, (n,) or (n, k)."""
        # pypardiso's own `solve` first compares the matrix with the factorised one, as long as a back substitution
        self._solver.set_phase(33)
        found: np.ndarray = self._solver._call_pardiso(self._upper, np.asfortranarray(rhs, dtype=float))
        return found

    def __del__(self) -> None:
        if hasattr(self, "_solver") and not sys.is_finalizing():  # with the process its memory goes anyway
            self._solver.free_memory(everything=True)


class SuperLU:
    """SuperLU in symmetric mode after a METIS nested dissection."""

    def __init__(self, K: csr_matrix, definite: bool = False) -> None:
        import pymetis

        self.name = "SuperLU after METIS"
        graph = K - csr_matrix((K.diagonal(), (np.arange(K.shape[0]),) * 2), shape=K.shape)
        graph.eliminate_zeros()
        order, _ = pymetis.nested_dissection(pymetis.CSRAdjacency(graph.indptr, graph.indices))
        self._order = np.asarray(order)
        permuted = csc_matrix(K[self._order][:, self._order])
        self._lu = splu(permuted, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        if definite and not (self._lu.U.diagonal() > 0).all():
            raise ArithmeticError("a pivot is not positive")

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution of the same shape as rhs, (n,) or (n, k)."""
        solution = np.empty(np.shape(rhs))
        solution[self._order] = self._lu.solve(np.asarray(rhs, dtype=float)[self._order])
        return solution
