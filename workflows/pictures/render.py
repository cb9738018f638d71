"""Pictures in three dimensions, drawn off-screen with pyvista: the contact patch and the worn, deformed part.

`check` makes sure that rendering works before pyvista is used.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.workflows.pictures import render_wheel
from tribodyn.workflows.pictures import view as drawing
from tribodyn.workflows.pictures.style import INK, PRESSURE_MAP, WEAR_MAP
from tribodyn.workflows.pictures.view import BODY, SHADE
from tribodyn.workflows.result.result import Patch, Result

SYSTEM_LIBRARIES = "libgl1 libegl1 libgomp1"
PROBE = "import pyvista as pv; view = pv.Plotter(off_screen=True); view.add_mesh(pv.Sphere()); view.screenshot()"


class RenderingUnavailable(RuntimeError):
    """Off-screen rendering does not work on this machine; the message is one sentence that says what to install."""


def check() -> None:
    """Try one picture in a process of its own, because without its libraries VTK kills the process that uses it.

    Raises  RenderingUnavailable
    """
    _choose_window()
    try:
        done = subprocess.run([sys.executable, "-c", PROBE], capture_output=True, timeout=300, check=False)
        works = done.returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        works = False
    if not works:
        raise RenderingUnavailable(
            "rendering without a screen does not work here: install the system libraries "
            f"{SYSTEM_LIBRARIES} (on Debian: apt-get install -y --no-install-recommends {SYSTEM_LIBRARIES})"
        )


def _choose_window() -> None:
    if sys.platform.startswith("linux"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")


def draw(result: Result, folder: Path, deformation: float | None = None, wear: float | None = None) -> list[Path]:
    """Write every picture that the result has data for as a PNG; returns their paths.

    deformation, wear : factors by which displacement and depth are exaggerated, chosen by size where None
    Raises  RenderingUnavailable
    """
    if result.wear is None or result.patch is None or not len(result.patch.faces):
        return []
    check()
    written = [worn_patch(result, folder / "worn_patch.png", wear)]
    if result.part is None or result.fields is None:
        return written
    wheel = render_wheel.wheel_of(result)
    if wheel is None:
        return [*written, worn_part(result, folder / "worn_part.png", deformation, wear)]
    sector = render_wheel.worn_sector(result, wheel, folder / "worn_sector.png", deformation, wear)
    return [*written, sector, render_wheel.worn_wheel(result, wheel, folder / "worn_wheel.png", deformation)]


def worn_patch(result: Result, path: Path, wear: float | None = None) -> Path:
    """The worn surface of body 1 in relief, coloured by depth, status and pressure; one column for each chosen step."""
    import pyvista as pv

    history, patch = result.wear, result.patch
    assert history is not None
    assert patch is not None
    rows = result.shown_rows()
    depth = np.stack([result.depth_after(row) for row in rows])
    pressure = history.normal_force[rows] / patch.area
    wear = wear or drawing.wear_scale(patch, depth)
    flat = np.column_stack([patch.flat, np.zeros(len(patch.area))])
    sink = -0.2 * float(np.sqrt(patch.area.sum()))  # room for the bars and legends below
    outline = pv.PolyData(flat, drawing.polygons(patch.faces)).extract_feature_edges(40)
    view = drawing.plotter((3, len(rows)))
    for column, row in enumerate(rows):
        points = flat.copy()
        points[:, 2] = -wear * 0.5 * depth[column]  # half of the depth belongs to each of the two surfaces
        relief = pv.PolyData(points, drawing.polygons(patch.faces))
        for line, (values, largest, label, colors) in enumerate(
            [
                (1e3 * depth[column], 1e3 * depth.max(), "total wear depth / mm", WEAR_MAP),
                (history.status[row], None, "", ""),
                (1e-6 * pressure[column], 1e-6 * pressure.max(), "mean pressure / MPa", PRESSURE_MAP),
            ]
        ):
            view.subplot(line, column)
            if largest is None:
                drawing.add_status(view, patch, points, values)
            else:
                drawing.add_field(view, relief, values, largest, label, colors, f"{line} {column}")
            view.add_mesh(outline, color=INK, line_width=1.5)
            view.camera.position = np.array([-0.9, -1.3, 1.2])
            view.camera.up = (0, 0, 1)
            view.camera.focal_point = (0, 0, 0)
            view.reset_camera()
            view.camera.focal_point = np.array(view.camera.focal_point) + [0, 0, sink]
            view.camera.position = np.array(view.camera.position) + [0, 0, sink]
        view.subplot(0, column)
        drawing.title(view, result, row, f"depth on this body \u00d7 {wear:g}")
    return drawing.save(view, path)


def worn_part(result: Result, path: Path, deformation: float | None = None, wear: float | None = None) -> Path:
    """The part seen from the side of the patch: preloaded, at the phase of largest swing, with its worn surface."""
    import pyvista as pv

    patch, part, fields = result.patch, result.part, result.fields
    assert patch is not None
    assert part is not None
    assert fields is not None
    size = float(np.ptp(part.points, axis=0).max())
    static = drawing.at_rest(fields.displacement, result.harmonics)
    rest_scale = deformation or drawing.deformation_scale(static, size)
    depth = np.stack([result.depth_after(row) for row in fields.row])
    wear = wear or drawing.wear_scale(patch, depth)
    cell_type = getattr(pv.CellType, part.kind.upper())
    inward = patch.frames[:, 2]
    resting = drawing.surface(part.points, part.cells, cell_type, 0).extract_feature_edges(40)

    view = drawing.plotter((1, len(static)))
    for column, row in enumerate(fields.row):
        view.subplot(0, column)
        vibration = drawing.swing(fields.displacement[column], result.harmonics)
        scale = deformation or drawing.deformation_scale(vibration, size)
        points = part.points + rest_scale * static[column] + scale * vibration
        points -= wear * 0.5 * drawing.sunk(part.points, patch, depth[column])  # half of the depth for each surface
        body = drawing.surface(points, part.cells, cell_type, 2)
        view.add_mesh(body, color=BODY, **SHADE, smooth_shading=True, split_sharp_edges=True)
        view.add_mesh(resting, color="#9aa1ab", line_width=1)
        worn = pv.PolyData(points[patch.nodes] + 2e-3 * size * inward, drawing.polygons(patch.faces))
        label, most = "total wear depth / mm", 1e3 * depth.max()
        drawing.add_field(view, worn, 1e3 * depth[column], most, label, WEAR_MAP, f"0 {column}")
        scales = f"static \u00d7 {rest_scale:g}, vibration \u00d7 {scale:g}, depth on this body \u00d7 {wear:g}"
        drawing.title(view, result, row, scales)
        _look_at_patch(view, part.points, patch)
    return drawing.save(view, path)


def _look_at_patch(view: Any, points: np.ndarray, patch: Patch) -> None:
    """Camera on the side that the patch faces, a little aside, with the normal of the patch pointing down."""
    centre = points.mean(0)
    normal = patch.frames[:, 2].mean(0)
    along = patch.points.mean(0) - centre
    along -= normal * (along @ normal)
    along = along / np.linalg.norm(along) if np.linalg.norm(along) > 0 else patch.frames[:, 0].mean(0)
    aside = np.cross(normal, along)
    view.camera.focal_point = centre
    view.camera.position = centre + 2.0 * (0.7 * normal + 0.6 * along + 0.9 * aside) * np.ptp(points, axis=0).max()
    view.camera.up = -normal
    view.reset_camera()
    view.camera.zoom(1.15)
