"""The distribution of a number with its quantiles and their confidence, and what it depends on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from scipy import stats

from tribodyn.workflows.pictures.figures import axes_of
from tribodyn.workflows.pictures.style import BLUE, GREY, ORANGE, RED
from tribodyn.workflows.studies.many.pictures import SHOWN

if TYPE_CHECKING:
    from tribodyn.workflows.studies.many.lives import Lives

TICKS = (1e-5, 1e-4, 1e-3, 0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99)


def picture(found: Lives) -> Figure:
    """The share of the parts below a value, on normal probability paper, and Sobol indices as bars."""
    with axes_of(10.0, 4.4, columns=2, share=False) as (figure, (left, right)):
        below = np.cumsum(found.weights) - 0.5 * found.weights
        lowest = min(0.5 * min(q.share for q in found.quantiles), 0.01)
        shown = (below > lowest) & (below < 1 - min(lowest, 0.005))
        left.plot(found.values[shown], stats.norm.ppf(below[shown]), color=BLUE, label="surrogate")
        columns = found.table.columns[found.number].astype(float)
        good = np.sort(columns[np.isfinite(columns)])
        for i, q in enumerate(found.quantiles):
            at = stats.norm.ppf(q.share)
            if found.model_error:
                said = "with the model's own error" if i == 0 else None
                left.plot([q.low_in_all, q.high_in_all], [at, at], color=ORANGE, lw=5, alpha=0.45, label=said)
            sure = f"{100 * found.confidence:g} % sure" if i == 0 else None
            left.plot([max(q.low, good[0] * 0.1), q.high], [at, at], color=RED, lw=2, marker="|", ms=9, label=sure)
            left.annotate(f"{q.name} {q.value:.3g}", (q.value, at), (6, -11), textcoords="offset points", fontsize=9)
        ticks = [tick for tick in TICKS if lowest <= tick <= 1 - lowest]
        left.set_yticks(stats.norm.ppf(ticks), [f"{100 * tick:g} %" for tick in ticks])
        if found.logarithmic:
            left.set_xscale("log")
            left.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            left.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            left.xaxis.set_minor_formatter(NullFormatter())
        left.set(xlabel=SHOWN.get(found.number, found.number), ylabel="share of the parts below")
        left.set_title(f"{found.name}: {found.runs} runs")
        left.legend(loc="upper left", fontsize=9)
        order = found.influences[::-1]
        height = np.arange(len(order))
        right.barh(height + 0.19, [one.first for one in order], 0.36, color=BLUE, label="first")
        right.barh(height - 0.19, [one.total for one in order], 0.36, color=GREY, label="total")
        right.set_yticks(height, [one.key for one in order], fontsize=9)
        right.set(xlabel="Sobol index", xlim=(0, 1))
        right.set_title("share of the variance")
        right.legend(loc="lower right", fontsize=9)
    return figure
