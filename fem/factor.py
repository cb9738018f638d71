"""Solutions of a symmetric sparse matrix by a factor, of PARDISO, of SuperLU after METIS, or of MUMPS."""

import ctypes
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, triu
from scipy.sparse.linalg import splu

from tribodyn.fem.mumps import Mumps
from tribodyn.refusal import Refusal

# Relative residual of the softest direction that still counts as regular. Measured: a plate 2000 times longer than
# thick reaches 0.05, a body that can move rigidly 6 to 1000.
SINGULAR = 0.5
SOLVERS = ("pardiso", "superlu", "mumps")


class SingularStiffness(Refusal):
    """A body can move rigidly, or the matrix is singular to working precision."""


class Factor(Protocol):
    """name : of the solver; solve : (n,) or (n, k) right-hand sides -> solution of the same shape."""

    name: str

    def solve(self, rhs: np.ndarray) -> np.ndarray: ...


def factorise(
    K: Any, definite: bool = True, solver: str | None = None, selected_rows: np.ndarray | None = None
) -> Factor:
    """Factorise a sparse symmetric real matrix once, for many right-hand sides.

    K : (n, n) scipy.sparse; definite : K is positive definite (False for a shifted, indefinite matrix).
    solver : "pardiso" or "superlu", the best available by default; "mumps" in MPI processes of another Python
    selected_rows : those that `solve_selected` is to be fast for
    Raises  SingularStiffness where K is singular, as when a body can still move rigidly; MemoryError"""
    K = csr_matrix(K)
    if solver is None:
        solver = "pardiso" if pardiso_available() else "superlu"
    elif solver not in SOLVERS:
        raise Refusal(f"no solver '{solver}': there are {', '.join(SOLVERS)}")
    try:
        factor: Factor
        if solver == "mumps":
            factor = Mumps(K, definite)
        else:
            factor = Pardiso(K, definite, selected_rows=selected_rows) if solver == "pardiso" else SuperLU(K, definite)
        regular = softest_residual(K, factor.solve) < SINGULAR
    except (RuntimeError, ArithmeticError):
        regular = False
    if not regular:
        raise SingularStiffness(
            "the stiffness matrix is singular to working precision: some body can move rigidly, or is too thin; "
            "clamp it, or keep some of its nodes as masters"
        )
    return factor


def solve_selected(factor: Factor, rhs: np.ndarray) -> np.ndarray:
    """The solution in the `selected_rows` of the factor, where rhs (n, k) vanishes in all others.

    The other rows hold no solution"""
    if not isinstance(factor, Pardiso):
        return factor.solve(rhs)
    padding = -rhs.shape[1] % 4 if rhs.shape[1] > 4 else 0  # PARDISO takes 15 % longer for seven columns than for eight
    return factor.solve(np.pad(rhs, ((0, 0), (0, padding))), selected_only=True)[:, : rhs.shape[1]]


def eigenvalues_below(K: Any, M: Any, value: float) -> int:
    """How many eigenvalues of K phi = lambda M phi lie below a value, by one factorisation.

    By Sylvester's law of inertia; K, M : (n, n) scipy.sparse symmetric, M positive definite"""
    shifted = csr_matrix(K - value * M)
    return (Pardiso(shifted, definite=False) if pardiso_available() else SuperLU(shifted)).negative


def softest_residual(K: Any, solve: Callable[[np.ndarray], np.ndarray]) -> float:
    """|K x - b| / |b| for b along the softest direction, found by two inverse iterations from a fixed start.

    A rigid-body motion cannot be balanced by K, whatever the factorisation made of its pivots."""
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
    set here, before it loads, forbids it."""
    os.environ.setdefault("MKL_CBWR", "AUTO")
    # pypardiso searches the whole environment, a second of processor at each solver, if the place of MKL is not given
    for path in sorted(Path(sys.prefix).glob("lib/libmkl_rt*")) + sorted(Path(sys.prefix).glob("Library/bin/mkl_rt*")):
        os.environ.setdefault("PYPARDISO_MKL_RT", str(path))
    try:
        import pypardiso  # noqa: F401
    except (ImportError, OSError):
        return False
    return True


class Pardiso:
    """MKL PARDISO on the upper triangle, mtype 2 (positive definite) or -2 (indefinite).

    selected_rows : eliminated last, so that a solution in them from forces on them visits no others"""

    NO_MEMORY = -2  # error code
    ANALYSE, FACTORISE, SOLVE = 11, 22, 33  # phases
    PERMUTED, SIZE, PARTIAL = 5, 17, 31  # places of switches, and of the memory of factors [kB]
    MOST_SELECTED = (
        0.5  # share of the selected rows, whose triangle is dense, in that: 0.3 saves two thirds, 0.8 takes ten times
    )

    def __init__(self, K: csr_matrix, definite: bool = True, selected_rows: np.ndarray | None = None) -> None:
        from pypardiso import PyPardisoSolver

        self.name = "MKL PARDISO, " + ("Cholesky" if definite else "LDL^T")
        upper = triu(K, format="csr")
        upper.sort_indices()
        if not np.diff(upper.indptr).all():
            raise ArithmeticError("a row is empty")  # PARDISO would crash
        # as Fortran counts; pypardiso's own call makes these arrays anew at each solution
        rows, columns = (1 + array.astype(np.int32) for array in (upper.indptr, upper.indices))
        self._matrix = upper.data.astype(float), rows, columns
        del upper
        self._solver = PyPardisoSolver(mtype=2 if definite else -2)
        # METIS, and no iterative refinement unless pivots were perturbed: MKL's defaults refine twice, 5 times slower
        for place, value in {1: 1, 2: 2, 8: 0, 10: 8}.items():
            self._solver.set_iparm(place, value)
        self._selects, nothing = selected_rows is not None, np.zeros(K.shape[0])
        if selected_rows is not None:
            self._solver.perm = np.zeros(K.shape[0], np.int32)
            self._solver.perm[selected_rows] = 1
            self._solver.set_iparm(self.PARTIAL, 1)
        self._call(self.ANALYSE, nothing)
        if selected_rows is not None and 4 * len(selected_rows) ** 2 > self.MOST_SELECTED * 1024 * int(
            self._solver.get_iparm(self.SIZE)
        ):
            self._selects = False
            self._solver.free_memory(everything=True)
            for place in (self.PERMUTED, self.PARTIAL):
                self._solver.set_iparm(place, 0)
            self._call(self.ANALYSE, nothing)
        self._call(self.FACTORISE, nothing)

    @property
    def negative(self) -> int:
        """How many eigenvalues of an indefinite K are negative: the signs of its pivots, by Sylvester's law."""
        return int(self._solver.get_iparm(23))

    def solve(self, rhs: np.ndarray, selected_only: bool = False) -> np.ndarray:
        """Solution of the same shape as rhs, (n,) or (n, k); of the selected rows alone where `selected_only`."""
        self._solver.set_iparm(self.PARTIAL, int(selected_only and self._selects))
        return np.ascontiguousarray(self._call(self.SOLVE, np.asfortranarray(rhs, dtype=float)))

    def _call(self, phase: int, rhs: np.ndarray) -> np.ndarray:
        """One call of PARDISO; rhs (n,) or (n, k) in Fortran's order. Raises MemoryError, ArithmeticError."""
        solution, error, solver = np.zeros_like(rhs), ctypes.c_int32(0), self._solver
        values, rows, columns = self._matrix

        def number(value: int) -> Any:
            return ctypes.byref(ctypes.c_int32(value))

        def integers(array: np.ndarray) -> Any:
            return array.ctypes.data_as(ctypes.POINTER(ctypes.c_int32))

        solver._mkl_pardiso(
            solver.pt.ctypes.data_as(ctypes.POINTER(solver._pt_type[0])), number(1), number(1), number(solver.mtype),
            number(phase), number(len(rows) - 1), values.ctypes.data_as(ctypes.c_void_p), integers(rows),
            integers(columns), integers(solver.perm), number(rhs.size // max(len(rows) - 1, 1)), integers(solver.iparm),
            number(0), rhs.ctypes.data_as(ctypes.c_void_p), solution.ctypes.data_as(ctypes.c_void_p),
            ctypes.byref(error),
        )  # fmt: skip
        if error.value == self.NO_MEMORY:
            raise MemoryError(f"the memory is not enough for the factors of {len(rows) - 1} equations")
        if error.value:
            raise ArithmeticError(f"PARDISO's error {error.value}")
        return solution

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

    @property
    def negative(self) -> int:
        """How many eigenvalues of K are negative: the signs of its pivots, by Sylvester's law."""
        return int((self._lu.U.diagonal() < 0).sum())

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution of the same shape as rhs, (n,) or (n, k)."""
        solution = np.empty(np.shape(rhs))
        solution[self._order] = self._lu.solve(np.asarray(rhs, dtype=float)[self._order])
        return solution
