"""The error of a wear step, which its length follows from, and that of a whole run, from its own history."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory

STEP_RATIO_LIMITS = (0.2, 3.0)  # limits of the ratio of one step to the one before
UNKNOWN = 0.5  # estimated relative error from which on a number of cycles is no statement


@dataclass(frozen=True)
class Tolerance:
    """share : local error allowed per step, of the depth scale and of the cycles given; scale : depth scale [m]."""

    share: float
    scale: float


def local_error(
    tolerance: Tolerance, area: np.ndarray, deviation: np.ndarray, rate: np.ndarray, stride: float, cycles: float
) -> float:
    """Local error over the tolerance: of the deepest deviation, and of the cycles that its volume takes behind it.

    Where wear fades both solutions of a step may wear the same volume while most of a life is still to come, at the
    rate that is left: so that rate counts, and the pairs without their sign. No more than the step's cycles are wrong.
    deviation : (n_pair,) of a step from its companion of lower order [m]; rate : (n_pair,) behind it [m/cycle]
    area : (n_pair,) [m2]; stride : cycles of the step; cycles : that its error is held to
    """
    on_depth = np.abs(deviation).max() / tolerance.scale
    wrong, left = float(area @ np.abs(deviation)), float(area @ rate)
    on_life = (wrong / left if wrong < stride * left else stride * (wrong > 0)) / cycles
    return float(max(on_depth, on_life) / tolerance.share)


def expected(tolerance: Tolerance, cycles: float | np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Cycles of a whole life that has come to depths (..., n_pair) [m] after `cycles`, at the mean rate so far.

    At a depth of the scale a contact is lost, or nearly so; as wear fades most lives are longer.
    """
    return np.asarray(cycles / np.minimum(depth.max(axis=-1) / tolerance.scale, 1.0))


def growth(error: float) -> float:
    """Ratio of the next step to this one by the second order of the error, with a margin."""
    return float(np.clip(0.85 / np.sqrt(max(error, 1e-10)), *STEP_RATIO_LIMITS))


@dataclass(frozen=True)
class StepError:
    """Estimated relative errors by the wear steps: of the cycles for the worn volume, and of the largest depth."""

    cycles: float
    depth: float


def step_error(history: WearHistory, tolerance: Tolerance | None = None) -> StepError:
    """Estimate for a whole run, up to where LIFE_SHARE of the preload is left.

    tolerance : of the error-controlled rule; None for steps at the rate of their beginning, as the thesis takes them

    A step of Z cycles at the rate of its beginning is off by half the change of the rate over the step. The changes of
    all pairs count without their sign: rates that go back and forth between neighbours are a sign of steps too long.
    The error-controlled rule has measured its own, see `local_error`: the root of the sum of squares, of depth too.
    """
    lost = np.flatnonzero(history.preload < LIFE_SHARE * history.preload[0])
    last = int(lost[0]) if len(lost) else len(history.cycles) - 1  # row where the counted steps end
    total = history.energy.sum(axis=1)
    taken = np.flatnonzero((history.cycles_in_step[:last] > 0) & (total[:last] > 0))
    if not len(taken):
        return StepError(0.0, 0.0)
    cycles = history.cycles_in_step[taken]
    if tolerance is not None:
        passed = history.cycles[taken] + cycles
        of = np.where(history.in_time[taken], expected(tolerance, passed, history.depth[taken + 1]), passed)
        off = float(tolerance.share * np.linalg.norm(history.step_error[taken] * of) / passed[-1])
        return StepError(off, off)
    before, after = history.energy[taken], history.energy[taken + 1]
    change = np.abs(after - before).sum(axis=1) / (total[taken] + total[taken + 1])
    share = before / total[taken, None]
    share_after = after / np.maximum(total[taken + 1, None], np.finfo(float).tiny)  # no work is shared behind the last
    work = history.work[taken].sum(axis=1)
    worn = work @ share
    shift = np.abs(work @ (share_after - share)) / 2
    return StepError(float(cycles @ change / cycles.sum()), float(shift.max() / worn.max()))
