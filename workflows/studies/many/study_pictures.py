"""A study as a picture: what was computed against each key, the best designs, the distribution of a number."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats

from tribodyn.hbm.quantity import StatedQuantity, names_with_error, quantities_of
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import axes_of, log_axis, positive_range
from tribodyn.workflows.pictures.matplotlib_names import Figure, MaxNLocator, mpl
from tribodyn.workflows.pictures.theme import BLUE, GREY, INK, ORANGE, RED, STYLE
from tribodyn.workflows.studies.many.run_task import RUN

if TYPE_CHECKING:
    from tribodyn.workflows.studies.many.lives import LifeDistribution
    from tribodyn.workflows.studies.many.optimum import Optimum
    from tribodyn.workflows.studies.many.study_table import StudyTable

WIDE_SCALE = 30.0  # largest over least value, from which on a scale is logarithmic
TICKS = (1e-5, 1e-4, 1e-3, 0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99)


def picture(optimum: Optimum) -> Figure:
    """The runs over the first two aims, or the one aim over the runs."""
    with axes_of(6.4, 4.4) as (figure, axes):
        (_trade if len(optimum.aims) > 1 else _progress)(optimum, axes)
    return figure


def _trade(optimum: Optimum, axes: Any) -> None:
    first, second = (aim.number for aim in optimum.aims[:2])
    x, y = (optimum.table.values_of(name)[0] for name in (first, second))
    runs = optimum.table.columns[RUN]
    dots = axes.scatter(x, y, 22, runs, cmap="Greys", edgecolors=GREY, vmin=0, zorder=2)
    axes.figure.colorbar(dots, ax=axes, label="run", pad=0.01, ticks=MaxNLocator(integer=True))
    front = list(optimum.front)
    axes.plot(x[front], y[front], "-o", color=BLUE, ms=6, lw=1.2, zorder=3, label="best trades")
    open_ = sorted({row for rows in optimum.bounded.values() for row in rows})
    if open_:
        axes.plot(x[open_], y[open_], "^", mfc="none", color=INK, ms=10, zorder=4, label="not lost by then: at least")
    axes.plot(x[optimum.best], y[optimum.best], "*", color=ORANGE, ms=17, zorder=5, label="nearest to the best of both")
    for axis, values in ((axes.set_xscale, x), (axes.set_yscale, y)):
        if wide(values[np.isfinite(values)]):
            axis("log")
    axes.set(xlabel=_label(optimum, 0), ylabel=_label(optimum, 1), title=f"{optimum.name}: {len(x)} runs")
    axes.legend(fontsize=8, frameon=True)


def _progress(optimum: Optimum, axes: Any) -> None:
    aim = optimum.aims[0]
    values = optimum.table.values_of(aim.number)[0]
    runs = optimum.table.columns[RUN]
    axes.plot(runs, values, "o", color=GREY, ms=4, label="runs")
    axes.plot(runs[optimum.best], values[optimum.best], "*", color=ORANGE, ms=17, label="best that keeps the limits")
    if wide(values[np.isfinite(values)]):
        axes.set_yscale("log")
    axes.set(xlabel="run", ylabel=_label(optimum, 0), title=f"{optimum.name}: {len(values)} runs")
    axes.legend(fontsize=8, frameon=True)


def _label(optimum: Optimum, at: int) -> str:
    aim = optimum.aims[at]
    return f"{_axis_label(aim.number)}, wanted {aim.want}"


def _axis_label(column: str) -> str:
    """A column that is a quantity by its label and unit, another one by its name."""
    quantity = next((q for q in quantities_of(StatedQuantity) if column in (q.name, f"{q.name}_first")), None)
    return column if quantity is None else f"{quantity.label} / {quantity.unit}"


def shown(study: StudyTable) -> dict[str, str]:
    """Columns that a run has a number in, with their labels; empty where there is nothing to draw."""
    columns = study.columns
    names = [name for q in names_with_error() for name in (q, f"{q}_first") if name in columns]
    return {name: _axis_label(name) for name in names if np.isfinite(columns[name]).any()}


def panes(study: StudyTable) -> Figure:
    """Quantities with a stated error, as far as there are any, against the keys; rank correlation in each title."""
    if not (labels := shown(study)):
        raise Refusal(f"{study.name}: no run has a number to draw")
    influence = study.influence()
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(3.4 * len(study.varied) + 0.8, 2.6 * len(labels) + 0.3), layout="constrained")
        panes = figure.subplots(len(labels), len(study.varied), squeeze=False, sharey="row", sharex="col")
        for line, (name, label) in zip(panes, labels.items(), strict=True):
            for pane, key in zip(line, study.varied, strict=True):
                values = study.columns[key]
                where = values if values.dtype.kind == "f" else values.astype(str)
                good = np.isfinite(study.columns[name])
                pane.plot(where[good], study.columns[name][good], "o", color=BLUE, markersize=4, alpha=0.7)
                rank = influence.get(name, {}).get(key)
                if rank is not None:
                    pane.set_title(f"rank correlation {rank:+.2f}", fontsize=9, color=INK)
            line[0].set_ylabel(label)
        for pane, key in zip(panes[-1], study.varied, strict=True):
            pane.set_xlabel(key, fontsize=9)
    return figure


def wide(values: np.ndarray) -> bool:
    """Whether values spread so far that their logarithms are shown."""
    return bool(values.min() > 0 and values.max() > WIDE_SCALE * values.min())


def picture_of_lives(distribution: LifeDistribution) -> Figure:
    """The share of the parts below a value, on normal probability paper, and Sobol indices as bars."""
    with axes_of(10.0, 4.4, columns=2, share=False) as (figure, (paper, index_axes)):
        share_below = np.cumsum(distribution.weights) - 0.5 * distribution.weights
        lowest = min(0.5 * min(q.share for q in distribution.quantiles), 0.01)
        shown = (share_below > lowest) & (share_below < 1 - min(lowest, 0.005))
        paper.plot(distribution.values[shown], stats.norm.ppf(share_below[shown]), color=BLUE, label="surrogate")
        columns = distribution.table.columns[distribution.number].astype(float)
        good = np.sort(columns[np.isfinite(columns)])
        for i, q in enumerate(distribution.quantiles):
            at = stats.norm.ppf(q.share)
            if distribution.model_error:
                error_label = "with the model's own error" if i == 0 else None
                paper.plot([q.low_in_all, q.high_in_all], [at, at], color=ORANGE, lw=5, alpha=0.45, label=error_label)
            sure = f"{100 * distribution.confidence:g} % sure" if i == 0 else None
            paper.plot([max(q.low, good[0] * 0.1), q.high], [at, at], color=RED, lw=2, marker="|", ms=9, label=sure)
            paper.annotate(f"{q.name} {q.value:.3g}", (q.value, at), (6, -11), textcoords="offset points", fontsize=9)
        ticks = [tick for tick in TICKS if lowest <= tick <= 1 - lowest]
        paper.set_yticks(stats.norm.ppf(ticks), [f"{100 * tick:g} %" for tick in ticks])
        if distribution.logarithmic:
            log_axis(paper.xaxis, *positive_range(distribution.values[shown]))
        paper.set(xlabel=_axis_label(distribution.number), ylabel="share of the parts below")
        paper.set_title(f"{distribution.name}: {distribution.runs} runs")
        paper.legend(loc="upper left", fontsize=9)
        order = distribution.influences[::-1]
        height = np.arange(len(order))
        index_axes.barh(height + 0.19, [influence.first for influence in order], 0.36, color=BLUE, label="first")
        index_axes.barh(height - 0.19, [influence.total for influence in order], 0.36, color=GREY, label="total")
        index_axes.set_yticks(height, [influence.key for influence in order], fontsize=9)
        index_axes.set(xlabel="Sobol index", xlim=(0, 1))
        index_axes.set_title("share of the variance")
        index_axes.legend(loc="lower right", fontsize=9)
    return figure
