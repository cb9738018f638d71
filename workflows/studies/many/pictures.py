"""A study as a picture: what was computed against each key, and the best designs with their trade."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tribodyn.workflows.pictures.figures import axes_of
from tribodyn.workflows.pictures.style import BLUE, GREY, INK, ORANGE, STYLE
from tribodyn.workflows.studies.many.task import RUN

if TYPE_CHECKING:
    from tribodyn.workflows.studies.many.optimum import Optimum
    from tribodyn.workflows.studies.many.table import StudyTable

WIDE_SCALE = 30.0  # largest over least value, from which on a scale is logarithmic
SHOWN = {
    "peak_hz_first": "peak / Hz",
    "peak_m_first": "amplitude / m",
    "depth_max_m": "depth / m",
    "life_cycles": "life / cycles",
}


def picture(found: Optimum) -> Figure:
    """The runs over the first two aims, or the one aim over the runs."""
    with axes_of(6.4, 4.4) as (figure, axes):
        (_trade if len(found.aims) > 1 else _progress)(found, axes)
    return figure


def _trade(found: Optimum, axes: Any) -> None:
    one, two = (aim.number for aim in found.aims[:2])
    x, y = (found.table.values_of(name)[0] for name in (one, two))
    runs = found.table.columns[RUN]
    dots = axes.scatter(x, y, 22, runs, cmap="Greys", edgecolors=GREY, vmin=0, zorder=2)
    axes.figure.colorbar(dots, ax=axes, label="run", pad=0.01, ticks=MaxNLocator(integer=True))
    front = list(found.front)
    axes.plot(x[front], y[front], "-o", color=BLUE, ms=6, lw=1.2, zorder=3, label="best trades")
    open_ = sorted({row for rows in found.only.values() for row in rows})
    if open_:
        axes.plot(x[open_], y[open_], "^", mfc="none", color=INK, ms=10, zorder=4, label="not lost by then: at least")
    axes.plot(x[found.best], y[found.best], "*", color=ORANGE, ms=17, zorder=5, label="nearest to the best of both")
    for axis, values in ((axes.set_xscale, x), (axes.set_yscale, y)):
        if wide(values[np.isfinite(values)]):
            axis("log")
    axes.set(xlabel=_label(found, 0), ylabel=_label(found, 1), title=f"{found.name}: {len(x)} runs")
    axes.legend(fontsize=8, frameon=True)


def _progress(found: Optimum, axes: Any) -> None:
    aim = found.aims[0]
    values = found.table.values_of(aim.number)[0]
    runs = found.table.columns[RUN]
    axes.plot(runs, values, "o", color=GREY, ms=4, label="runs")
    axes.plot(runs[found.best], values[found.best], "*", color=ORANGE, ms=17, label="best that keeps the limits")
    if wide(values[np.isfinite(values)]):
        axes.set_yscale("log")
    axes.set(xlabel="run", ylabel=_label(found, 0), title=f"{found.name}: {len(values)} runs")
    axes.legend(fontsize=8, frameon=True)


def _label(found: Optimum, at: int) -> str:
    aim = found.aims[at]
    return f"{SHOWN.get(aim.number, aim.number)}, wanted {aim.want}"


def shown(found: StudyTable) -> dict[str, str]:
    """Columns that a run has a number in, with their labels; empty where there is nothing to draw."""
    columns = found.columns
    return {name: label for name, label in SHOWN.items() if name in columns and np.isfinite(columns[name]).any()}


def panes(found: StudyTable) -> Figure:
    """Peak, amplitude, depth and life, as far as there are any, against the keys; rank correlation in each title."""
    if not (there := shown(found)):
        raise ValueError(f"{found.name}: no run has a peak, a depth or a life, there is nothing to draw")
    influence = found.influence()
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(3.4 * len(found.varied) + 0.8, 2.6 * len(there) + 0.3), layout="constrained")
        panes = figure.subplots(len(there), len(found.varied), squeeze=False, sharey="row", sharex="col")
        for line, (name, label) in zip(panes, there.items(), strict=True):
            for pane, key in zip(line, found.varied, strict=True):
                values = found.columns[key]
                where = values if values.dtype.kind == "f" else values.astype(str)
                good = np.isfinite(found.columns[name])
                pane.plot(where[good], found.columns[name][good], "o", color=BLUE, markersize=4, alpha=0.7)
                rank = influence.get(name, {}).get(key)
                if rank is not None:
                    pane.set_title(f"rank correlation {rank:+.2f}", fontsize=9, color=INK)
            line[0].set_ylabel(label)
        for pane, key in zip(panes[-1], found.varied, strict=True):
            pane.set_xlabel(key, fontsize=9)
    return figure


def wide(values: np.ndarray) -> bool:
    """Whether values spread so far that their logarithms are shown."""
    return bool(values.min() > 0 and values.max() > WIDE_SCALE * values.min())
