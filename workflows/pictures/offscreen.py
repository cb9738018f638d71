"""Whether this machine can draw without a screen, tried once before pyvista is used."""

import faulthandler
import os
import subprocess
import sys
from functools import cache
from importlib import import_module
from multiprocessing import get_context

from tribodyn.extras import package
from tribodyn.refusal import Refusal, SolverFailure

SYSTEM_LIBRARIES = "libgl1 libegl1 libgomp1"
PROBE = "import pyvista as pv; view = pv.Plotter(off_screen=True); view.add_mesh(pv.Sphere()); view.screenshot()"


class RenderingUnavailable(SolverFailure):
    """Off-screen rendering does not work on this machine; the message names what to install."""


def check() -> None:
    """Try one picture in a process of its own, because without its libraries VTK kills the process that uses it.

    On Linux that process is a child which need not load pyvista again; this one draws with it next, anyway.

    Raises  RenderingUnavailable, also where pyvista is not installed"""
    try:
        package("pyvista")
    except Refusal as missing:
        raise RenderingUnavailable(str(missing)) from None
    if sys.platform.startswith("linux"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    if not _works(PROBE):
        raise RenderingUnavailable(
            "rendering without a screen does not work here: install the system libraries "
            f"{SYSTEM_LIBRARIES} (on Debian: apt-get install -y --no-install-recommends {SYSTEM_LIBRARIES})"
        )


@cache
def _works(probe: str) -> bool:
    """Whether a program of pyvista comes to its end here."""
    if sys.platform.startswith("linux") and _works_in_child(probe):
        return True
    try:
        done = subprocess.run([sys.executable, "-c", probe], capture_output=True, timeout=300, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


def _works_in_child(probe: str, patience: float = 30.0) -> bool:
    """Whether it ends well in a child within so many seconds.

    That can fail for another reason too: this process has drawn before, or may have no children."""
    child = get_context("fork").Process(target=_run_in_silence, args=(probe,), daemon=True)
    try:
        child.start()
    except (OSError, AssertionError):
        return False
    child.join(patience)
    child.kill()
    return child.exitcode == 0


def _run_in_silence(probe: str) -> None:
    resource = import_module("resource")
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    faulthandler.disable()  # whether it dies is the question
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    exec(probe, {})
