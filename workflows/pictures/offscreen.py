"""Whether this machine can draw without a screen, tried once before pyvista is used."""

import os
import subprocess
import sys
from functools import cache

from tribodyn.extras import package
from tribodyn.refusal import Refusal, SolverFailure

SYSTEM_LIBRARIES = "libgl1 libegl1 libgomp1"
PROBE = """
from vtkmodules import vtkRenderingOpenGL2  # what draws, a small part of pyvista
from vtkmodules.vtkRenderingCore import vtkRenderWindow
window = vtkRenderWindow()
window.OffScreenRenderingOn()
window.Render()
raise SystemExit(not window.SupportsOpenGL())
"""


class RenderingUnavailable(SolverFailure):
    """Off-screen rendering does not work on this machine; the message names what to install."""


def check() -> None:
    """Try one picture in a process of its own, because without its libraries VTK kills the process that uses it.

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
    """Whether a program that draws comes to its end here."""
    try:
        done = subprocess.run([sys.executable, "-c", probe], capture_output=True, timeout=300, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0
