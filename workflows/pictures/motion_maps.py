"""Maps of what the pairs do in a cycle: how far they slide, how far they open, and where the friction work is."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.workflows.pictures.figures import length_unit, titled
from tribodyn.workflows.pictures.maps import colour_bar, draw_field, label_axes
from tribodyn.workflows.pictures.style import MOTION_MAP, PRESSURE_MAP, STYLE, WEAR_MAP
from tribodyn.workflows.result.result import Patch, Result
from tribodyn.workflows.result.states import state_of

SAMPLES = 256  # of a cycle, for results, which keep coefficients
Fields = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Largest slide [m], largest gap [m], friction work per cycle and area [J/m2], (n_pair,) each."""


def slide_and_gap(
    components: Sequence[str], x: np.ndarray, basis: HarmonicBasis, gap: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What the pairs do in a cycle x (n_pair, n_component, n_coeff) [m], gap (n_pair,) [m].

    Returns the largest distance from the mean place along the face (n_pair,) [m], and the largest gap (n_pair,) [m],
    negative where the faces stay in touch, -inf where the contact has no normal component
    """
    motion = basis.to_time(x)
    along = [c for c, name in enumerate(components) if name != "n"]
    slide = motion[:, along] - x[:, along, :1] * basis.has_static
    opening = np.full(len(x), -np.inf)
    if "n" in components:
        opening = gap - motion[:, list(components).index("n")].min(axis=1)
    return np.linalg.norm(slide, axis=1).max(axis=1), opening


def motion_maps(result: Result, rows: np.ndarray | None = None) -> Figure:
    """What the pairs of a worn contact do at wear rows, the first, the middle and the last by default."""
    patch, wear = result.patch, result.wear
    assert patch is not None
    assert wear is not None
    n = len(wear.cycles)
    rows = np.unique([0, (n - 1) // 2, n - 1]) if rows is None else rows
    basis = HarmonicBasis(result.harmonics, SAMPLES)
    columns = []
    for row in rows:
        x = wear.displacement[row].reshape(len(patch.area), -1, basis.n_coeff)
        slide, gap = slide_and_gap(patch.components, x, basis, patch.gap + wear.depth[row])
        columns.append((slide, gap, wear.energy[row] / patch.area))
    labels = [state_of(result, int(row)).label for row in rows]
    return draw(patch, columns, labels, titled(result, "contact over wear"))


def draw(patch: Patch, columns: Sequence[Fields], titles: Sequence[str], heading: str) -> Figure:
    """The fields of some states side by side."""
    aspect = float(np.clip(np.ptp(patch.flat[:, 1]) / max(np.ptp(patch.flat[:, 0]), 1e-12), 0.15, 2.0))
    rows = [("largest slide along the face", MOTION_MAP), ("largest gap", PRESSURE_MAP), ("friction work", WEAR_MAP)]
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        size = (3.1 * len(columns) + 0.4, len(rows) * (2.3 * aspect + 1.0) + 0.9)
        figure = Figure(figsize=size, layout="constrained")
        grid = figure.subplots(len(rows), len(columns), squeeze=False)
        for line, (name, colors) in enumerate(rows):
            for axes, values in zip(grid[line], columns, strict=True):
                _map(figure, axes, patch, values[line], name, colors)
        for axes, title in zip(grid[0], titles, strict=True):
            axes.set_title(title, fontsize=11)
        label_axes(grid, patch)
        figure.suptitle(heading, x=0.01, ha="left", fontsize=12)
    return figure


def _map(figure: Figure, axes: mpl.axes.Axes, patch: Patch, values: np.ndarray, name: str, colors: str) -> None:
    """One field with its own scale: lengths in the unit that suits them."""
    if name == "friction work":
        largest = float(values.max())
        small = [("J", 1.0), ("mJ", 1e3), ("µJ", 1e6), ("nJ", 1e9)]
        prefix, factor = next((one for one in small if one[1] * largest >= 0.5), small[-1] if largest > 0 else small[0])
        unit = f"{prefix}/m²"
    else:
        unit, factor = length_unit(float(np.abs(values).max()))
    shown = factor * values
    high, low = float(shown.max()), float(shown.min())
    colour_bar(figure, axes, draw_field(axes, patch, shown, colors, high, low), f"{name} / {unit}", high, low)
