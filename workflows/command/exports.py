"""Words of the command `tribodyn` that hand a result on to other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tribodyn.workflows.command.words import make_room

Formats = Annotated[tuple[str, ...], Parameter(name="--to", negative=(), consume_multiple=True)]


def export(result: Path, *, to: Formats, out: Path | None = None, mesh_ending: str = ".xdmf") -> None:
    """Write a result in the formats of other programs.

    Parameters
    ----------
    result
        Folder or file of a result.
    to
        Formats, one or several: vtk (series for ParaView), csv, parquet, mat, uff (tables and curves), mesh (worn part
        with its fields), npz, mtx, abaqus (reduced matrices).
    out
        Folder, in which each format gets a folder of its own; export/ beside the result by default.
    mesh_ending
        Format of the mesh by its ending, such as .vtu, .exo, .msh or .bdf.
    """
    from tribodyn.workflows.api import whole_scenes
    from tribodyn.workflows.studies import scenes

    make_room(out)
    for written in whole_scenes.export(result, to, out or scenes.result_file(result).parent / "export", mesh_ending):
        print(written)


COMMANDS = (export,)
