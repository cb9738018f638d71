"""Sobol indices of what a study computed, as bars, from a Gaussian process through its runs."""

from __future__ import annotations

import importlib.util

import numpy as np
from matplotlib.figure import Figure

from tribodyn.workflows.pictures.figures import axes_of
from tribodyn.workflows.pictures.style import BLUE, GREY
from tribodyn.workflows.studies.many.picture import SHOWN
from tribodyn.workflows.studies.many.sensitivity import Influence, influences
from tribodyn.workflows.studies.many.space import Space
from tribodyn.workflows.studies.many.surrogate import Surrogate
from tribodyn.workflows.studies.many.table import StudyTable

FEWEST = 16  # runs with a number
MOST = 200  # runs that a surrogate is fitted to, spread over the table


def indices(space: Space, found: StudyTable) -> dict[str, tuple[float, tuple[Influence, ...]]]:
    """Number -> share of its variance that the surrogate explains where runs are left out, and its influences.

    Of peak, amplitude, depth and life, as far as FEWEST runs have one that varies; logarithms where all are above 0.
    Empty without scikit-learn
    """
    told: dict[str, tuple[float, tuple[Influence, ...]]] = {}
    if importlib.util.find_spec("sklearn") is None:
        return told
    points = space.coordinates(space.points_of(found.columns))
    for name in SHOWN:
        values = np.asarray(found.columns.get(name, np.full(len(points), np.nan)), float)
        good = np.flatnonzero(np.isfinite(values))
        if len(good) < FEWEST or np.ptp(values[good]) == 0:
            continue
        good = good[:: -(-len(good) // MOST)]
        own = values[good]
        surrogate = Surrogate.fitted(points[good], np.log(own) if (own > 0).all() else own)
        told[name] = surrogate.explained, influences(space, surrogate.mean)
    return told


def picture(name: str, told: dict[str, tuple[float, tuple[Influence, ...]]]) -> Figure:
    """First and total indices of every number."""
    keys = sorted({one.key for _, found in told.values() for one in found})
    height = np.arange(len(keys))
    with axes_of(1.2 + 3.4 * len(told), 1.6 + 0.5 * len(keys), columns=len(told), share=False) as (figure, axes):
        for at, (pane, (number, (explained, found))) in enumerate(zip(np.atleast_1d(axes), told.items(), strict=True)):
            by_key = {one.key: one for one in found}
            pane.barh(height + 0.19, [by_key[key].first for key in keys], 0.36, color=BLUE, label="first")
            pane.barh(height - 0.19, [by_key[key].total for key in keys], 0.36, color=GREY, label="total")
            pane.set_yticks(height, keys if at == 0 else [""] * len(keys), fontsize=9)
            pane.set(xlim=(0, 1), xlabel="Sobol index")
            pane.set_title(f"{SHOWN[number].split(' / ')[0]}, {100 * explained:.1f} % explained", fontsize=10)
        pane.legend(loc="lower right", fontsize=8)
        figure.suptitle(f"{name}: shares of the variance", x=0.01, ha="left", fontsize=12)
    return figure
