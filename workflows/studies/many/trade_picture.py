"""The best designs as a picture: the trade between two aims, or how one got better."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tribodyn.workflows.pictures.figures import axes_of
from tribodyn.workflows.pictures.style import BLUE, GREY, INK, ORANGE
from tribodyn.workflows.studies.many.pictures import SHOWN, wide
from tribodyn.workflows.studies.many.table import RUN

if TYPE_CHECKING:
    from tribodyn.workflows.studies.many.optimum import Optimum


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
