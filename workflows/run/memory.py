"""The memory that this process has needed at most."""

import os
import sys
from pathlib import Path

from tribodyn.refusal import Refusal

FACTOR = 15e3  # bytes of a factor for each DOF, as measured in docs/developers/performance.md


def forget_peak() -> None:
    """Let the peak count from here on, where the system can."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def peak() -> float:
    """Largest memory since `forget_peak` [bytes]; since the start of the process where the system cannot forget,
    nan on Windows."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
    except (OSError, StopIteration):
        if sys.platform == "win32":
            return float("nan")
        import resource

        unit = 1 if sys.platform == "darwin" else 1024
        return float(unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)


def check(n_dof: int, solver: str, columns: int = 0) -> None:
    """Raise Refusal where a model of so many DOFs, its modes and shapes (n_dof, columns) do not fit this machine."""
    if not {"SC_PAGE_SIZE", "SC_PHYS_PAGES"} <= set(getattr(os, "sysconf_names", {})):  # as on Windows
        return
    machine = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    needed = (FACTOR + 8 * columns) * n_dof
    if needed > machine and solver != "mumps":  # perhaps on other hosts
        raise Refusal(
            f"the mesh has {n_dof} DOFs, whose factorisation needs some {needed / 1e9:.0f} GB, and this machine has "
            f"{machine / 1e9:.0f} GB: make the mesh coarser"
        )
