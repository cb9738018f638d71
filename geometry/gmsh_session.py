"""The one door to Gmsh: a quiet session that always ends."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tribodyn.extras import package
from tribodyn.refusal import Refusal

SYSTEM_LIBRARIES = "libglu1-mesa libgl1 libxcursor1 libxft2 libxinerama1 libgomp1"


class GmshUnavailable(Refusal):
    """Gmsh cannot be imported on this machine."""


@contextmanager
def session() -> Iterator[Any]:
    """Run Gmsh quietly and without the user's own settings; finalise it whatever happens.

    Yields the gmsh module, with an empty model
    Raises GmshUnavailable: the package or one of its system libraries is missing"""
    try:
        gmsh = package("gmsh")
    except OSError as error:  # its shared library is opened with ctypes
        raise GmshUnavailable(
            f"gmsh cannot be loaded ({error}): install its system libraries with "
            f"'apt-get install --no-install-recommends {SYSTEM_LIBRARIES}', or start tribodyn through ./tribodyn."
        ) from error
    if gmsh.isInitialized():  # a limit of time has cut a session off before it could end
        gmsh.finalize()
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.restoreDefaults()  # else options of an earlier session of this process stay
        gmsh.option.setNumber("General.AbortOnError", 2)  # raise, as `initialize` has it; the defaults go on instead
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)  # the same mesh on every machine
        yield gmsh
    finally:
        gmsh.finalize()


def save(gmsh: Any, path: str | Path) -> None:
    """Write the current mesh as binary MSH 4.1, elements of physical groups only.

    Raises  OSError where the file does not come to its end, which Gmsh itself does not report"""
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.option.setNumber("Mesh.SaveAll", 0)
    gmsh.write(str(path))
    with open(path, "rb") as file:
        tail = min(len(b"\n$EndElements\r\n"), file.seek(0, os.SEEK_END))
        file.seek(-tail, os.SEEK_END)
        if b"$End" not in file.read():
            raise OSError(f"the mesh cannot be written to '{path}': is the disk full?")
