"""The distribution of a number over the runs of a study on Weibull paper, with the fitted Weibull distribution."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from scipy import stats

from tribodyn.workflows.pictures.figures import axes_of
from tribodyn.workflows.pictures.style import BLUE, GREY, INK, RED
from tribodyn.workflows.studies.many.pictures import SHOWN

if TYPE_CHECKING:
    from tribodyn.workflows.studies.many.table import StudyTable

FEWEST = 5  # values that a distribution is fitted to
TICKS = (0.01, 0.05, 0.1, 0.2, 0.5, 0.8, 0.9, 0.99)


def fitted(values: np.ndarray) -> Any:
    """Weibull distribution of most likelihood of some values (n,) above 0, of scipy."""
    shape, _, scale = stats.weibull_min.fit(values, floc=0)
    return stats.weibull_min(shape, scale=scale)


def ranks(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values in order, and the share that lies below each: median ranks (i - 0.3) / (n + 0.4) of Benard (1953)."""
    return np.sort(values), (np.arange(1, len(values) + 1) - 0.3) / (len(values) + 0.4)


def possible(found: StudyTable, number: str = "life_cycles") -> bool:
    """Whether enough runs have a number for its distribution to be drawn."""
    return number in found.computed and int(np.sum(np.asarray(found.columns[number], float) > 0)) >= FEWEST


def picture(found: StudyTable, number: str = "life_cycles") -> Figure:
    """Values of the complete runs against the share of runs below them.

    A distribution is fitted where all complete runs have a value: what did not wear out in its run has a longer life,
    so that leaving it out would make the lives too short.
    Raises  ValueError where the table has no such number, or fewer than FEWEST values above 0
    """
    if number not in found.computed:
        raise ValueError(f'{found.name} has no number "{number}": there are {", ".join(found.computed)}')
    column = np.asarray(found.columns[number], float)
    good = np.isfinite(column) & (column > 0)
    if good.sum() < FEWEST:
        raise ValueError(f"{found.name}: {good.sum()} runs have a {number}, a distribution needs {FEWEST}")
    values, share = ranks(column[good])
    done = found.count("complete")
    with axes_of(6.8, 4.6) as (figure, axes):
        axes.plot(values, _paper(share), "o", color=BLUE, ms=4, label=f"{len(values)} runs")
        if len(values) == done and np.ptp(values) > 0:
            law = fitted(values)
            line = np.array([0.3 * share[0], 1 - 0.3 * (1 - share[-1])])
            said = f"Weibull, shape {law.args[0]:.3g}, scale {law.kwds['scale']:.4g}"
            axes.plot(law.ppf(line), _paper(line), color=INK, lw=1.2, label=said)
            ten = float(law.ppf(0.1))
            axes.plot([ten, ten], [_paper(line[0]), _paper(0.1)], ":", color=RED, label=f"B10: {ten:.4g}")
        axes.set_xscale("log")
        axes.set_yticks(_paper(np.array(TICKS)), [f"{100 * tick:g} %" for tick in TICKS])
        axes.set_ylim(_paper(0.5 * share[0]), _paper(1 - 0.5 * (1 - share[-1])))
        without, lost = done - len(values), len(column) - done
        axes.set(xlabel=SHOWN.get(number, number), ylabel="share of the runs below")
        said = f"; {without} runs without, not fitted" if without else ""
        said += f"; {lost} of {len(column)} runs not complete" if lost else ""
        axes.set_title(f"{found.name}: distribution{said}")
        axes.legend(loc="upper left", fontsize=9)
        axes.axhline(_paper(0.5), color=GREY, lw=0.6)
    return figure


def _paper(share: np.ndarray | float) -> np.ndarray:
    """The height on Weibull paper, on which a Weibull distribution is a straight line."""
    return np.log(-np.log1p(-np.asarray(share)))
