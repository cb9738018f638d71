"""Fields of a result on the mesh of its part and on its contact patch, as pyvista objects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tribodyn.extras import package
from tribodyn.workflows.pictures import view
from tribodyn.workflows.result.result import Result

if TYPE_CHECKING:
    import pyvista as pv


def mesh_fields(result: Result, row: int | None = None) -> pv.UnstructuredGrid:
    """The mesh of the part with the fields that a wear row has.

    row : of the wear history, among `result.fields.row`; the last of them by default
    Point data, (n_node, 3) or (n_node,), in SI units:
        static        displacement at rest under the static loads and the mean contact forces [m]
        vibration     displacement from there at the instant of the largest swing [m]
        amplitude     largest distance from the mean position over the cycle [m]
        wear_depth    total depth of the pair at the node in that state, nan off the patch [m]
    Raises  ValueError where the result keeps no mesh or no field at the row
    """

    part, fields = result.part, result.fields
    if part is None or fields is None:
        raise ValueError("the result keeps no fields on a mesh: its scene needs a part, [wear] and pictures.renders")
    rows = [int(kept) for kept in fields.row]
    row = rows[-1] if row is None else row
    if row not in rows:
        raise ValueError(f"the result has no field at wear row {row}: it has those at {', '.join(map(str, rows))}")
    displacement = fields.displacement[rows.index(row)]
    grid = view.grid_of(part)
    vibration = view.cycle(displacement, result.harmonics)
    grid.point_data["static"] = view.at_rest(displacement, result.harmonics)
    grid.point_data["vibration"] = view.swing(displacement, result.harmonics)
    grid.point_data["amplitude"] = np.linalg.norm(vibration, axis=1).max(axis=1)
    if result.wear is not None:
        depth = np.full(len(part.points), np.nan)
        depth[result.patch.nodes] = result.wear.depth[row]
        grid.point_data["wear_depth"] = depth
    return grid


def patch_fields(result: Result, row: int = -1) -> pv.PolyData:
    """The faces of the contact patch with what a wear row holds for each pair, all of the one state that it solved.

    Point data (n_pair,): wear_depth [m] of that state, gap [m] before loading, pressure [Pa] mean over the cycle,
    energy [J] friction work of one cycle, status (bits of hbm.contact.law: 1 sticks, 2 slips, 4 separates)
    Raises  ValueError where the result has no worn patch with faces
    """
    pv = package("pyvista")

    patch, wear = result.patch, result.wear
    if wear is None or not len(wear.cycles) or not len(patch.faces):
        raise ValueError("the result holds no worn patch with faces")
    if not -len(wear.cycles) <= row < len(wear.cycles):
        raise ValueError(f"the result has no wear row {row}: it has 0 to {len(wear.cycles) - 1}")
    surface = pv.PolyData(patch.points, view.polygons(patch.faces))
    surface.point_data["wear_depth"] = wear.depth[row]
    surface.point_data["gap"] = patch.gap
    surface.point_data["pressure"] = wear.normal_force[row] / patch.area
    surface.point_data["energy"] = wear.energy[row]
    surface.point_data["status"] = wear.status[row]
    return surface
