"""What the pictures in three dimensions share: views, scales, fields and status on a patch.

pyvista is imported by the functions here and nowhere else.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.workflows.pictures.style import INK, STATUS
from tribodyn.workflows.result.result import Patch, Result

COLUMN, ROW = 640, 460  # pixels of one view
BODY, PAPER = "#c9ced6", "white"
SHADE = {"ambient": 0.45, "diffuse": 0.6}
INSTANTS = 64  # of a cycle, among which that of the largest swing is looked for


def sunk(points: np.ndarray, patch: Patch, depth: np.ndarray) -> np.ndarray:
    """Along the normals of a patch, how deep every node (n_node, 3) of its part lies under a depth of the pairs.

    points : (n_node, 3) of the part [m]; depth : (n_pair,) [m]
    Where pairs stand at the corners of elements alone, the nodes between them get the mean of their neighbours
    """
    moved = np.zeros_like(points)
    along = depth[:, None] * patch.frames[:, 2]
    corner = patch.faces
    between = [corner, *(np.stack([corner[:, i], corner[:, i - 1]], axis=1) for i in range(corner.shape[1]))]
    size = np.linalg.norm(np.ptp(patch.points, axis=0))
    tree = cKDTree(points)
    for group in between:
        distance, node = tree.query(patch.points[group].mean(axis=1))
        there = distance < 1e-5 * size
        moved[node[there]] = along[group].mean(axis=1)[there]
    moved[patch.nodes] = along
    return moved


def at_rest(displacement: np.ndarray, harmonics: tuple[int, ...]) -> np.ndarray:
    """Static part (...) of coefficients (..., n_coeff) on these harmonics, none where harmonic 0 is not kept [m]."""
    return displacement[..., 0] if harmonics[0] == 0 else np.zeros(displacement.shape[:-1])


def swing(displacement: np.ndarray, harmonics: tuple[int, ...]) -> np.ndarray:
    """Vibration at the instant when the part is farthest from its mean position.

    displacement : (n_node, 3, n_coeff) on these harmonics [m]
    Returns (n_node, 3) [m]
    """
    dynamic = cycle(displacement, harmonics)
    farthest = int(np.argmax(np.sum(dynamic**2, axis=(0, 1))))
    return np.asarray(dynamic[..., farthest])


def cycle(displacement: np.ndarray, harmonics: tuple[int, ...]) -> np.ndarray:
    """Vibration about the mean position (..., n_instant) over one cycle from coefficients (..., n_coeff) [m]."""
    basis = HarmonicBasis(harmonics, max(INSTANTS, 2 * harmonics[-1] + 1))
    return np.asarray(displacement @ (basis.synthesis * (basis.order > 0)).T)


def deformation_scale(displacement: np.ndarray, size: float) -> float:
    """Factor that draws the largest of some displacements (..., 3) as a twelfth of the part."""
    largest = float(np.linalg.norm(displacement, axis=-1).max())
    return nice(size / 12 / largest) if largest > 0 else 1.0


def wear_scale(patch: Patch, depth: np.ndarray) -> float:
    """Factor, at least 1, that draws the largest depth on one body as a tenth of the patch."""
    wanted = 0.1 * float(np.sqrt(patch.area.sum()))
    return max(1.0, nice(wanted / (0.5 * depth.max()))) if depth.max() > 0 else 1.0


def nice(value: float) -> float:
    """The largest of 1, 2, 5, 10, ... (or 0.5, 0.2, ...) that is not above a value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(f"{max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)):.6g}")


def plotter(shape: tuple[int, int], row: int = ROW) -> Any:
    """Views in rows and columns; row : height of one in pixels."""
    import pyvista as pv

    view = pv.Plotter(
        off_screen=True, shape=shape, window_size=(COLUMN * shape[1], row * shape[0]), border=False, lighting="none"
    )
    view.set_background(PAPER)
    for line in range(shape[0]):
        for column in range(shape[1]):
            view.subplot(line, column)
            view.enable_anti_aliasing("ssaa")
    view.add_light(pv.Light(light_type="headlight", intensity=1.0))
    return view


def save(view: Any, path: Path) -> Path:
    view.screenshot(str(path))
    view.close()
    return path


def title(view: Any, result: Result, row: int, scales: str) -> None:
    text = f"wear step {row + 1}, {result.cycles_after(row):.3g} cycles\n{scales}"
    view.add_text(text, position=(0.03, 0.87), viewport=True, font_size=10, color=INK, font="arial")


def add_field(
    view: Any, surface: Any, values: np.ndarray, largest: float, label: str, colors: str, place: str
) -> None:
    surface[place] = values
    view.add_mesh(
        surface, scalars=place, cmap=colors, clim=(0, max(largest, 1e-12)), smooth_shading=True,
        scalar_bar_args=bar(label, int(place.split()[1])), **SHADE,
    )  # fmt: skip


def bar(label: str, column: int) -> dict[str, Any]:
    """How the bar of a field is drawn in a column of views."""
    return {
        "title": label + " " * (1 + column),  # pyvista draws one bar for each title
        "vertical": False, "position_x": 0.2, "position_y": 0.02, "width": 0.6, "height": 0.13,
        "title_font_size": 17, "label_font_size": 15, "color": INK, "fmt": "%.3g", "n_labels": 2,
        "font_family": "arial",
    }  # fmt: skip


def add_status(view: Any, patch: Patch, points: np.ndarray, status: np.ndarray, legend: bool = True) -> None:
    """The status of each pair on its share of the relief, with a legend unless another patch has brought it."""
    import pyvista as pv

    corners, pair = patch.shares(points)
    entries = []
    for bits, (name, color) in STATUS.items():
        here = corners[status[pair] == bits]
        if len(here):
            quads = np.arange(4 * len(here)).reshape(-1, 4)
            view.add_mesh(pv.PolyData(here.reshape(-1, 3), polygons(quads)), color=color, **SHADE)
            entries.append([name, color])
    if not legend:
        return
    size = (0.36, 0.06 * len(entries))
    view.add_legend(entries, bcolor=None, face="rectangle", size=size, loc="lower center", font_family="arial")


def surface(points: np.ndarray, cells: np.ndarray, cell_type: int, subdivision: int) -> Any:
    import pyvista as pv

    grid = pv.UnstructuredGrid({cell_type: cells}, points)
    return grid.extract_surface(nonlinear_subdivision=subdivision, algorithm="dataset_surface")


def polygons(faces: np.ndarray) -> np.ndarray:
    return np.column_stack([np.full(len(faces), faces.shape[1]), faces]).ravel()
