"""The length of wear steps from an estimate of their own error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

STEP_RATIO_LIMITS = (0.2, 3.0)  # limits of the ratio of one step to the one before


@dataclass(frozen=True)
class Tolerance:
    """share : local error allowed per step, of the depth scale and of the cycles passed; scale : depth scale [m]."""

    share: float
    scale: float


def local_error(
    tolerance: Tolerance, area: np.ndarray, deviation: np.ndarray, rate: np.ndarray, stride: float, cycles: float
) -> float:
    """Local error over the tolerance: of the deepest deviation, and of the cycles that its volume takes behind it.

    Where wear fades both solutions of a step may wear the same volume while most of a life is still to come, at the
    rate that is left: so that rate counts, and the pairs without their sign. No more than the step's cycles are wrong.
    deviation : (n_pair,) of a step from its companion of lower order [m]; rate : (n_pair,) behind it [m/cycle]
    area : (n_pair,) [m2]; stride : cycles of the step; cycles : passed at its end
    """
    on_depth = np.abs(deviation).max() / tolerance.scale
    wrong, left = float(area @ np.abs(deviation)), float(area @ rate)
    on_life = (wrong / left if wrong < stride * left else stride * (wrong > 0)) / cycles
    return float(max(on_depth, on_life) / tolerance.share)


def growth(error: float) -> float:
    """Ratio of the next step to this one by the second order of the error, with a margin."""
    return float(np.clip(0.85 / np.sqrt(max(error, 1e-10)), *STEP_RATIO_LIMITS))
