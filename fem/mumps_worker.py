"""One MPI process of a factorisation by MUMPS, run by a Python that has PETSc: see tribodyn.fem.mumps, which starts it.

It stands alone: that Python needs numpy, mpi4py and petsc4py, and nothing of tribodyn."""

import glob
import sys
from pathlib import Path
from typing import Any

import numpy as np

PLACES = "/usr/lib/petscdir/*/*-real/lib/python3/dist-packages"  # where Debian lays petsc4py


def main(folder: Path) -> None:
    """Factorise the matrix of a folder, then solve what is asked for, line by line, until there is no more."""
    petsc, comm = _petsc()
    rank, processes = comm.Get_rank(), comm.Get_size()
    rows, columns, values = (np.load(folder / f"{name}.npy", mmap_mode="r") for name in ("rows", "columns", "values"))
    n = len(rows) - 1
    start, stop = n * rank // processes, n * (rank + 1) // processes
    n_local, entries = stop - start, slice(int(rows[start]), int(rows[stop]))
    own_rows = (np.array(a, np.int32) for a in (rows[start : stop + 1] - rows[start], columns[entries]))
    matrix = petsc.Mat().createAIJ(((n_local, n), (n_local, n)), csr=(*own_rows, np.array(values[entries])), comm=comm)
    matrix.setOption(petsc.Mat.Option.SYMMETRIC, True)
    matrix.setOption(petsc.Mat.Option.SPD, (folder / "definite").exists())
    pc = petsc.PC().create(comm)
    pc.setOperators(matrix)
    pc.setType("cholesky")
    pc.setFactorSolverType("mumps")
    pc.setUp()
    factor = pc.getFactorMatrix()
    trouble = factor.getMumpsInfog(1)
    version = ".".join(str(number) for number in petsc.Sys.getVersion())
    _tell(rank, f"trouble {trouble}" if trouble < 0 else f"ready {processes} {version}")
    # a line is a number of right-hand sides; none is left where the input ends
    while (count := comm.bcast(int(sys.stdin.readline() or 0) if rank == 0 else None)) and trouble >= 0:
        rhs = np.memmap(folder / "rhs", np.float64, "r", shape=(n, count), order="F")
        solution = np.memmap(folder / "found", np.float64, "r+", shape=(n, count), order="F")
        shape, part = ((n_local, n), (None, count)), np.array(rhs[start:stop], order="F")
        right_side = petsc.Mat().createDense(shape, array=part, comm=comm)
        solved = petsc.Mat().createDense(shape, comm=comm)
        for each in (right_side, solved):
            each.setUp()
            each.assemble()
        factor.matSolve(right_side, solved)
        solution[start:stop] = solved.getDenseArray()
        solution.flush()
        comm.Barrier()
        right_side.destroy()
        solved.destroy()
        _tell(rank, "solved")


def _petsc() -> tuple[Any, Any]:
    try:
        import petsc4py
    except ImportError:
        sys.path += sorted(glob.glob(PLACES))
        import petsc4py
    petsc4py.init([])
    from mpi4py import MPI
    from petsc4py import PETSc

    return PETSc, MPI.COMM_WORLD


def _tell(rank: int, text: str) -> None:
    if rank == 0:
        print(text, flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
