"""The mesh of the worn part with its fields, by meshio, for programs that read meshes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.workflows.export.vtk import part_grid
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.states import shown_states

KIND = {
    "triquadratic_hexahedron": "hexahedron27",
    "quadratic_tetra": "tetra10",
    "hexahedron": "hexahedron",
    "tetra": "tetra",
}
WITH_FIELDS = (".xdmf", ".vtu", ".vtk", ".msh", ".exo", ".e", ".med")
MESH_ONLY = (".bdf", ".nas", ".inp", ".unv", ".mesh", ".cgns")


def write_mesh(result: Result, path: Path) -> list[Path]:
    """The part as worn in the last state that is shown, in the format that the ending of a file names.

    Raises  ValueError where the result has no mesh or the format cannot hold it
    """
    import meshio

    if result.part is None:
        raise ValueError("mesh: this result keeps no mesh; run a scene with a part and pictures.renders = true")
    if path.suffix not in (*WITH_FIELDS, *MESH_ONLY):
        raise ValueError(f'mesh: no format "{path.suffix}": take one of {", ".join((*WITH_FIELDS, *MESH_ONLY))}')
    grid = part_grid(result, shown_states(result)[-1])
    data: dict[str, Any] = {}
    if path.suffix in WITH_FIELDS:
        data = {name: _plain(np.asarray(grid.point_data[name])) for name in grid.point_data}
    kind = KIND.get(result.part.kind, result.part.kind)
    mesh = meshio.Mesh(np.asarray(grid.points), [(kind, result.part.cells)], point_data=data)
    try:
        meshio.write(path, mesh)
    except (meshio.WriteError, KeyError, AssertionError) as error:
        path.unlink(missing_ok=True)
        raise ValueError(f"mesh: {path.suffix} cannot hold {kind} elements ({error}); take .xdmf or .vtu") from None
    return sorted(path.parent.glob(f"{path.stem}.*"))


def _plain(values: np.ndarray) -> np.ndarray:
    return values.astype(float) if values.dtype.kind in "iu" else values
