"""The error of a wear step, from which its length follows, and that of a whole run, from its history."""

from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory

STEP_RATIO_LIMITS = (0.2, 3.0)  # limits of the ratio of one step to the one before


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
    area : (n_pair,) [m2]; stride : cycles of the step; cycles : that its error is held to"""
    on_depth = np.abs(deviation).max() / tolerance.scale
    volume_error, volume_rate = float(area @ np.abs(deviation)), float(area @ rate)
    is_short = volume_error < stride * volume_rate
    on_life = (volume_error / volume_rate if is_short else stride * (volume_error > 0)) / cycles
    return float(max(on_depth, on_life) / tolerance.share)


def expected_life(tolerance: Tolerance, cycles: float | np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Cycles of a whole life that has come to depths (..., n_pair) [m] after `cycles`, at the mean rate so far.

    At a depth of the scale a contact is lost, or nearly so; as wear fades most lives are longer."""
    return np.asarray(cycles / np.minimum(depth.max(axis=-1) / tolerance.scale, 1.0))


def growth(error: float) -> float:
    """Ratio of the next step to this one by the second order of the error, with a margin."""
    return float(np.clip(0.85 / np.sqrt(max(error, 1e-10)), *STEP_RATIO_LIMITS))


@dataclass(frozen=True)
class StepError:
    """Estimated relative errors by the wear steps: of the cycles for the worn volume, and of the largest depth."""

    cycles: float
    depth: float


def accepted_steps(history: WearHistory) -> np.ndarray:
    """Rows whose steps count in the error of a run: those that wear, up to where LIFE_SHARE of the preload is left."""
    lost = np.flatnonzero(history.preload < LIFE_SHARE * history.preload[0])
    last = int(lost[0]) if len(lost) else len(history.cycles) - 1  # row where the counted steps end
    total = history.energy.sum(axis=1)
    return np.flatnonzero((history.cycles_in_step[:last] > 0) & (total[:last] > 0))


def first_order_error(history: WearHistory) -> StepError:
    """Estimate for a run of explicit steps.

    A step of Z cycles at the rate of its beginning is off by half the change of the rate over the step. The changes of
    all pairs count without their sign: rates that oscillate between neighbours are a sign of steps too long."""
    steps = accepted_steps(history)
    if not len(steps):
        return StepError(0.0, 0.0)
    total, cycles = history.energy.sum(axis=1), history.cycles_in_step[steps]
    energy, energy_after = history.energy[steps], history.energy[steps + 1]
    change = np.abs(energy_after - energy).sum(axis=1) / (total[steps] + total[steps + 1])
    share = energy / total[steps, None]
    share_after = energy_after / np.maximum(total[steps + 1, None], np.finfo(float).tiny)  # the last one has no work
    work = history.work[steps].sum(axis=1)
    worn = work @ share
    shift = np.abs(work @ (share_after - share)) / 2
    return StepError(float(cycles @ change / cycles.sum()), float(shift.max() / worn.max()))


def measured_error(history: WearHistory, tolerance: Tolerance) -> StepError:
    """Estimate for a run whose steps measured their errors, see `local_error`: the root of the sum of squares."""
    steps = accepted_steps(history)
    if not len(steps):
        return StepError(0.0, 0.0)
    cycles = history.cycles[steps] + history.cycles_in_step[steps]
    reference = np.where(history.in_time[steps], expected_life(tolerance, cycles, history.depth[steps + 1]), cycles)
    error = float(tolerance.share * np.linalg.norm(history.step_error[steps] * reference) / cycles[-1])
    return StepError(error, error)
