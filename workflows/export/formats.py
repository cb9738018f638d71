"""The formats that `tribodyn export` knows, by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from tribodyn.workflows.export import curves, matrix_file, vtk
from tribodyn.workflows.result.result import Result

FORMATS: dict[str, tuple[str, Callable[[Result, Path], list[Path]]]] = {
    "vtk": ("series for ParaView over wear and over a cycle (.pvd, .vtu, .vtp)", vtk.write_vtk),
    "csv": ("every curve and history as a table", curves.write_csv),
    "mat": ("the same tables as structs for MATLAB", curves.write_mat),
    "uff": ("universal file, dataset 58, for tools of measured data", curves.write_uff),
    "mesh": (
        "worn part with its fields (.xdmf; another format with --mesh-ending)",
        lambda r, f: vtk.write_mesh(r, f / "part.xdmf"),
    ),
    "npz": ("reduced matrices for NumPy, and for a scene's [model]", matrix_file.write_npz),
    "matlab": ("reduced matrices for MATLAB, and for a scene's [model]", matrix_file.write_matlab),
    "op4": ("reduced matrices, Nastran OUTPUT4", matrix_file.write_op4),
    "abaqus": ("reduced matrices, Abaqus *MATRIX INPUT", matrix_file.write_abaqus),
}


def write(result: Result, wanted: Sequence[str], folder: Path, mesh_ending: str = ".xdmf") -> list[Path]:
    """Write a result in some formats, each into a folder of its name; returns the files to open.

    Raises  ValueError: a format that is not known, or that cannot hold this result
    """
    for name in wanted:
        if name not in FORMATS:
            raise ValueError(f"--to {name}: no such format; there are {', '.join(FORMATS)}")
    written = []
    for name in dict.fromkeys(wanted):
        place = folder / name
        place.mkdir(parents=True, exist_ok=True)
        if name == "mesh":
            written += vtk.write_mesh(result, place / f"part{mesh_ending}")
        else:
            written += FORMATS[name][1](result, place)
    return written
