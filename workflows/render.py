"""Pictures in three dimensions, drawn off-screen with pyvista: the contact patch and the worn, deformed part.

pyvista is imported by the functions here and nowhere else, after `check` has made sure that rendering works.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from workflows.result import Patch, Result
from workflows.style import INK, PRESSURE_MAP, STATUS, WEAR_MAP

SYSTEM_LIBRARIES = "libgl1 libegl1 libgomp1"
COLUMN, ROW = 640, 460  # pixels of one view
BODY, PAPER = "#c9ced6", "white"
SHADE = {"ambient": 0.45, "diffuse": 0.6}
PROBE = "import pyvista as pv; view = pv.Plotter(off_screen=True); view.add_mesh(pv.Sphere()); view.screenshot()"


class RenderingUnavailable(RuntimeError):
    """Off-screen rendering does not work on this machine; the message is one sentence that says what to install."""


def check() -> None:
    """Try one picture in a process of its own, because without its libraries VTK kills the process that uses it.

    Raises  RenderingUnavailable
    """
    _choose_window()
    try:
        done = subprocess.run([sys.executable, "-c", PROBE], capture_output=True, timeout=120, check=False)
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
    if result.part is not None and result.fields is not None:
        written.append(worn_part(result, folder / "worn_part.png", deformation, wear))
    return written


def worn_patch(result: Result, path: Path, wear: float | None = None) -> Path:
    """The worn surface of body 1 in relief, coloured by depth, status and pressure; one column for each chosen step."""
    import pyvista as pv

    history, patch = result.wear, result.patch
    assert history is not None
    assert patch is not None
    rows = result.shown_rows()
    depth = np.stack([result.depth_after(row) for row in rows])
    pressure = history.normal_force[rows] / patch.area
    wear = wear or _wear_scale(patch, depth)
    flat = np.column_stack([patch.flat, np.zeros(len(patch.area))])
    sink = -0.2 * float(np.sqrt(patch.area.sum()))  # room for the bars and legends below
    outline = pv.PolyData(flat, _polygons(patch.faces)).extract_feature_edges(40)
    view = _plotter((3, len(rows)))
    for column, row in enumerate(rows):
        points = flat.copy()
        points[:, 2] = -wear * 0.5 * depth[column]  # half of the depth belongs to each of the two surfaces
        surface = pv.PolyData(points, _polygons(patch.faces))
        for line, (values, largest, label, colors) in enumerate(
            [
                (1e3 * depth[column], 1e3 * depth.max(), "total wear depth / mm", WEAR_MAP),
                (history.status[row], None, "", ""),
                (1e-6 * pressure[column], 1e-6 * pressure.max(), "mean pressure / MPa", PRESSURE_MAP),
            ]
        ):
            view.subplot(line, column)
            if largest is None:
                _add_status(view, patch, points, values)
            else:
                _add_field(view, surface, values, largest, label, colors, f"{line} {column}")
            view.add_mesh(outline, color=INK, line_width=1.5)
            view.camera.position = np.array([-0.9, -1.3, 1.2])
            view.camera.up = (0, 0, 1)
            view.camera.focal_point = (0, 0, 0)
            view.reset_camera()
            view.camera.focal_point = np.array(view.camera.focal_point) + [0, 0, sink]
            view.camera.position = np.array(view.camera.position) + [0, 0, sink]
        view.subplot(0, column)
        _title(view, result, row, f"depth on this body \u00d7 {wear:g}")
    return _save(view, path)


def worn_part(result: Result, path: Path, deformation: float | None = None, wear: float | None = None) -> Path:
    """The part seen from the side of the patch: preloaded, at the phase of largest swing, with its worn surface."""
    import pyvista as pv

    patch, part, fields = result.patch, result.part, result.fields
    assert patch is not None
    assert part is not None
    assert fields is not None
    size = float(np.ptp(part.points, axis=0).max())
    static = fields.displacement[..., 0]
    rest_scale = deformation or _deformation_scale(static, size)
    depth = np.stack([result.depth_after(row) for row in fields.row])
    wear = wear or _wear_scale(patch, depth)
    cell_type = getattr(pv.CellType, part.kind.upper())
    inward = patch.frames[:, 2]
    resting = _surface(part.points, part.cells, cell_type, 0).extract_feature_edges(40)

    view = _plotter((1, len(static)))
    for column, row in enumerate(fields.row):
        view.subplot(0, column)
        vibration = swing(fields.displacement[column])
        scale = deformation or _deformation_scale(vibration, size)
        points = part.points + rest_scale * static[column] + scale * vibration
        points[patch.nodes] -= wear * 0.5 * depth[column][:, None] * inward  # half of the depth for each surface
        body = _surface(points, part.cells, cell_type, 2)
        view.add_mesh(body, color=BODY, **SHADE, smooth_shading=True, split_sharp_edges=True)
        view.add_mesh(resting, color="#9aa1ab", line_width=1)
        worn = pv.PolyData(points[patch.nodes] + 2e-3 * size * inward, _polygons(patch.faces))
        _add_field(view, worn, 1e3 * depth[column], 1e3 * depth.max(), "total wear depth / mm", WEAR_MAP, f"0 {column}")
        scales = f"static \u00d7 {rest_scale:g}, vibration \u00d7 {scale:g}, depth on this body \u00d7 {wear:g}"
        _title(view, result, row, scales)
        _look_at_patch(view, part.points, patch)
    return _save(view, path)


def swing(displacement: np.ndarray) -> np.ndarray:
    """Vibration at the instant when the part is farthest from its mean position.

    displacement : (n_node, 3, n_coeff), [x_0, a_1, b_1, ...] [m]
    Returns (n_node, 3) [m]
    """
    n_harmonic = (displacement.shape[-1] - 1) // 2
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    waves = [f(h * angle) for h in range(1, n_harmonic + 1) for f in (np.cos, np.sin)]
    dynamic = displacement[..., 1:] @ np.stack(waves)
    farthest = int(np.argmax(np.sum(dynamic**2, axis=(0, 1))))
    return np.asarray(dynamic[..., farthest])


def _deformation_scale(displacement: np.ndarray, size: float) -> float:
    """Factor that draws the largest of some displacements (..., 3) as a twelfth of the part."""
    largest = float(np.linalg.norm(displacement, axis=-1).max())
    return _nice(size / 12 / largest) if largest > 0 else 1.0


def _wear_scale(patch: Patch, depth: np.ndarray) -> float:
    """Factor, at least 1, that draws the largest depth on one body as a tenth of the patch."""
    wanted = 0.1 * float(np.sqrt(patch.area.sum()))
    return max(1.0, _nice(wanted / (0.5 * depth.max()))) if depth.max() > 0 else 1.0


def _nice(value: float) -> float:
    """The largest of 1, 2, 5, 10, ... (or 0.5, 0.2, ...) that is not above a value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(f"{max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)):.6g}")


def _plotter(shape: tuple[int, int]) -> Any:
    import pyvista as pv

    view = pv.Plotter(
        off_screen=True, shape=shape, window_size=(COLUMN * shape[1], ROW * shape[0]), border=False, lighting="none"
    )
    view.set_background(PAPER)
    for line in range(shape[0]):
        for column in range(shape[1]):
            view.subplot(line, column)
            view.enable_anti_aliasing("ssaa")
    view.add_light(pv.Light(light_type="headlight", intensity=1.0))
    return view


def _save(view: Any, path: Path) -> Path:
    view.screenshot(str(path))
    view.close()
    return path


def _title(view: Any, result: Result, row: int, scales: str) -> None:
    text = f"wear step {row + 1}, {result.cycles_after(row):.3g} cycles\n{scales}"
    view.add_text(text, position=(0.03, 0.87), viewport=True, font_size=10, color=INK, font="arial")


def _add_field(
    view: Any, surface: Any, values: np.ndarray, largest: float, label: str, colors: str, place: str
) -> None:
    surface[place] = values
    bar = {
        "title": label + " " * (1 + int(place.split()[1])),  # pyvista draws one bar for each title
        "vertical": False, "position_x": 0.2, "position_y": 0.02, "width": 0.6, "height": 0.13,
        "title_font_size": 17, "label_font_size": 15, "color": INK, "fmt": "%.3g", "n_labels": 2,
        "font_family": "arial",
    }  # fmt: skip
    view.add_mesh(
        surface, scalars=place, cmap=colors, clim=(0, max(largest, 1e-12)), smooth_shading=True, scalar_bar_args=bar,
        **SHADE,
    )  # fmt: skip


def _add_status(view: Any, patch: Patch, points: np.ndarray, status: np.ndarray) -> None:
    """The status of each pair on its share of the relief, with a legend."""
    import pyvista as pv

    corners, pair = patch.shares(points)
    legend = []
    for bits, (name, color) in STATUS.items():
        here = corners[status[pair] == bits]
        if len(here):
            quads = np.arange(4 * len(here)).reshape(-1, 4)
            view.add_mesh(pv.PolyData(here.reshape(-1, 3), _polygons(quads)), color=color, **SHADE)
            legend.append([name, color])
    size = (0.36, 0.06 * len(legend))
    view.add_legend(legend, bcolor=None, face="rectangle", size=size, loc="lower center", font_family="arial")


def _surface(points: np.ndarray, cells: np.ndarray, cell_type: int, subdivision: int) -> Any:
    import pyvista as pv

    grid = pv.UnstructuredGrid({cell_type: cells}, points)
    return grid.extract_surface(nonlinear_subdivision=subdivision, algorithm="dataset_surface")


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


def _polygons(faces: np.ndarray) -> np.ndarray:
    return np.column_stack([np.full(len(faces), faces.shape[1]), faces]).ravel()
