"""A wear step along the periodic motion of the balance: two implicit stages, fewer harmonics or an explicit step.

The stages are those of a second-order, L-stable, stiffly accurate Runge-Kutta step (sdirk_stages); a first-order
companion gives the error estimate. Where no solution with all harmonics follows, fewer are taken; where none follows
with fewer either, an explicit step gets over the end of the branch."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tribodyn.hbm.continuation.peak_refinement import NoPeak
from tribodyn.hbm.outcome import Outcome, WearEnd
from tribodyn.hbm.wear import harmonic_fallback
from tribodyn.hbm.wear.history import LARGEST_SHIFT, WearRow
from tribodyn.hbm.wear.sdirk_stages import GAMMA, FrequencySearch, initial_guess, solve_stages
from tribodyn.hbm.wear.step_control import STEP_RATIO_LIMITS, Tolerance, growth, local_error
from tribodyn.hbm.wear.step_events import RULES as EVENT_RULES, OvertakingEvent, PreloadEvent, cycles_to_loss_at_rest
from tribodyn.hbm.wear.step_memory import StepMemory, predicted_cycles
from tribodyn.hbm.wear.step_trial import NoSolution, StepTrial, accurate_step
from tribodyn.hbm.wear.wear_problem import WearProblem, WearState, assess, worn_state
from tribodyn.hbm.wear.wear_rows import row_of
from tribodyn.hbm.wear.wear_rule import WearStep


@dataclass(frozen=True)
class StepRules:
    """How the steps are placed; see docs/developers/ablations.md."""

    error_trend_power: float = 0.2  # power with which an error that grows from step to step holds the next one back
    # a peak that moves further than LARGEST_SHIFT is another one, unless it moves less than so many times as far as the
    # step before predicts
    unexpected: float = 4.0


RULES = StepRules()
# depths of explicit steps over the end of a branch, shares of the tolerance, tried in turn; the longest, 0.81, stays
# within the tolerance
EXPLICIT_STEPS = 0.01 * 3.0 ** np.arange(5)
SHIFTED = WearEnd.NO_STEP.say(f": the tracked peak moves by more than {LARGEST_SHIFT:.0%} in the shortest step")


def balance_step(
    full_problem: WearProblem, tolerance: Tolerance, state: WearState, rows: Sequence[WearRow]
) -> WearStep:
    """One accepted step from a state, with as many harmonics as a solution follows with.

    full_problem : with all harmonics, which rows have; each step tries more of them again"""
    problem, state = start_problem, start = harmonic_fallback.with_most_harmonics(full_problem, state)
    while isinstance(step := _implicit_step(problem, tolerance, state, rows, full_problem), NoSolution):
        start = replace(start, solves=step.solves)
        fewer = harmonic_fallback.with_fewer(problem)
        if fewer is None:
            problem = start_problem
            step = _explicit_step(full_problem, problem, start, tolerance, step.failure, rows)
            break
        problem, state = fewer, harmonic_fallback.converted(fewer, start)
    row, following = step.row, step.following()
    if problem is not full_problem:
        shown = harmonic_fallback.converted(full_problem, start if problem is start_problem else state)
        shown = replace(shown, solves=row.solves, preload_at_rest=row.preload_at_rest)
        row = row_of(full_problem, shown, row.cycles_in_step, row.worn, row.work, row.step_error, row.memory)
    if step.failure is None:
        following = harmonic_fallback.converted(full_problem, following)
    return WearStep(row, lambda: following, step.failure, step.has_constant_rate)


class _ImplicitStep:
    """A step of two implicit stages from a state, with the harmonics of a problem."""

    def __init__(
        self,
        problem: WearProblem,
        tolerance: Tolerance,
        state: WearState,
        rows: Sequence[WearRow],
        full_problem: WearProblem,
    ):
        self._problem, self._tolerance, self._state = problem, tolerance, state
        self._drift, self.slopes = initial_guess(problem, state, rows, full_problem)
        self._smallest = 1e-9 * tolerance.scale / float(state.rate.max())
        self.shortest = EXPLICIT_STEPS[0] * tolerance.share * tolerance.scale / float(state.rate.max())
        self._has_fewest = harmonic_fallback.with_fewer(problem) is None
        self._longest = np.inf
        self.solves = 0

    def attempt(self, stride: float) -> StepTrial:
        state = self._state
        searches = [FrequencySearch(slope) for slope in self.slopes]
        first, second = solve_stages(self._problem, state, stride, self._drift, searches)
        self.slopes = np.array([search.slope for search in searches])
        self.solves += first.solves + second.solves
        is_lost = bool(second.failure or first.failure) or _shifts(state, second, stride * self._drift)
        if is_lost:
            error, self._longest = np.inf, stride
        else:
            deviation = (1 - GAMMA) * stride * (first.rate - second.rate)
            error = local_error(self._tolerance, self._problem.area, deviation, second.rate, stride, second.cycles)
        work = stride * ((1 - GAMMA) * first.work + GAMMA * second.work)
        return StepTrial(stride, second, second.depth - state.depth, work, error, error, is_lost)

    def accepts(self, trial: StepTrial) -> bool:
        return trial.error <= 1.0

    def shortened(self, trial: StepTrial, share: float) -> float:
        self._longest = trial.stride
        return trial.stride * share

    def next_stride(self, trial: StepTrial) -> float:
        return float(min(trial.stride * growth(trial.error), 0.5 * self._longest if trial.is_lost else np.inf))

    def failure(self, stride: float, trial: StepTrial) -> NoSolution | None:
        limit = self._smallest
        if trial.is_lost:  # with fewer harmonics a longer step may succeed
            limit = self.shortest if self._has_fewest else 10 * self.shortest
        if stride >= limit:
            return None
        return NoSolution(trial.following.failure or (SHIFTED if trial.is_lost else None), self.solves)


def _implicit_step(
    problem: WearProblem, tolerance: Tolerance, state: WearState, rows: Sequence[WearRow], full_problem: WearProblem
) -> WearStep | NoSolution:
    """A step with the harmonics of a problem, where a solution follows; full_problem : with all, which rows have."""
    if not state.rate.max() > 0:
        top = problem.balance.basis.harmonics[-1]
        return NoSolution(WearEnd.NO_STEP.say(f": no pair slips with harmonics 0 to {top}"), state.solves)
    method = _ImplicitStep(problem, tolerance, state, rows, full_problem)
    scans = harmonic_fallback.scan_problem(full_problem)  # for peaks, where a step succeeds with fewer
    searched = max(problem, scans, key=lambda p: len(p.balance.basis.harmonics))
    accuracy = EVENT_RULES.overtaking_accuracy * tolerance.share
    overtaking = OvertakingEvent(problem, searched, accuracy, state, rows)
    stride = min(predicted_cycles(rows) or 10 * method.shortest, cycles_to_loss_at_rest(full_problem, state, rows))
    trial = accurate_step(method, stride, PreloadEvent(problem, state, rows), overtaking)
    solves = state.solves + method.solves + overtaking.solves
    if isinstance(trial, NoSolution):
        return replace(trial, solves=solves)
    following = trial.following
    if overtaking.points is not None:
        share = EVENT_RULES.search_ratio * overtaking.preload_share(following)
        memory = StepMemory.empty(len(state.points), share)
        following = worn_state(searched, following.depth, following.cycles, overtaking.points, 0)
    else:
        memory = StepMemory(trial.stride * _ratio(trial.error, rows), method.slopes, overtaking.search_share)
    spent = replace(state, solves=solves)
    row = row_of(problem, spent, trial.stride, trial.worn, trial.work, trial.local_error, memory.arrays())
    return WearStep(row, lambda: replace(following, solves=0), has_constant_rate=False)


def _ratio(error: float, rows: Sequence[WearRow]) -> float:
    """Ratio of the next step to one with an error over the tolerance, lower where errors grow from step to step."""
    trend = (rows[-1].step_error / error) ** RULES.error_trend_power if rows and error > 0 else 1.0
    return float(np.clip(growth(error) * min(trend, 1.0), *STEP_RATIO_LIMITS))


def _shifts(state: WearState, following: WearState, expected: np.ndarray) -> bool:
    """Whether a duty's frequency moves so far in a step that it is that of another peak.

    expected : (n_duty,) change of the frequencies that the step before predicts [rad/s]"""
    omega, after = (np.array([point.state.omega for point in s.points]) for s in (state, following))
    limit = np.maximum(LARGEST_SHIFT * omega, RULES.unexpected * np.abs(expected))
    return bool(np.any(np.abs(after - omega) > limit))


def _explicit_step(
    full_problem: WearProblem,
    problem: WearProblem,
    state: WearState,
    tolerance: Tolerance,
    failure: Outcome[WearEnd] | None,
    rows: Sequence[WearRow],
) -> WearStep:
    """An explicit step over the end of a branch, behind which the operating point is searched as at the start.

    The response folds, or the tracked peak merges with a valley: no solution follows on the present one. A step that
    did not get over it, or behind which none was found, is followed by a longer one, up to the tolerance. Where pairs
    impact and branches are short, the rule continues in such steps.
    problem : that the state is solved in; the search takes the harmonics of scans, failing that fewer"""
    memory = StepMemory.empty(len(state.points)).arrays()
    scans = harmonic_fallback.scan_problem(full_problem)
    fewer = harmonic_fallback.with_fewer(scans)
    candidates = (scans,) if fewer is None else (scans, fewer)
    n_explicit = next((i for i, row in enumerate(reversed(rows)) if predicted_cycles([row]) > 0), len(rows))
    for share in EXPLICIT_STEPS[min(n_explicit, len(EXPLICIT_STEPS) - 1) :] if failure else ():
        stride = share * tolerance.share * tolerance.scale / float(state.rate.max())
        worn = stride * state.rate
        for candidate in candidates:
            try:
                after = assess(candidate, state.depth + worn, state.cycles + stride, None)
            except NoPeak:  # a scan with many harmonics may end early
                if candidate is candidates[-1]:
                    raise
                continue
            state = replace(state, solves=state.solves + after.solves)
            if not after.failure:
                row = row_of(problem, state, stride, worn, stride * state.work, 1.0, memory)
                return WearStep(row, lambda: replace(after, solves=0))  # noqa: B023
            failure = after.failure
    row = row_of(problem, state, memory=memory)
    return WearStep(row, lambda: state, failure or WearEnd.NO_STEP.say())
