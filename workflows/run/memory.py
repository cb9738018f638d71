"""The memory that this process has needed at most."""

from __future__ import annotations

import os
import sys
from pathlib import Path

FACTOR_BYTES = 15e3  # of a sparse Cholesky factor, for each DOF


def forget_peak() -> None:
    """Let the peak count from here on, where the system can."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def peak() -> float:
    """Largest memory since `forget_peak` [bytes]; since the start of the process where the system cannot forget."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
    except (OSError, StopIteration):
        import resource  # which Windows has not

        unit = 1 if sys.platform == "darwin" else 1024
        return float(unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)


def check(n_dof: int, solver: str = "direct") -> None:
    """Raise ValueError where the factorisation of a model of so many DOFs does not fit into this machine's memory."""
    if solver in ("multigrid", "mumps"):  # none, or perhaps on other hosts
        return
    try:
        machine = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, OSError, ValueError):  # as on Windows
        return
    needed = FACTOR_BYTES * n_dof
    if needed > machine:
        raise ValueError(
            f"the mesh has {n_dof} DOFs, whose factorisation needs some {needed / 1e9:.0f} GB, and this machine has "
            f"{machine / 1e9:.0f} GB: make the mesh coarser, or set "
            'reduction.solver = "multigrid", which takes less and far longer'
        )
