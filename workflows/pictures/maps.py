"""Maps of contact patches in their own plane: depth, status and pressure; slide, gap and friction work of a cycle."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.wear.history import WearHistory
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import (
    area_energy_unit,
    length_unit,
    pressure_unit,
    scale_bar,
    status_legend,
    titled,
)
from tribodyn.workflows.pictures.matplotlib_names import Figure, PolyCollection, Triangulation, mpl
from tribodyn.workflows.pictures.theme import LAYOUT, MOTION_MAP, PRESSURE_MAP, STATUS, STYLE, WEAR_MAP
from tribodyn.workflows.result.contact_states import shown_cycles, shown_states, state_of
from tribodyn.workflows.result.result import Patch, Result

Row = tuple[str, list[tuple[str, np.ndarray]]]
"""A row of maps: colour map, and for each column the label of its scale and the values (n_pair,)."""


def patch_maps(result: Result, rows: Sequence[int] | np.ndarray | None = None) -> Figure:
    """Depth, status over the cycle and mean pressure, one column for each state, each map with its own scale.

    rows : of the wear history, or points of a response that does not wear; those of the result by default
    Raises  Refusal where the patch has no faces"""
    patch = _with_faces(result)
    states = shown_states(result) if rows is None else [state_of(result, int(row)) for row in rows]
    fields: list[Row] = []
    if any(state.depth.max() > 0 for state in states):
        unit, factor = length_unit(max(float(state.depth.max()) for state in states))
        fields.append((WEAR_MAP, [(f"total wear depth / {unit}", factor * state.depth) for state in states]))
    if all(state.status is not None for state in states):
        fields.append(("status", [("", np.asarray(state.status)) for state in states]))
    pressures = [state.pressure for state in states if state.pressure is not None]
    if len(pressures) == len(states):
        unit, factor = pressure_unit(max(float(p.max()) for p in pressures))
        fields.append((PRESSURE_MAP, [(f"mean pressure / {unit}", factor * p) for p in pressures]))
    figure, grid = _drawn(patch, fields, [state.label for state in states], titled(result, "contact patch"))
    _name_contacts(grid[:, 0], result)
    return figure


def status_maps(result: Result, count: int = 8) -> Figure:
    """Status over the cycle at up to `count` wear steps, evenly chosen among the rows that curves show.

    Raises  Refusal where nothing was worn or the patch has no faces"""
    patch, wear = _worn(result)
    last = int(np.flatnonzero(wear.cycles <= shown_cycles(wear))[-1])
    rows = np.unique(np.linspace(0, last, count).round().astype(int))
    columns = min(len(rows), 4)
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure, grid = _grid(patch, -(-len(rows) // columns), columns)
        for axes, row in zip(grid.ravel(), rows, strict=False):
            draw_status(axes, patch, wear.status[row])
            axes.set_title(state_of(result, int(row)).label)
        _label_axes(grid, patch)
        for axes in grid.ravel()[len(rows) :]:
            axes.axis("off")
        _name_contacts(grid[:, 0], result)
        status_legend(figure, {int(bits) for row in rows for bits in wear.status[row]}, patch.components)
        figure.suptitle(titled(result, "contact status over wear"), x=0.01, ha="left")
    return figure


def motion_maps(result: Result, rows: Sequence[int] | np.ndarray | None = None) -> Figure:
    """What the pairs of a worn contact do in a cycle at wear rows, the first, a middle and the last by default.

    Raises  Refusal where nothing was worn or the patch has no faces"""
    patch, wear = _worn(result)
    n = len(wear.cycles)
    rows = np.unique([0, (n - 1) // 2, n - 1]) if rows is None else rows
    basis = HarmonicBasis(result.harmonics, LAYOUT.samples)
    fields: list[Row] = [(colors, []) for colors in (MOTION_MAP, PRESSURE_MAP, WEAR_MAP)]
    for row in rows:
        x = wear.displacement[row].reshape(len(patch.area), -1, basis.n_coeff)
        slide, gap = slide_and_gap(patch.components, x, basis, patch.gap + wear.opening[row])
        for (_, line), name, values, unit_of in zip(
            fields,
            ("largest slide along the face", "largest gap", "friction work"),
            (slide, gap, wear.energy[row] / patch.area),
            (length_unit, length_unit, area_energy_unit),
            strict=True,
        ):
            unit, factor = unit_of(float(np.abs(values).max()))
            line.append((f"{name} / {unit}", factor * values))
    labels = [state_of(result, int(row)).label for row in rows]
    return _drawn(patch, fields, labels, titled(result, "contact over wear"))[0]


def slide_and_gap(
    components: Sequence[str], x: np.ndarray, basis: HarmonicBasis, gap: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What the pairs do in a cycle x (n_pair, n_component, n_coeff) [m], gap (n_pair,) [m].

    Returns the largest distance from the mean place along the face (n_pair,) [m], and the largest gap (n_pair,) [m],
    negative where the faces stay in touch, -inf where the contact has no normal component"""
    motion = basis.to_time(x)
    tangential = [c for c, name in enumerate(components) if name != "n"]
    slide = motion[:, tangential] - x[:, tangential, :1] * basis.has_static
    opening = np.full(len(x), -np.inf)
    if "n" in components:
        opening = gap - motion[:, list(components).index("n")].min(axis=1)
    return np.linalg.norm(slide, axis=1).max(axis=1), opening


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


def _drawn(patch: Patch, rows: Sequence[Row], titles: Sequence[str], title: str) -> tuple[Figure, np.ndarray]:
    """Rows of maps with a column for each title; a row "status" has no scale, but a legend below them all."""
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure, grid = _grid(patch, len(rows), len(titles))
        for line, (colors, fields) in zip(grid, rows, strict=True):
            for axes, (label, values) in zip(line, fields, strict=True):
                if colors == "status":
                    draw_status(axes, patch, values)
                    continue
                low, high = limits(values)
                draw_field(axes, patch, values, colors, high, low)
                scale_bar(figure, axes, colors, low, high, label)
        for axes, text in zip(grid[0], titles, strict=True):
            axes.set_title(text)
        _label_axes(grid, patch)
        present = {int(bits) for colors, row in rows if colors == "status" for _, values in row for bits in values}
        if present:
            status_legend(figure, present, patch.components)
        figure.suptitle(title, x=0.01, ha="left")
    return figure, grid


def _grid(patch: Patch, n_row: int, n_column: int) -> tuple[Figure, np.ndarray]:
    """A figure with axes (n_row, n_column) of the shape of a patch; the legend of all states fits below."""
    wide, tall = np.ptp(patch.flat, axis=0)
    aspect = float(np.clip(tall / max(wide, 1e-12), 0.25, 2.0))
    size = (max(3.1 * n_column + 0.4, LAYOUT.narrowest), n_row * (2.3 * aspect + 0.75) + 0.9)
    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(n_row, n_column, squeeze=False)


def _with_faces(result: Result) -> Patch:
    if not len(result.patch.faces):
        raise Refusal("the result holds no patch with faces to draw a map on")
    return result.patch


def _worn(result: Result) -> tuple[Patch, WearHistory]:
    patch, wear = _with_faces(result), result.wear
    if wear is None or not result.wear_steps:
        raise Refusal("the result holds no worn patch with faces to draw a map on")
    return patch, wear


def _label_axes(grid: np.ndarray, patch: Patch) -> None:
    """Ticks and labels of the axes (n_row, n_column) of maps of one face."""
    names = [name for name in ("t1", "t2") if name in patch.components] or ["t1", "t2"]
    for axes in grid.ravel():
        axes.locator_params(nbins=5)
        axes.label_outer(remove_inner_ticks=False)
    for axes in grid[-1]:
        axes.set_xlabel(f"{names[0]} / mm")
    for axes in grid[:, 0]:
        axes.set_ylabel(f"{names[-1]} / mm")


def _name_contacts(columns: np.ndarray, result: Result) -> None:
    """Names of the contacts beside their faces, where several are drawn one above the other."""
    patch, joints = result.patch, result.facts.joints
    if len(joints) < 2 or patch.in_one_plane:
        return
    height = 1e3 * patch.flat[:, 1]
    for axes in columns:
        middles = [(height[pairs].min() + height[pairs].max()) / 2 for pairs in joints.values()]
        axes.set_yticks(middles, [name.replace("_", " ") for name in joints])
        axes.set_ylabel("")


def limits(values: np.ndarray) -> tuple[float, float]:
    """Lowest and highest value, from zero where the values spread over half of their size."""
    low, high = float(values.min()), float(values.max())
    return (0.0 if 0 < low < 0.5 * high else low), high
