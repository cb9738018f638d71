"""Maps of the contact patch in its own plane: wear depth, contact status and pressure at chosen wear steps."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch as Swatch
from matplotlib.tri import Triangulation

from tribodyn.workflows.pictures.style import PRESSURE_MAP, STATUS, STYLE, WEAR_MAP
from tribodyn.workflows.result.result import Patch, Result


def patch_maps(result: Result, rows: np.ndarray | None = None) -> Figure:
    """Depth after the step, status over the cycle and mean pressure of the step, one column for each chosen step.

    rows : wear rows to show, those of the result by default
    """
    wear, patch = result.wear, result.patch
    assert wear is not None
    assert patch is not None
    rows = result.shown_rows() if rows is None else rows
    depth = 1e3 * np.stack([result.depth_after(row) for row in rows])
    pressure = 1e-6 * wear.normal_force[rows] / patch.area
    aspect = float(np.clip(np.ptp(patch.flat[:, 1]) / np.ptp(patch.flat[:, 0]), 0.3, 2.0))
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(figsize=(2.7 * len(rows) + 2.2, 3 * 2.5 * aspect + 1.4), layout="constrained")
        grid = figure.subplots(3, len(rows) + 1, squeeze=False, width_ratios=[1.0] * len(rows) + [0.55])
        maps, sides = grid[:, :-1], grid[:, -1]
        for column, row in enumerate(rows):
            maps[0, column].set_title(
                f"wear step {row + 1}\n{_cycles(result.cycles_after(row))} cycles", fontsize=10, fontweight="normal"
            )
            shown = draw_field(maps[0, column], patch, depth[column], WEAR_MAP, depth.max())
            draw_status(maps[1, column], patch, wear.status[row])
            pressed = draw_field(maps[2, column], patch, pressure[column], PRESSURE_MAP, pressure.max())
        for side in sides:
            side.axis("off")
        figure.colorbar(shown, cax=sides[0].inset_axes([0, 0, 0.12, 1]), label="total wear depth / mm")
        figure.colorbar(pressed, cax=sides[2].inset_axes([0, 0, 0.12, 1]), label="mean pressure / MPa")
        present = [bits for bits in STATUS if bits in wear.status[rows]]
        swatches = [Swatch(color=STATUS[bits][1], label=STATUS[bits][0]) for bits in present]
        sides[1].legend(handles=swatches, loc="center left", bbox_to_anchor=(-0.1, 0.5), fontsize=8, handlelength=1)
        names = [name for name in ("t1", "t2") if name in patch.components] or ["t1", "t2"]
        for axes in maps.ravel():
            axes.tick_params(labelleft=axes in maps[:, 0], labelbottom=axes in maps[-1])
        for axes in maps[-1]:
            axes.set_xlabel(f"{names[0]} / mm")
        for axes in maps[:, 0]:
            axes.set_ylabel(f"{names[-1]} / mm")
    return figure


def draw_field(axes: Any, patch: Patch, values: np.ndarray, colors: str, largest: float) -> Any:
    """A field with one value for each pair, interpolated between them."""
    x, y = 1e3 * patch.flat.T
    faces = patch.faces
    triangles = np.concatenate([faces[:, [0, i, i + 1]] for i in range(1, faces.shape[1] - 1)])
    axes.set_aspect("equal")
    return axes.tripcolor(
        Triangulation(x, y, triangles), values, shading="gouraud", cmap=colors, vmin=0, vmax=max(largest, 1e-12)
    )


def draw_status(axes: Any, patch: Patch, status: np.ndarray) -> None:
    """The status of each pair on its share of the patch."""
    corners, pair = patch.shares(1e3 * patch.flat)
    colors = [STATUS[int(bits)][1] for bits in status[pair]]
    axes.add_collection(PolyCollection(list(corners), facecolors=colors, edgecolors=colors, linewidths=0.3))
    axes.plot(*(1e3 * patch.flat.T), ".", color="white", ms=1.5)
    axes.set_aspect("equal")


def _cycles(count: float) -> str:
    """A number of cycles as 3.20·10⁶."""
    if count < 1e4:
        return f"{count:.0f}"
    power = int(np.log10(count))
    return f"{count / 10**power:.2f}$\\cdot$10$^{{{power}}}$"
