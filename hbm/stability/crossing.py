"""Where between two points of a curve a growth rate passes zero: period doubling, Neimark-Sacker."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation import bordered
from tribodyn.hbm.continuation.bordered import Direction, Metric
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.newton import NewtonOptions

TRIALS = 12
ACCURACY = 1e-6  # of the share of the way between the points


def locate(
    path: Parameter,
    start: Direction,
    stop: Direction,
    growth: Callable[[HarmonicBalance, State], float],
    rates: tuple[float, float],
) -> tuple[float, float] | None:
    """The share of the way from start to stop at which the growth rate is zero, and the parameter there.

    start, stop : neighbouring points of the curve; growth : of a motion [1/s]; rates : it at both, of different sign
    Returns None where no motion is found between them
    Source  regula falsi, Illinois; each trial is solved in the hyperplane normal to the chord
    """
    chord = stop - start
    metric = Metric(float(np.linalg.norm(chord.x)) or 1.0, abs(chord.p) or 1.0)
    low, high, weights = (0.0, rates[0]), (1.0, rates[1]), [1.0, 1.0]
    share, value = 0.0, start.p
    for _ in range(TRIALS):
        a, b = weights[0] * low[1], weights[1] * high[1]
        share = low[0] + (high[0] - low[0]) * a / (a - b)
        solution, value = bordered.correct(path, start + chord * share, chord, metric, NewtonOptions())
        if not solution.converged:
            return None
        rate = growth(path.place(value)[0], solution.state)
        if rate * low[1] > 0:
            low, weights = (share, rate), [1.0, 0.5 * weights[1]]
        else:
            high, weights = (share, rate), [0.5 * weights[0], 1.0]
        near = abs(rate) <= ACCURACY * max(abs(rates[0]), abs(rates[1]))
        if near or high[0] - low[0] <= ACCURACY:
            break
    return share, value
