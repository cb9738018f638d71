"""Both stages of an implicit wear step, each solved with every duty at its site as the wear moves the site.

A stage is one balance solve with the gap wearing along (implicit_stage). Where a duty's site is a peak, its frequency
at the worn depth is not known beforehand: the stage is solved again until the miss vanishes.
Source  SDIRK2: Alexander 1977, SIAM J. Numer. Anal. 14(6), gamma = 1 - 1/sqrt(2)"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tribodyn.declarations import Role, name_of
from tribodyn.hbm import newton
from tribodyn.hbm.continuation.operating_point import FrequencyCorrection, OperatingPoint
from tribodyn.hbm.outcome import SolveEnd
from tribodyn.hbm.wear import harmonic_fallback, law as wear_law
from tribodyn.hbm.wear.history import WearRow
from tribodyn.hbm.wear.implicit_stage import WearingBalance
from tribodyn.hbm.wear.step_memory import StepMemory
from tribodyn.hbm.wear.wear_problem import WearProblem, WearState, worn_state
from tribodyn.refusal import Refusal

GAMMA = 1 - 1 / np.sqrt(2)


@dataclass(frozen=True)
class StageRules:
    """How the frequencies of a stage are searched; see docs/developers/ablations.md."""

    max_corrections: int = 12  # solves of a stage
    retreats: int = 4  # of them at most, half way back, where no solution is found at a frequency that is tried
    # d (miss of the frequency) / d omega while it is not known: of a peak that is one mode's. Where a superharmonic
    # resonance stands on the flank of another the miss is tens of times too large
    unknown_slope: float = -1.0
    # largest moves of the frequency, relative: with a slope that is known, with one that is not
    most_moved: float = 0.03
    first_moved: float = 1e-3
    gain_accuracy: float = 1e-9  # of the depth, for laws whose depth per work is not constant


RULES = StageRules()


def solve_stages(
    problem: WearProblem, state: WearState, stride: float, drift: np.ndarray, searches: Sequence[FrequencySearch]
) -> tuple[WearState, WearState]:
    """Both stages of a step from a state; the second is the state after it."""
    ahead = GAMMA * stride
    first = solve_first_stage(problem, state, stride, drift, searches)
    if first.failure:
        return first, replace(first, solves=0)
    base = state.depth + (1 - GAMMA) / GAMMA * (first.depth - state.depth)
    guess, further = [], []
    for before, after in zip(state.points, first.points, strict=True):
        guess.append(before.state.x + (after.state.x - before.state.x) / GAMMA)
        further.append(before.state.omega + (after.state.omega - before.state.omega) / GAMMA)
    return first, _stage(problem, first, base, ahead, state.cycles + stride, guess, np.array(further), searches)


def initial_guess(
    problem: WearProblem, state: WearState, rows: Sequence[WearRow], full_problem: WearProblem
) -> tuple[np.ndarray, np.ndarray]:
    """(n_duty,) d omega / d cycles, and d miss / d omega of the searches, that a step begins with."""
    drift, slopes = np.zeros(len(state.points)), np.full(len(state.points), RULES.unknown_slope)
    memory = StepMemory.of_row(rows[-1]) if rows else None
    if memory is not None and memory.next_cycles > 0:
        slopes, top = memory.frequency_slopes, problem.balance.basis.harmonics[-1]
        if harmonic_fallback.top_harmonic(full_problem.balance.basis, list(rows[-1].duty_displacement)) == top:
            omega = np.array([point.state.omega for point in state.points])
            drift = (omega - rows[-1].duty_omega) / (state.cycles - rows[-1].cycles)
    return drift, slopes


def solve_first_stage(
    problem: WearProblem, state: WearState, stride: float, drift: np.ndarray, searches: Sequence[FrequencySearch]
) -> WearState:
    """The first stage of a step from a state."""
    guess, ahead = [], GAMMA * stride
    for duty, point in zip(problem.mission, state.points, strict=True):
        balance = problem.in_duty(duty, state.depth)
        opening = ahead * state.rate * balance.contact.of_pairs("opening_slope")
        guess.append(point.state.x + balance.gap_response(point.state, opening))
    omega = np.array([point.state.omega for point in state.points]) + ahead * drift
    return _stage(problem, state, state.depth, ahead, state.cycles + ahead, guess, omega, searches)


def _stage(
    problem: WearProblem,
    neighbour: WearState,
    base: np.ndarray,
    stretch: float,
    cycles: float,
    guess: Sequence[np.ndarray],
    omega: np.ndarray,
    searches: Sequence[FrequencySearch],
) -> WearState:
    """Solve depth = base + stretch rate(depth) with every duty at its site, from the wear per work of `neighbour`."""
    duties = problem.mission
    unworn = [problem.in_duty(duty) for duty in duties]
    gain = depth_per_work(problem, neighbour)
    x, depth = np.concatenate(guess, axis=1), neighbour.depth + stretch * neighbour.rate
    solves = rounds = retreats = 0
    previous: tuple[np.ndarray, np.ndarray] | None = None  # frequencies and x that the search went on from
    for search in searches:
        search.start()
    while True:
        balance = WearingBalance(unworn, [duty.share for duty in duties], base, stretch, gain, depth)
        solution = newton.solve(balance, tuple(omega), x, duties[0].site.newton)
        solves, rounds = solves + len(duties), rounds + 1
        if not solution.converged and previous is not None and retreats < RULES.retreats:
            omega, x, retreats = 0.5 * (previous[0] + omega), 0.5 * (previous[1] + x), retreats + 1
            continue
        worn_at = solution.state
        depth = worn_at.depth
        points, corrections = _duty_points(problem, depth, omega, balance.parts(solution.state.x), solution)
        solves += sum(c.solves for c in corrections)
        stage = worn_state(problem, depth, cycles, points, solves)
        if not solution.converged:
            return stage
        after = np.array([s.next(w, c.distance) for s, w, c in zip(searches, omega, corrections, strict=True)])
        turned = depth_per_work(problem, stage)
        is_consistent = np.all(
            np.abs(turned - gain) * stage.work * stretch <= RULES.gain_accuracy * np.abs(depth).max()
        )
        if is_consistent and np.all(np.abs(after - omega) <= [c.accuracy for c in corrections]):
            return stage
        if rounds > RULES.max_corrections:
            lost = SolveEnd.SITE_NOT_FOUND.say(f" {RULES.max_corrections} solves")
            return replace(stage, points=tuple(replace(p, solution=replace(p.solution, outcome=lost)) for p in points))
        previous = omega, solution.state.x
        x = solution.state.x + balance.follow(worn_at, after - omega)
        omega, gain = after, turned


def _duty_points(
    problem: WearProblem,
    depth: np.ndarray,
    omega: np.ndarray,
    parts: Sequence[np.ndarray],
    solution: newton.Solved[Any],
) -> tuple[list[OperatingPoint], list[FrequencyCorrection]]:
    """The points of all duties of a stage, and the corrections of their frequencies where it converged."""
    points, corrections = [], []
    for w, duty, part in zip(omega, problem.mission, parts, strict=True):
        worn = problem.in_duty(duty, depth)
        state = worn.evaluate(float(w), part)
        solved = newton.Solution(state, solution.outcome, solution.steps, solution.products, solution.history)
        points.append(OperatingPoint.of(worn, solved, duty.site.output, 0))
        if solution.converged:
            corrections.append(duty.site.correction(worn, state))
    return points, corrections


def depth_per_work(problem: WearProblem, state: WearState) -> np.ndarray:
    """(n_pair,) [m/J] of a state; a pair at rest is taken to wear as the working ones on average."""
    gain, area = np.zeros_like(state.rate), problem.area
    for name, wear in problem.wearing.items():
        pairs = problem.balance.contact.joint(name).rows
        rate, work = state.rate[pairs], state.work[pairs]
        works = work > 0
        if np.any(rate[~works] > 0):
            raise Refusal(f'wear law "{wear.law}" wears pairs without friction work: take rule = "thesis"')
        coefficient = name_of(Role.WEAR_COEFFICIENT, wear_law.declared(wear.law))
        reference = (
            np.ones(len(pairs)) if coefficient is None else problem.numbers(name, state.depth[pairs])[coefficient]
        ) / area[pairs]
        usable = works & (reference > 0)
        factor = np.mean(rate[usable] / (work[usable] * reference[usable])) if usable.any() else 1.0
        gain[pairs] = np.divide(rate, work, out=factor * reference, where=works)
    return gain


class FrequencySearch:
    """The frequency at which a miss vanishes, from the misses so far; the miss falls as the frequency rises."""

    def __init__(self, slope: float):
        self.slope = slope
        self._known = slope != RULES.unknown_slope
        self.start()

    def start(self) -> None:
        """Forget the points, at another depth, but not the slope."""
        self._below: tuple[float, float] | None = None
        self._above: tuple[float, float] | None = None
        self._last: tuple[float, float] | None = None

    def next(self, omega: float, miss: float) -> float:
        """The frequency to try after one that missed by `miss`: secant, kept inside what brackets the zero."""
        if self._last is not None and omega != self._last[0]:
            slope = (miss - self._last[1]) / (omega - self._last[0])
            self._known, self.slope = (True, slope) if slope < -0.1 else (self._known, self.slope)
        reach = RULES.most_moved if self._known else RULES.first_moved
        self._last = (omega, miss)
        if miss > 0:
            self._below = self._last
        else:
            self._above = self._last
        trial = omega - miss / self.slope
        if self._below is not None and self._above is not None:
            low, high = self._below[0], self._above[0]
            if not min(low, high) < trial < max(low, high):
                return 0.5 * (low + high)
            return trial
        return float(np.clip(trial, (1 - reach) * omega, (1 + reach) * omega))
