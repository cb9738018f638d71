"""Samples of a posterior: a histogram of every number, and every pair of them."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tribodyn.workflows.pictures.style import BLUE, INK, RED, STYLE
from tribodyn.workflows.studies.fits.posterior import Posterior, Summary

POINTS = 1000  # that are drawn


def picture(found: Posterior) -> Figure:
    """The parameters and the numbers that follow from them; red: medians and the ends of their central 90 %."""
    told = found.summaries()
    columns = np.column_stack([found.samples, *found.predicted.values()])
    n = len(told)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(2.3 * n + 0.8, 2.1 * n + 0.5), layout="constrained")
        panes = figure.subplots(n, n, squeeze=False, sharex="col")
        for i in range(n):
            for j in range(n):
                pane = panes[i, j]
                if j > i:
                    pane.set_axis_off()
                    continue
                if i == j:
                    pane.hist(columns[:, i], bins=40, color=BLUE, alpha=0.7)
                    for end in (told[i].low, told[i].median, told[i].high):
                        pane.axvline(end, color=RED, lw=1)
                    pane.set_yticks([])
                    pane.set_title(told[i].name, fontsize=9, color=INK)
                else:
                    shown = columns[:: max(len(columns) // POINTS, 1)]
                    pane.plot(shown[:, j], shown[:, i], ".", color=BLUE, ms=2, alpha=0.4)
                    if j == 0:
                        pane.set_ylabel(_label(told[i]), fontsize=8)
                pane.xaxis.set_major_locator(MaxNLocator(3))
                pane.tick_params(labelsize=7)
        for j, pane in enumerate(panes[-1]):
            pane.set_xlabel(_label(told[j]), fontsize=8)
    return figure


def _label(one: Summary) -> str:
    return f"{one.name} / {one.unit}" if one.unit else one.name
