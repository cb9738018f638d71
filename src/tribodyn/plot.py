"""Pictures of a result: each function returns a matplotlib figure, `film` and `write` write files.

    import tribodyn as td

    td.plot.response(result).savefig("response.png")
    td.plot.wear(result, "depth").savefig("depth.png")

`axes`, `draw_field`, `draw_status` and `shades` draw one's own figures in the same style, see `tribodyn.style`."""

from tribodyn.workflows.export.vtk import mesh_fields, patch_fields
from tribodyn.workflows.pictures.figures import axes_of as axes, length_unit
from tribodyn.workflows.pictures.film import film
from tribodyn.workflows.pictures.loop_plots import hysteresis
from tribodyn.workflows.pictures.maps import (
    draw_field,
    draw_status,
    motion_maps as motion,
    patch_maps as patch,
    status_maps as status,
)
from tribodyn.workflows.pictures.plots import draw as write
from tribodyn.workflows.pictures.render import draw as render
from tribodyn.workflows.pictures.response_plots import response
from tribodyn.workflows.pictures.wear_plots import wear
from tribodyn.workflows.pictures.wheel_diagrams import campbell, nodal_diameters, safe, shades

__all__ = [
    "axes",
    "campbell",
    "draw_field",
    "draw_status",
    "film",
    "hysteresis",
    "length_unit",
    "mesh_fields",
    "motion",
    "nodal_diameters",
    "patch",
    "patch_fields",
    "render",
    "response",
    "safe",
    "shades",
    "status",
    "wear",
    "write",
]
