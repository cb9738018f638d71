"""Error-controlled wear steps, stable for the stiff coupling of pressure and depth.

dw/dZ = r(w) relaxes a pressure peak thousands of times faster than the contact as a whole wears: explicit steps must
resolve the former or oscillate from node to node. Steps along the balance are implicit (balance_step), those in time
linearly implicit (marched_step); a companion of lower order gives the error that their length follows."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from tribodyn.declarations import number
from tribodyn.hbm.outcome import WearEnd
from tribodyn.hbm.time.stepper import IntegrationFailed
from tribodyn.hbm.wear import harmonic_fallback
from tribodyn.hbm.wear.balance_step import balance_step
from tribodyn.hbm.wear.history import StepScheme, WearHistory, WearRow
from tribodyn.hbm.wear.marched_step import marched_step
from tribodyn.hbm.wear.steady_motion import SteadyMotion, with_growth
from tribodyn.hbm.wear.step_control import StepError, Tolerance, measured_error
from tribodyn.hbm.wear.step_memory import StepMemory, predicted_cycles
from tribodyn.hbm.wear.wear_problem import WearProblem, WearState
from tribodyn.hbm.wear.wear_rows import row_of
from tribodyn.hbm.wear.wear_rule import RuleSettings, StepCost, WearRule, WearStep

# of the first preload, where a run ends at the latest: below it the last touch is noise of Newton's tolerance
LEAST_PRELOAD_SHARE = 1e-4


@dataclass(frozen=True)
class Parameters:
    tolerance: float = number("", role="accuracy", above=0.0)
    "Error that one step may make, relative: of the depth scale, and of the cycles of a life."


class Rule(WearRule):
    """tolerance : of the error of one step, on depth and on life.

    motion : along which it wears: "balance"; "machine", followed in time where it leaves the unstable motion of the
        balance, see hbm.wear.steady_motion; or "time" everywhere
    with_growth : whether rows have the growth of perturbations; "machine" depends on it, nothing else does
    `step_error` of a row is its estimate over the tolerance. The last touch of a vibrating contact does not end in
    finite time: LEAST_PRELOAD_SHARE ends the run where `lost_below` does not.
    Raises  Refusal where the wear law wears pairs that do no friction work"""

    SCHEME = StepScheme.IMPLICIT
    COST = StepCost(23, 0.05, -0.4, 40)  # it searches for higher peaks

    def __init__(self, problem: WearProblem, tolerance: Tolerance, motion: str = "balance", with_growth: bool = True):
        super().__init__(replace(problem, lost_below=max(problem.lost_below, LEAST_PRELOAD_SHARE)))
        self._tolerance = tolerance
        self._has_growth = motion == "machine" or (with_growth and motion == "balance")
        self._motion = None if motion == "balance" else SteadyMotion(self.problem, tolerance, motion == "time")

    @classmethod
    def build(cls, problem: WearProblem, settings: RuleSettings) -> Self:
        return cls(problem, _tolerance(settings), settings.motion, settings.with_growth)

    @property
    def least_depth(self) -> float:
        return self._tolerance.share * self._tolerance.scale

    def observe(self, state: WearState, rows: Sequence[WearRow]) -> WearState:
        if self._has_growth:
            state = with_growth(self.problem, state, always=self._motion is not None)
        return state if self._motion is None else self._motion.follow(state, predicted_cycles(rows))

    def restore(self, state: WearState, row: WearRow, rows: Sequence[WearRow]) -> WearState:
        if self._motion is None:
            return state
        self._motion.restore(row)
        return self._motion.follow(state, predicted_cycles(rows))

    def step(self, state: WearState, rows: Sequence[WearRow]) -> WearStep:
        if self._motion is None or state.means is None:
            return balance_step(self.problem, self._tolerance, state, rows)
        try:
            return marched_step(self.problem, self._motion, self._tolerance, state, rows)
        except IntegrationFailed as failure:
            return WearStep(self.last_row(state), lambda: state, WearEnd.SOLVE_FAILED.say(f" in time: {failure}"))

    def last_row(self, state: WearState) -> WearRow:
        return row_of(self.problem, state, memory=StepMemory.empty(len(state.points)).arrays())

    def remarks(self, history: WearHistory) -> str:
        jumps = "".join(
            f"; the response jumped from {history.frequency[i]:.5g} to {history.frequency[i + 1]:.5g} Hz "
            f"at {history.cycles[i + 1]:.3g} cycles"
            for i in history.jumps
        )
        in_time = ""
        if history.in_time.any():
            share = history.cycles_in_step[history.in_time].sum() / (history.cycles_in_step.sum() or 1.0)
            start = history.cycles[history.in_time.argmax()]
            in_time = f"; the motion was followed in time for {share:.0%} of the cycles, from {start:.3g} cycles on"
        return jumps + in_time + harmonic_fallback.remark(self.problem.balance.basis, history.rows())

    @classmethod
    def error(cls, history: WearHistory, settings: RuleSettings) -> StepError:
        return measured_error(history, _tolerance(settings))


def _tolerance(settings: RuleSettings) -> Tolerance:
    return Tolerance(settings.numbers["tolerance"], settings.scale)
