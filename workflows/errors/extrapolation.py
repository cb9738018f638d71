"""Where the answers of a parameter tend to as it gets finer, and how much of that is doubtful."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

ORDERS = (0.5, 4.0)  # slower is not taken for settling; faster is not relied on
SAFETY = 0.25  # of the extrapolated remainder that stays in doubt (Roache: a factor of 1.25 on three grids)
SMALLEST = 1e-3  # size of a setting that leaves all out
ROUNDING = 1e-9  # relative difference that means nothing


@dataclass(frozen=True)
class Limit:
    """Where values tend to.

    order : observed, nan where they do not settle monotonically or are too few
    doubt : how far off the limit itself may be, relative to it
    """

    value: float
    order: float
    doubt: float


def limit_of(size: Sequence[float], value: Sequence[float]) -> Limit:
    """The limit of values whose error falls with a power of the size, judged by the three finest sizes.

    size : rising, nan at the end where that setting is exact; equal ones are other placements of the same nodes, of
        which the first counts
    value : the last one not 0
    Three that settle monotonically are extrapolated with their observed order, if the last step is above the scatter of
    the finest size with several placements. Three that alternate and come closer have their limit between the last two.
    Else the last one stands, with the spread of all values on the three as its doubt. Two are taken to be of first
    order; one says nothing about itself, which is an infinite doubt.
    Source  Roache, J. Fluids Eng. 116, 1994
    """
    last = value[-1]
    if not np.isfinite(size[-1]):
        return Limit(last, float("nan"), 0.0)
    groups = [[v for s, v in zip(size, value, strict=True) if s == group_size] for group_size in dict.fromkeys(size)][
        -3:
    ]
    scatter = next((float(np.ptp(group)) for group in reversed(groups) if len(group) > 1), 0.0)
    v = np.array([group[0] for group in groups])
    last = float(v[-1])
    if len(v) == 1:
        return Limit(last, float("nan"), float("inf"))
    h = 1 / np.maximum(list(dict.fromkeys(size))[-3:], SMALLEST)
    steps = np.diff(v)
    is_constant = np.abs(steps) <= ROUNDING * abs(last)
    if is_constant[-1] and (is_constant.all() or len(v) == 3) and not scatter:
        return Limit(last, float("nan"), float(abs(steps[-1] / last)))
    if len(v) == 2:
        return Limit(last, float("nan"), float(abs(steps[0] / last) * h[1] / (h[0] - h[1])))
    if abs(steps[1]) > scatter:
        ratio = steps[0] / steps[1]
        if ratio > 0 and (order := _order(h, ratio)) >= ORDERS[0]:
            p = min(order, ORDERS[1])
            remainder = steps[1] * h[2] ** p / (h[1] ** p - h[2] ** p)
            return Limit(float(last + remainder), order, float(SAFETY * abs(remainder / (last + remainder))))
        if ratio < -1:
            return Limit(last, float("nan"), float(abs(steps[1] / last)))
    return Limit(last, float("nan"), float(np.ptp(np.concatenate(groups)) / abs(last)))


def _order(h: np.ndarray, ratio: float) -> float:
    """p with (h0^p - h1^p) / (h1^p - h2^p) = ratio, nan below 0.01."""
    low, high = 0.01, 60.0

    def excess(p: float) -> float:
        # in powers of h0, so that fine tolerances do not underflow
        a, b = (h[1] / h[0]) ** p, (h[2] / h[0]) ** p
        return float((1 - a) / max(a - b, 1e-300) - ratio)

    if excess(low) > 0:
        return float("nan")
    return high if excess(high) < 0 else float(brentq(excess, low, high, xtol=1e-14))
