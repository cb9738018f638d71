"""Steady states of the balance compared with integration in time, which follows them until they are stationary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.quantity import (
    CycleQuantity,
    ErrorKind,
    MotionInTime,
    SolvedCycle,
    WearQuantity,
    quantities_of,
    with_error,
)
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.mean_motion import Follower, MeanOptions
from tribodyn.hbm.time.stepper import Options as TimeOptions
from tribodyn.hbm.time.verify import energy_floor
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.errors import operating_states
from tribodyn.workflows.errors.operating_states import OperatingState, Values
from tribodyn.workflows.errors.refinement_limits import RefinementLimits
from tribodyn.workflows.errors.wear_values import values_of_result
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.verdict import MeasuredChange, Refinement, Status
from tribodyn.workflows.run import settings
from tribodyn.workflows.scene.scene_file import SceneFile

STEPS = 256  # per period at least: differences above a tenth of a per cent are seen
STEPS_PER_HARMONIC = 32
NEGLIGIBLE = 1e-12  # share of a work that counts as none


@dataclass(frozen=True)
class MotionDifference:
    """A state of the balance compared with the motion in time.

    cycles : of the state; balance, in_time : (n_pair,) friction work of either motion per period [J]
    differences : relative ones of the values of the balance, by quantity
    error : standard error of the whole work in time, relative; spread : standard deviation of the work of a period
    """

    cycles: float
    balance: np.ndarray
    in_time: np.ndarray
    differences: Values
    error: float
    spread: float

    def judge(self, quantity: str, error: float | None) -> tuple[Status | None, str]:
        """Why a quantity of the contact before wear is not reported, if it is not; error : of the balance, if known."""
        difference = self.differences.get(quantity, 0.0) + self.error
        if error is None or difference <= error:
            return None, ""
        status = Status.UNSTABLE if self.spread > 0 else Status.CONTRADICTED
        return status, f"of the contact before wear, by {difference:.1%}"


def is_checked(state: OperatingState, requested: bool | None, limits: RefinementLimits) -> bool:
    """Whether states are integrated in time; requested : by the scene, None: where the contact is small."""
    if requested is not None:
        return requested
    return state.balance.contact.stiffness.size <= limits.max_time_components


def changes_along_wear(
    file: SceneFile, balance: HarmonicBalance, result: Result, limits: RefinementLimits
) -> list[MeasuredChange]:
    """What the quantities of the wear of a result would change along motions in time.

    Those before wear, halfway through the life and near its end, but for rows that were worn in time. Each is compared
    with the balance with the harmonics of the combined refinement, so that none counts in both rows
    """
    wear = result.wear
    assert wear is not None
    text = "motions in time compared with those of the balance"
    rows = [row for row in (0, *operating_states.later_rows(result)) if not wear.in_time[row]]
    if not rows or values_of_result(result) is None:
        return []
    differences: tuple[float, float] | None = None
    try:
        states = [operating_states.worn_state(file, balance, result, row) for row in rows]
        refined = [operating_states.with_more_harmonics(state, state.refined_top(limits)) for state in states]
        differences = wear_differences([compare(state) for state in refined], result)
    except (Refusal, SolverFailure) as failure:  # a motion that is not stationary, a row that is not solved again
        text += f": {failure}"
    changes = []
    for quantity in with_error(WearQuantity):
        relative = None if differences is None else differences[quantity.error is not ErrorKind.DURATION]
        changes.append(MeasuredChange(Refinement.OTHER_MOTION, quantity.name, None, None, relative, text))
    return changes


def wear_differences(comparisons: Sequence[MotionDifference], result: Result) -> tuple[float, float]:
    """How far the work of motions in time changes durations and depths of a wear run, relative.

    A depth takes more / less cycles in the ratio of both works, so that a life is off by the mean over its cycles; a
    depth goes with the share of the work that the deepest pair has. A state stands for the rows nearest to it, wear in
    time needs none. So few do not show that they cancel: their amounts are taken.
    """
    wear = result.wear
    assert wear is not None
    counted = slice(0, max(operating_states.later_rows(result), default=0) + 1)
    cycles, deepest = wear.cycles_in_step[counted], int((wear.depth[-1] + wear.worn[-1]).argmax())
    distance = np.abs(np.subtract.outer(wear.cycles[counted] + cycles / 2, [c.cycles for c in comparisons]))
    works = [(float(c.balance.sum()), float(c.in_time.sum())) for c in comparisons]
    longer = np.array([b / max(t, NEGLIGIBLE * b) if b or t else 1.0 for b, t in works])  # 1 where both motions rest
    deeper = np.array([_share(c.in_time, deepest) / (_share(c.balance, deepest) or np.inf) for c in comparisons])
    chance = np.array([c.error for c in comparisons])
    nearest, by_balance = distance.argmin(axis=1), ~wear.in_time[counted]

    def mean_difference(weight: np.ndarray, ratio: np.ndarray) -> float:
        ratios = np.where(by_balance, ratio[nearest], 1.0)
        return float(weight @ np.abs(ratios - 1) / (weight @ ratios)) if weight @ ratios > 0 else 0.0

    scatter = float(cycles @ (by_balance * chance[nearest]) / (cycles.sum() or 1.0))
    return mean_difference(cycles, longer) + scatter, mean_difference(wear.worn[counted, deepest], deeper)


def _share(work: np.ndarray, pair: int) -> float:
    return float(work[pair] / work.sum()) if work.sum() > 0 else 0.0


def compare(state: OperatingState) -> MotionDifference:
    """Follow a state in time until it is stationary, a wave in all sectors.

    Raises  Refusal where the model has no equation in time; SolverFailure where the motion is not stationary
    """
    balance, solved = state.balance, state.point.state
    steps = max(STEPS, STEPS_PER_HARMONIC * balance.basis.harmonics[-1])
    follower = Follower(MeanOptions(steps))
    spanned, start = time_integration.in_time(balance, solved.omega, solved, TimeOptions(steps))
    assert start is not None
    follower.start(spanned, start)
    means = follower.mean(spanned, solved.omega, lambda motion: np.array([energy_floor(motion)]))
    if not means.is_stationary:
        raise SolverFailure(f"the motion is not stationary after {means.periods} periods")
    sectors = len(means.energy) // balance.contact.n_pair
    energy = means.energy.reshape(sectors, -1).mean(axis=0)
    motion = MotionInTime(means, sectors, energy, float(means.observed[0]) / sectors)
    cycle, differences = SolvedCycle.of(balance, solved, settings.OUTPUT), {}
    for quantity in quantities_of(CycleQuantity):
        value = quantity.value(cycle)
        if quantity.in_time is not None and value is not None:
            in_time, least = quantity.in_time(motion)
            size = max(abs(in_time), least)
            differences[quantity.name] = abs(value - in_time) / size if size > 0 else float(value != 0)
    work = np.maximum(balance.energy(solved), 0.0), np.maximum(energy, 0.0)
    return MotionDifference(state.cycles, *work, differences, means.error, means.spread)
