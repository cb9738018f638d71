"""Error-controlled wear steps, stable for the stiff coupling of pressure and depth.

dw/dZ = r(w) relaxes a pressure peak thousands of times faster than the contact as a whole wears: explicit steps must
resolve the former or oscillate from node to node. Here both stages of a second-order, L-stable, stiffly accurate
Runge-Kutta step are implicit (dirk_stages); a first-order companion gives the error estimate. Here are the lengths of
steps, and what a step must not pass unseen: an event, a higher peak, the end of a branch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tribodyn.hbm.continuation.operating_point import AtFrequency, OperatingPoint
from tribodyn.hbm.continuation.peak_refinement import NoPeak
from tribodyn.hbm.outcome import Outcome, WearEnd
from tribodyn.hbm.threads import single
from tribodyn.hbm.time.stepper import IntegrationFailed
from tribodyn.hbm.wear import fewer_harmonics
from tribodyn.hbm.wear.dirk_stages import GAMMA, RULES as OF_STAGES, Search, begun, stages
from tribodyn.hbm.wear.evolution import (
    WearProblem,
    WearState,
    assess,
    first_preload,
    kept_beside,
    reason_to_stop,
    row_of,
    state_of,
    worn_state,
)
from tribodyn.hbm.wear.history import LARGEST_SHIFT, LIFE_SHARE, WearHistory, WearRow, history, rows_to_resume
from tribodyn.hbm.wear.machine_motion import MachineMotion, with_growth
from tribodyn.hbm.wear.preload_at_rest import PreloadAtRest
from tribodyn.hbm.wear.step_control import STEP_RATIO_LIMITS, Tolerance, expected, growth, local_error


@dataclass(frozen=True)
class StepRules:
    """How the steps of this rule are placed; see docs/accuracy/ablations.md."""

    error_trend_power: float = 0.2  # power with which an error that grows from step to step holds the next one back
    # shares of an event's preload between which a step that would pass the event must end: just below it, so that the
    # next step starts beyond it
    event_window: tuple[float, ...] = (0.97, 0.999)
    # of the first preload, where a run ends at the latest: below it the last touch is noise of Newton's tolerance
    least_preload_share: float = 1e-4
    # share of the tolerance, of the cycles, within which a jump to another peak is located
    overtaking_accuracy: float = 0.5
    # ratio of preloads after which higher peaks are looked for again; where the highest other one has a share below
    # `near` of the height that overtakes, its power (near / share)^2, `rarest` at most
    looked_at: float = 0.97
    near: float = 0.5
    rarest: float = 16.0
    located_beside: float = 0.4  # of the accuracy, how far beside the estimated instant of a jump the next trial is
    # a peak that moves further than LARGEST_SHIFT, unless less than so many times as far as the step before leads to
    # expect
    unexpected: float = 4.0
    # first depth in time, and the shortest: the scatter of the rates is no error that shorter steps lower; both over
    # the tolerance on depth
    first_in_time: float = 0.3
    shortest_in_time: float = 0.05


RULES = StepRules()
# depths of explicit steps over the end of a branch, shares of the tolerance, tried in turn; the longest, 0.81, stays
# within the tolerance
EXPLICIT_STEPS = 0.01 * 3.0 ** np.arange(5)
SHIFTED = WearEnd.NO_STEP.say(f": the tracked peak moves by more than {LARGEST_SHIFT:.0%} in the shortest step")


@single
def evolve(
    problem: WearProblem,
    tolerance: Tolerance,
    max_steps: int = 10000,
    on_row: Callable[[WearRow], None] | None = None,
    resume: WearHistory | None = None,
    motion: Literal["balance", "machine", "time"] = "balance",
    watched: bool = True,
) -> WearHistory:
    """Wear the contact until it is lost, with steps chosen by a local error estimate on depth and on life.

    motion : along which it wears: the balance's; that of a machine, followed in time where it leaves the balance's, see
        hbm.wear.machine_motion; or in time everywhere
    watched : whether rows have the growth of perturbations; a machine's motion depends on it, nothing else does
    on_row, resume, return : as for the thesis's rule; `step_error` of a row is its estimate over the tolerance. The
    last touch of a vibrating contact does not end in finite time: `least_preload_share` ends the run where
    `lost_below` does not.
    Raises  ValueError where the wear law wears pairs that do no friction work
    """
    problem = replace(problem, lost_below=max(problem.lost_below, RULES.least_preload_share))
    machine = None if motion == "balance" else MachineMotion(problem, tolerance, motion == "time")
    rows = rows_to_resume(resume)
    state: WearState | None
    if rows:  # the state after the last step was not kept: take the step again, to the same bits
        again = rows.pop()
        before = replace(state_of(problem, again), solves=0, growth=again.growth, preload_at_rest=again.preload_at_rest)
        if machine is not None:
            machine.take_up(again)
            before = machine.of(before, _planned(rows))
        state = _taken(problem, machine, tolerance, before, rows).after
        rows.append(again)
    else:
        state = assess(problem, np.zeros_like(problem.area), 0.0, None)
    at_rest = PreloadAtRest(problem)
    end = WearEnd.STEPS_DONE.say(f" {max_steps} wear steps")
    while len(rows) < max_steps and state is not None:
        state = at_rest.of(state)
        if motion == "machine" or (watched and motion == "balance"):
            state = with_growth(problem, state, always=machine is not None)
        if machine is not None:
            state = machine.of(state, _planned(rows))
        reason = reason_to_stop(problem, state, rows, tolerance.share * tolerance.scale)
        if reason:
            rows.append(row_of(problem, state, plan=_no_plan(state)))
            end = reason
        else:
            taken = _taken(problem, machine, tolerance, state, rows)
            rows.append(taken.row)
            state, end = taken.after, taken.failure or end
        if on_row is not None:
            on_row(rows[-1])
        if reason:
            break
    worn = history(rows, end)
    told = end.detail + _told(worn) + fewer_harmonics.reported(problem.balance.basis, rows)
    return replace(worn, end=end.kind.say(told))


def _told(worn: WearHistory) -> str:
    """What to say of frequencies that moved on to another peak, and of motions in time."""
    said = [
        f"; the response jumped from {worn.frequency[i]:.5g} to {worn.frequency[i + 1]:.5g} Hz "
        f"at {worn.cycles[i + 1]:.3g} cycles"
        for i in worn.jumps
    ]
    if worn.in_time.any():
        share = worn.cycles_in_step[worn.in_time].sum() / (worn.cycles_in_step.sum() or 1.0)
        first = worn.cycles[worn.in_time.argmax()]
        said.append(f"; the motion was followed in time for {share:.0%} of the cycles, from {first:.3g} cycles on")
    return "".join(said)


@dataclass(frozen=True)
class _Taken:
    """A step: its row, and the state after it, or why there is none."""

    row: WearRow
    after: WearState | None
    failure: Outcome[WearEnd] | None = None


@dataclass(frozen=True)
class _Lost:
    """A step with no solution behind it, however short: why, and the solves spent."""

    failure: Outcome[WearEnd] | None
    solves: int


def _taken(
    problem: WearProblem,
    machine: MachineMotion | None,
    tolerance: Tolerance,
    state: WearState,
    rows: Sequence[WearRow],
) -> _Taken:
    """A step along the motion that a state has."""
    if machine is None or state.means is None:
        return _step(problem, tolerance, state, rows)
    try:
        return _step_in_time(problem, machine, tolerance, state, rows)
    except IntegrationFailed as failure:
        row = row_of(problem, state, plan=_no_plan(state))
        return _Taken(row, None, WearEnd.SOLVE_FAILED.say(f" in time: {failure}"))


def _planned(rows: Sequence[WearRow]) -> float:
    """Cycles of the step that the last one has led to expect, 0 where it has not."""
    return float(rows[-1].plan[0]) if rows else 0.0


def _step_in_time(
    problem: WearProblem, machine: MachineMotion, tolerance: Tolerance, state: WearState, rows: Sequence[WearRow]
) -> _Taken:
    """A step along the machine's motion; where another peak overtakes, it ends there."""
    unit = tolerance.share * tolerance.scale / float(state.rate.max())
    stride = _planned(rows) or RULES.first_in_time * unit
    stride = min(stride, _until_lost_at_rest(problem, state, rows))
    assert state.means is not None
    solves, periods = state.solves, state.means.periods
    target = _event(problem, state, rows)
    # held to the depth that is left, too: more lifts pairs that go on touching, with most of a life still to come
    within = tolerance.share * tolerance.scale * min(_share_left(problem, state, rows, state), 1.0)
    given = all(isinstance(duty.site, AtFrequency) for duty in problem.mission)  # no peak moves with the depth
    while True:
        there = replace(state, depth=machine.ahead(state, stride), cycles=state.cycles + stride, solves=0)
        if not given:
            there = assess(problem, there.depth, there.cycles, state)
        there, worn, deviation = machine.step(state, there, stride)
        assert there.means is not None
        solves, periods = solves + there.solves, periods + there.means.periods
        life = float(expected(tolerance, state.cycles + stride, state.depth + worn))
        chance = 0.5 * stride * float(np.hypot(state.means.error, there.means.error)) / (tolerance.share * life)
        # rates that scatter may agree by chance
        told = max(chance, local_error(tolerance, problem.area, deviation, there.rate, stride, life))
        error = max(told, float(np.abs(deviation).max()) / within)
        preload = problem.preload_of(there)
        if error <= 1.0 and preload < RULES.event_window[0] * target:
            stride, target = stride * _share_to(target, problem.preload_of(state), preload), 0.0
            continue
        if error <= 1.0 or stride <= RULES.shortest_in_time * unit:
            break
        stride = max(stride * growth(error), RULES.shortest_in_time * unit)
    look = _next_look(problem, state, rows)
    stride_after = stride * growth(error)
    after_at = state.depth + worn, state.cycles + stride
    after = kept_beside(problem, state, *after_at) if given and machine.always else assess(problem, *after_at, state)
    solves += after.solves
    if not after.failure and _share_left(problem, after, rows, state) <= look:
        found = _overtaken(problem, after)
        solves += found.solves
        look = _look_after(found, _share_left(problem, after, rows, state))
        if found.points is not None:
            after, stride_after = worn_state(problem, after.depth, after.cycles, found.points, 0), 0.0
    plan = np.array([stride_after, *np.full(len(state.points), OF_STAGES.unknown_slope), look])
    work = stride * 0.5 * (state.work + there.work)
    row = row_of(problem, replace(state, solves=solves), stride, worn, work, told, plan)
    return _Taken(replace(row, periods=periods), replace(after, solves=0))


def _step(whole: WearProblem, tolerance: Tolerance, state: WearState, rows: Sequence[WearRow]) -> _Taken:
    """One accepted step from a state; where an event would be passed, the step ends at it.

    Where no solution with all harmonics follows, fewer are taken until the step succeeds; each step tries more again.
    """
    problem, state = settled, start = fewer_harmonics.settled(whole, state)
    while isinstance(taken := _step_of(problem, tolerance, state, rows, whole), _Lost):
        start = replace(start, solves=taken.solves)
        fewer = fewer_harmonics.with_fewer(problem)
        if fewer is None:
            problem = settled
            taken = _explicit_step(whole, problem, start, tolerance, taken.failure, rows)
            break
        problem, state = fewer, fewer_harmonics.carried(fewer, start)
    row, after = taken.row, taken.after
    if problem is not whole:
        here = replace(fewer_harmonics.carried(whole, start if problem is settled else state), solves=row.solves)
        here = replace(here, preload_at_rest=row.preload_at_rest)
        row = row_of(whole, here, row.cycles_in_step, row.worn, row.work, row.step_error, row.plan)
    return replace(taken, row=row, after=after and fewer_harmonics.carried(whole, after))


def _step_of(
    problem: WearProblem, tolerance: Tolerance, state: WearState, rows: Sequence[WearRow], whole: WearProblem
) -> _Taken | _Lost:
    """A step with the harmonics of a problem, where a solution follows.

    whole : the problem with all harmonics, which rows have
    """
    if not state.rate.max() > 0:
        top = problem.balance.basis.harmonics[-1]
        return _Lost(WearEnd.NO_STEP.say(f": no pair slips with harmonics 0 to {top}"), state.solves)
    scans = fewer_harmonics.of_scans(whole)  # for peaks, where a step gets on with fewer
    searched = max(problem, scans, key=lambda p: len(p.balance.basis.harmonics))
    last = fewer_harmonics.with_fewer(problem) is None
    smallest = 1e-9 * tolerance.scale / float(state.rate.max())
    shortest = EXPLICIT_STEPS[0] * tolerance.share * tolerance.scale / float(state.rate.max())
    stride = _planned(rows) or 10 * shortest
    drift, slopes = begun(problem, state, rows, whole)
    stride = min(stride, _until_lost_at_rest(whole, state, rows))
    target = _event(problem, state, rows)
    solves, longest = state.solves, np.inf
    highest_until, low, high = 0.0, 0.0, 0.0  # stride after which the tracked peak is still the highest; nearness
    jumped: tuple[float, WearState, WearState, float, tuple[OperatingPoint, ...]] | None = None  # ... and where not
    higher: tuple[OperatingPoint, ...] | None = None
    look = _next_look(problem, state, rows)
    while True:
        searches = [Search(slope) for slope in slopes]
        first, second = stages(problem, state, stride, drift, searches)
        slopes = np.array([search.slope for search in searches])
        solves += first.solves + second.solves
        lost = bool(second.failure or first.failure) or _shifts(state, second, stride * drift)
        if lost:
            error, longest = np.inf, stride
        else:
            deviation = (1 - GAMMA) * stride * (first.rate - second.rate)
            error = local_error(tolerance, problem.area, deviation, second.rate, stride, second.cycles)
        if error <= 1.0:
            preload = problem.preload_of(second)
            if preload >= RULES.event_window[0] * target:
                found = None
                left = _share_left(problem, second, rows, state)
                if jumped or left <= look:
                    found = _overtaken(searched, fewer_harmonics.carried(searched, second))
                    solves += found.solves
                if found is not None and found.points is not None:
                    jumped, high = (stride, first, second, error, found.points), found.nearness
                elif jumped is None:
                    look = look if found is None else _look_after(found, left)
                    break
                else:
                    assert found is not None
                    high = high if highest_until == 0 else np.sqrt(high)  # Illinois: the end that stays counts less
                    highest_until, low = stride, found.nearness
                accuracy = RULES.overtaking_accuracy * tolerance.share * second.cycles
                if jumped[0] - highest_until <= accuracy:
                    break
                stride = _instant(highest_until, low, jumped[0], high, accuracy)
                continue
            longest = stride
            stride *= _share_to(target, problem.preload_of(state), preload)
        elif jumped is not None:
            break
        else:
            stride = min(stride * growth(error), 0.5 * longest if lost else np.inf)
        if stride < ((shortest if last else 10 * shortest) if lost else smallest):
            return _Lost(second.failure or (SHIFTED if lost else None), solves)
    if jumped is not None:
        stride, first, second, error, higher = jumped
        look = RULES.looked_at * _share_left(problem, second, rows, state)
    worn = second.depth - state.depth
    work = stride * ((1 - GAMMA) * first.work + GAMMA * second.work)
    trend = (rows[-1].step_error / error) ** RULES.error_trend_power if rows and error > 0 else 1.0
    ratio = float(np.clip(growth(error) * min(trend, 1.0), *STEP_RATIO_LIMITS))
    plan = np.array([stride * ratio, *slopes, look])
    if higher is not None:
        second = worn_state(searched, second.depth, second.cycles, higher, 0)
        plan = _no_plan(state, look)
    row = row_of(problem, replace(state, solves=solves), stride, worn, work, error, plan)
    return _Taken(row, replace(second, solves=0))


def _no_plan(state: WearState, look: float = 1.0) -> np.ndarray:
    """The plan of a step behind which all but the next look for higher peaks begins anew."""
    return np.array([0.0, *np.zeros(len(state.points)), look])


def _until_lost_at_rest(problem: WearProblem, state: WearState, rows: Sequence[WearRow]) -> float:
    """Cycles after which the preload at rest, which falls evenly, is just below the share that ends the run."""
    if problem.lost_below_at_rest is None or not rows:
        return np.inf
    fall = (rows[-1].preload_at_rest - state.preload_at_rest) / rows[-1].cycles_in_step
    least = RULES.event_window[0] * problem.lost_below_at_rest * rows[0].preload_at_rest
    return float((state.preload_at_rest - least) / fall) if fall > 0 else np.inf


def _share_left(problem: WearProblem, there: WearState, rows: Sequence[WearRow], state: WearState) -> float:
    """Preload of a state after `state` over the first one."""
    return problem.preload_of(there) / (first_preload(problem, rows, state) or 1.0)


def _next_look(problem: WearProblem, state: WearState, rows: Sequence[WearRow]) -> float:
    """The share of the first preload at which higher peaks are looked for next."""
    return float(rows[-1].plan[-1]) if rows else RULES.looked_at * _share_left(problem, state, rows, state)


def _look_after(found: _Overtaken, left: float) -> float:
    """The same after a search at a share of the first preload: the later, the lower the other peaks are."""
    rarity = RULES.rarest if found.nearness == 0 else (RULES.near / found.nearness) ** 2
    return left * RULES.looked_at ** float(np.clip(rarity, 1.0, RULES.rarest))


def _instant(before: float, low: float, after: float, high: float, accuracy: float) -> float:
    """The stride to try for the instant of a jump, between one before it and one after it.

    low, high : nearness of the higher peak there, whose logarithm is interpolated; halves where it is not known
    """
    if not 0 < low < 1 < high:
        return 0.5 * (before + after)
    estimate = before + (after - before) * np.log(1 / low) / np.log(high / low)
    beside = RULES.located_beside * accuracy
    trial = estimate + (beside if estimate - before < after - estimate else -beside)
    return float(np.clip(trial, before + 0.5 * beside, after - 0.5 * beside))


def _shifts(state: WearState, second: WearState, expected: np.ndarray) -> bool:
    """Whether a duty's frequency moves so far in a step that it is that of another peak.

    expected : (n_duty,) change of the frequencies that the step before leads to expect [rad/s]
    """
    omega, after = (np.array([point.state.omega for point in s.points]) for s in (state, second))
    limit = np.maximum(LARGEST_SHIFT * omega, RULES.unexpected * np.abs(expected))
    return bool(np.any(np.abs(after - omega) > limit))


@dataclass(frozen=True)
class _Overtaken:
    """A look for higher peaks: the duties at them, None where none has overtaken; solves spent; the nearest one's."""

    points: tuple[OperatingPoint, ...] | None
    solves: int
    nearness: float


def _overtaken(problem: WearProblem, state: WearState) -> _Overtaken:
    """Look for peaks that have overtaken those of a state's duties."""
    searched = [
        duty.site.dominant_peak(problem.in_duty(duty, state.depth), point)
        for duty, point in zip(problem.mission, state.points, strict=True)
    ]
    points = None
    if any(found.point for found in searched):
        points = tuple(found.point or old for found, old in zip(searched, state.points, strict=True))
    return _Overtaken(points, sum(found.solves for found in searched), max(found.nearness for found in searched))


def _explicit_step(
    whole: WearProblem,
    problem: WearProblem,
    state: WearState,
    tolerance: Tolerance,
    failure: Outcome[WearEnd] | None,
    rows: Sequence[WearRow],
) -> _Taken:
    """An explicit step over the end of a branch, behind which the site is looked for as at the start.

    The response folds, or the tracked peak merges with a valley: no solution follows on the one here. A step that did
    not get over it, or behind which none was found, is followed by a longer one, up to the tolerance. Where pairs
    impact and branches are short, the rule continues in such steps.
    problem : that the state is solved in; it is looked for with the harmonics of scans, failing that with fewer
    """
    plan = _no_plan(state)
    scans = fewer_harmonics.of_scans(whole)
    fewer = fewer_harmonics.with_fewer(scans)
    tried = next((i for i, row in enumerate(reversed(rows)) if row.plan[0] > 0), len(rows))
    for share in EXPLICIT_STEPS[min(tried, len(EXPLICIT_STEPS) - 1) :] if failure else ():
        length = share * tolerance.share * tolerance.scale / float(state.rate.max())
        worn = length * state.rate
        ways = (scans,) if fewer is None else (scans, fewer)
        for there in ways:
            try:
                after = assess(there, state.depth + worn, state.cycles + length, None)
            except NoPeak:  # a scan with many harmonics may end early
                if there is ways[-1]:
                    raise
                continue
            state = replace(state, solves=state.solves + after.solves)
            if not after.failure:
                row = row_of(problem, state, length, worn, length * state.work, 1.0, plan)
                return _Taken(row, replace(after, solves=0))
            failure = after.failure
    failed = row_of(problem, state, plan=plan)
    return _Taken(failed, None, failure or WearEnd.NO_STEP.say())


def _event(problem: WearProblem, state: WearState, rows: Sequence[WearRow]) -> float:
    """The next preload at which a row is wanted [N]: where life is stated to end, and where the run is to end."""
    first, now = first_preload(problem, rows, state), problem.preload_of(state)
    shares = [share for share in (LIFE_SHARE, problem.lost_below) if share > 0]
    return max((share * first for share in shares if share * first < now), default=0.0)


def _share_to(target: float, start: float, end: float) -> float:
    """Share of a step after which the preload has fallen from start to just below the target, along its logarithm."""
    aim = np.mean(RULES.event_window) * target
    return float(np.clip(np.log(start / aim) / np.log(start / max(end, 1e-3 * target)), 0.05, 0.95))
