"""Maps of the contact patch in its own plane: wear depth, contact status and pressure in chosen states."""

from __future__ import annotations

from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from tribodyn.workflows.pictures.figures import heading, length_unit, pressure_unit, status_legend
from tribodyn.workflows.pictures.style import PRESSURE_MAP, STATUS, STYLE, WEAR_MAP
from tribodyn.workflows.result.result import Patch, Result
from tribodyn.workflows.result.states import shown_cycles, shown_states, state_of

LEAST = 5.6  # inches of width: the legend of all states fits below


def patch_maps(result: Result, rows: np.ndarray | None = None, scale: Literal["column", "shared"] = "column") -> Figure:
    """Depth, status over the cycle and mean pressure, one column for each state.

    rows : of the wear history, or points of a response that does not wear; those of the result by default
    scale : whether each map has its own scale, with its range, or all maps of a row share one
    """
    patch = result.patch
    assert patch is not None
    states = shown_states(result) if rows is None else [state_of(result, int(row)) for row in rows]
    unit, factor = length_unit(max(float(state.depth.max()) for state in states))
    fields: dict[str, tuple[str, list[np.ndarray]]] = {}
    if any(state.depth.max() > 0 for state in states):
        fields[f"total wear depth / {unit}"] = (WEAR_MAP, [factor * state.depth for state in states])
    if all(state.pressure is not None for state in states):
        pressures = [s.pressure for s in states if s.pressure is not None]
        unit, factor = pressure_unit(max(float(p.max()) for p in pressures))
        fields[f"mean pressure / {unit}"] = (PRESSURE_MAP, [factor * p for p in pressures])
    told = all(state.status is not None for state in states)
    lines = list(fields)[:1] + ["status"] * told + list(fields)[1:]
    aspect = float(np.clip(np.ptp(patch.flat[:, 1]) / np.ptp(patch.flat[:, 0]), 0.25, 2.0))
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        size = (max(3.1 * len(states) + 0.4, LEAST), len(lines) * (2.3 * aspect + 0.75) + 0.9)
        figure = Figure(figsize=size, layout="constrained")
        grid = figure.subplots(len(lines), len(states), squeeze=False)
        for line, name in enumerate(lines):
            for column, (axes, state) in enumerate(zip(grid[line], states, strict=True)):
                if name == "status" and state.status is not None:
                    draw_status(axes, patch, state.status)
                    continue
                colors, values = fields[name]
                low, high = _limits(values if scale == "shared" else [values[column]])
                shown = draw_field(axes, patch, values[column], colors, high, low)
                colour_bar(figure, axes, shown, name, high, low)
        for axes, state in zip(grid[0], states, strict=True):
            axes.set_title(state.label, fontsize=11)
        label_axes(grid, patch)
        _name_contacts(grid[:, 0], result)
        if told:
            status_legend(figure, {int(b) for s in states if s.status is not None for b in s.status}, patch.components)
        heading(figure, result, "contact patch")
    return figure


def status_maps(result: Result, count: int = 8) -> Figure:
    """Status over the cycle at up to `count` wear steps, evenly chosen among the rows that curves show."""
    patch, wear = result.patch, result.wear
    assert patch is not None
    assert wear is not None
    last = int(np.flatnonzero(wear.cycles <= shown_cycles(wear))[-1])
    rows = np.unique(np.linspace(0, last, count).round().astype(int))
    columns = min(len(rows), 4)
    lines = -(-len(rows) // columns)
    aspect = float(np.clip(np.ptp(patch.flat[:, 1]) / np.ptp(patch.flat[:, 0]), 0.25, 2.0))
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(
            figsize=(max(2.5 * columns + 0.4, LEAST), lines * (2.2 * aspect + 0.6) + 1.0), layout="constrained"
        )
        grid = figure.subplots(lines, columns, squeeze=False)
        for axes, row in zip(grid.ravel(), rows, strict=False):
            draw_status(axes, patch, wear.status[row])
            axes.set_title(state_of(result, int(row)).label, fontsize=10)
        for axes in grid.ravel()[len(rows) :]:
            axes.axis("off")
        for axes in grid.ravel()[: len(rows)]:
            axes.locator_params(nbins=4)
            axes.tick_params(labelsize=9)
            axes.set(xlabel="t1 / mm", ylabel="t2 / mm")
            axes.label_outer(remove_inner_ticks=False)
        _name_contacts(grid[:, 0], result)
        status_legend(figure, {int(bits) for row in rows for bits in wear.status[row]}, patch.components)
        heading(figure, result, "contact status over wear")
    return figure


def label_axes(grid: np.ndarray, patch: Patch) -> None:
    """Ticks and labels of the axes (n_row, n_column) of maps of one face."""
    names = [name for name in ("t1", "t2") if name in patch.components] or ["t1", "t2"]
    for axes in grid.ravel():
        axes.locator_params(nbins=5)
        axes.tick_params(labelsize=9)
        axes.label_outer(remove_inner_ticks=False)
    for axes in grid[-1]:
        axes.set_xlabel(f"{names[0]} / mm", fontsize=10)
    for axes in grid[:, 0]:
        axes.set_ylabel(f"{names[-1]} / mm", fontsize=10)


def colour_bar(figure: Figure, axes: mpl.axes.Axes, shown: Any, name: str, high: float, low: float) -> None:
    """The scale below a map from `draw_field`; one value alone is told in words."""
    bar = figure.colorbar(shown, ax=axes, location="bottom", shrink=0.85, aspect=26)
    bar.set_label(name if high > low else f"{name}: {low:.3g} everywhere", fontsize=10)
    bar.ax.tick_params(labelsize=9)
    bar.locator = MaxNLocator(4) if high > low else mpl.ticker.NullLocator()
    bar.update_ticks()


def _name_contacts(columns: np.ndarray, result: Result) -> None:
    """Names of the contacts beside their faces, where several are drawn one above the other."""
    patch, named = result.patch, result.facts.pairs_of_joints
    assert patch is not None
    if len(named) < 2 or patch.in_one_plane:
        return
    height = 1e3 * patch.flat[:, 1]
    for axes in columns:
        middles = [(height[pairs].min() + height[pairs].max()) / 2 for pairs in named.values()]
        axes.set_yticks(middles, [name.replace("_", " ") for name in named])
        axes.set_ylabel("")


def _limits(values: list[np.ndarray]) -> tuple[float, float]:
    """Lowest and highest value, from zero where the values spread over half of their size."""
    low, high = min(float(v.min()) for v in values), max(float(v.max()) for v in values)
    return (0.0 if 0 < low < 0.5 * high else low), high


def draw_field(axes: Any, patch: Patch, values: np.ndarray, colors: str, largest: float, smallest: float = 0.0) -> Any:
    """A field with one value for each pair, interpolated between them."""
    x, y = 1e3 * patch.flat.T
    faces = patch.faces
    triangles = np.concatenate([faces[:, [0, i, i + 1]] for i in range(1, faces.shape[1] - 1)])
    axes.set_aspect("equal")
    top = largest if largest > smallest else smallest + max(abs(smallest), 1e-12)
    return axes.tripcolor(
        Triangulation(x, y, triangles), values, shading="gouraud", cmap=colors, vmin=smallest, vmax=top, rasterized=True
    )


def draw_status(axes: Any, patch: Patch, status: np.ndarray) -> None:
    """The status of each pair on its share of the patch."""
    corners, pair = patch.shares(1e3 * patch.flat)
    colors = [STATUS[int(bits)][1] for bits in status[pair]]
    axes.add_collection(PolyCollection(list(corners), facecolors=colors, edgecolors=colors, linewidths=0.6))
    axes.autoscale_view()
    axes.set_aspect("equal")
