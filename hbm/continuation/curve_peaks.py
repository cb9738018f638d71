"""The peaks of a response curve, solved and made points of it: what is read from its highest point is the peak.

Between two neighbours where the frequency rises or falls throughout, the peak is refined along the frequency; where the
curve turns back beside it, along its arc length."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation import bordered, parameter
from tribodyn.hbm.continuation.amplitude_slope import AmplitudeSlope
from tribodyn.hbm.continuation.bordered import BorderFailed, Direction, Metric
from tribodyn.hbm.continuation.branch import Branch, BranchPoint
from tribodyn.hbm.continuation.curve_segment import CurvePoint, Segment
from tribodyn.hbm.continuation.highest_peak import vertex
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.continuation.peak_refinement import NoPeak
from tribodyn.hbm.linear.resonances import narrow_resonances
from tribodyn.hbm.newton import Solution
from tribodyn.hbm.outcome import CONVERGED, Outcome, SolveEnd
from tribodyn.hbm.threads import single

if TYPE_CHECKING:
    from tribodyn.hbm.continuation.resonance_peak import AtPeak


@dataclass(frozen=True)
class CurvePeakRules:
    """How peaks of a curve are refined."""

    max_refined: int = 3  # maxima of a curve, the highest foreseen first
    trials: int = 40  # solves along the arc, after which the maximum is left as it is
    tangent: float = 1e-8  # relative accuracy of tangents


RULES = CurvePeakRules()


@dataclass(frozen=True)
class _Candidate:
    """A peak that a curve may have: its height as foreseen, the point beside it and the frequencies around it."""

    height: float
    point: int
    low: float
    high: float
    turns: bool = False


@single
def with_peaks(balance: HarmonicBalance, branch: Branch, site: AtPeak) -> Branch:
    """The curve with its highest peaks among its points, in their order.

    branch : over the frequency; site : of which output, and how exactly
    A maximum that no solve makes higher stays the point that it is. It is marked where the search for its peak failed
    or ended lower, on another part of the curve, and it is foreseen highest; and where nothing limits its resonance"""
    branch = _with_narrow_resonances(balance, branch, site)
    insertions: list[tuple[int, BranchPoint]] = []
    failed: list[tuple[float, int, Outcome[SolveEnd]]] = []
    heights = branch.amplitude(site.output)
    highest = float(branch.height(site.output).max())
    for candidate in _candidates(balance, branch, site)[: RULES.max_refined]:
        i = candidate.point
        if candidate.turns:
            point = peak_on_arc(balance, branch, i, site)
        else:
            point, x = None, balance.shaped(branch.contact[i])
            with suppress(NoPeak):  # it still rises at the highest frequency that is modelled
                point = site.solve_between(balance, float(branch.omega[i]), x, candidate.low, candidate.high)
        if point is None or not point.solution.converged or point.amplitude < (1 - site.tolerance) * heights[i]:
            failed += [(max(candidate.height, heights[i]), i, SolveEnd.BESIDE_PEAK.say())]
            if point is not None and point.solution.outcome.kind is SolveEnd.UNLIMITED:
                failed[-1] = (np.inf, i, point.solution.outcome)
            continue
        state, inside = point.state, candidate.turns or candidate.low < point.state.omega < candidate.high
        if not inside or not point.amplitude > heights[i]:
            continue
        at = i + 1 if _lies_behind(branch, i, state.omega, state.flat) else i
        insertions.append((at, _branch_point(balance, state, point.solves)))
        highest = max(highest, point.amplitude)
    marks = {i: outcome for height, i, outcome in failed if height >= highest}
    branch = replace(branch, outcome=tuple(marks.get(i, outcome) for i, outcome in enumerate(branch.outcome)))
    for at, solved in sorted(insertions, key=lambda item: -item[0]):
        branch = branch.inserted(at, solved)
    return branch


def _with_narrow_resonances(balance: HarmonicBalance, branch: Branch, site: AtPeak) -> Branch:
    """The curve with points at linear resonances between which and its points nothing would tell of them."""
    if branch.folds or len(np.unique(np.sign(np.diff(branch.omega)))) != 1:
        return branch
    for omega in narrow_resonances(balance, branch.omega):
        at = int(np.flatnonzero((branch.omega[:-1] < omega) != (branch.omega[1:] < omega))[0])
        share = (omega - branch.omega[at]) / (branch.omega[at + 1] - branch.omega[at])
        guess = (1 - share) * branch.contact[at] + share * branch.contact[at + 1]
        solution = newton.solve(balance, float(omega), balance.shaped(guess), site.newton)
        if solution.converged:
            branch = branch.inserted(at + 1, _branch_point(balance, solution.state, solution.steps))
    return branch


def _branch_point(balance: HarmonicBalance, state: State, steps: int) -> BranchPoint:
    response, energy = balance.outputs(state), float(balance.energy(state).sum())
    return BranchPoint(state.omega, state.x, state.omega, response, energy, CONVERGED, steps)


def _candidates(balance: HarmonicBalance, branch: Branch, site: AtPeak) -> list[_Candidate]:
    """Points as high as both neighbours, and steps that a resonance may hide in; the highest foreseen first."""
    omega, height = branch.omega, np.where(branch.converged, branch.amplitude(site.output), -1.0)
    inner = (height[1:-1] > 0) & (height[1:-1] >= height[:-2]) & (height[1:-1] >= height[2:])
    tops = np.flatnonzero(inner & (height[:-2] >= 0) & (height[2:] >= 0)) + 1
    candidates = []
    for i in map(int, tops):
        predicted = vertex(omega[i - 1 : i + 2], height[i - 1 : i + 2])[1]
        low, high = sorted((float(omega[i - 1]), float(omega[i + 1])))
        turns = bool((omega[i] - omega[i - 1]) * (omega[i + 1] - omega[i]) <= 0)
        beside_fold = i - 1 in branch.folds or i + 1 in branch.folds
        candidates.append(_Candidate(predicted, i, low, high, turns or beside_fold))
    for i in map(int, np.flatnonzero((height[:-1] > 0) & (height[1:] > 0))):
        if i not in tops and i + 1 not in tops:
            predicted = _hidden(balance, branch, i, site)
            if predicted > 0:
                low, high = sorted((float(omega[i]), float(omega[i + 1])))
                candidates.append(_Candidate(predicted, i if height[i] > height[i + 1] else i + 1, low, high))
    return sorted(candidates, key=lambda candidate: -candidate.height)


def _hidden(balance: HarmonicBalance, branch: Branch, i: int, site: AtPeak) -> float:
    """Height of a resonance between points i and i + 1, both of which lie on its flanks; 0 where there is none.

    Two responses y = R / (p - omega) give p. A response that passes zero looks the same, but falls towards it."""
    y = branch.response[i : i + 2, branch.output_names.index(site.output)]
    y = y[:, y.shape[1] % 2 :]
    strongest = 2 * int(np.argmax(np.sum(y[:, ::2] ** 2 + y[:, 1::2] ** 2, axis=0)))
    a, b = y[:, strongest] - 1j * y[:, strongest + 1]
    w = branch.omega[i : i + 2]
    pole = (a * w[0] - b * w[1]) / (a - b) if a != b else complex(np.inf)
    low, high = sorted(w)
    if not low < pole.real < high:
        return 0.0
    for k, way in ((i, 1.0), (i + 1, -1.0)):
        state = balance.evaluate(float(branch.omega[k]), balance.shaped(branch.contact[k]))
        slope = AmplitudeSlope.of(balance, Solution(state, CONVERGED, 0, 0, ()), site.output).slope
        if slope * way * (w[1] - w[0]) <= 0:
            return 0.0
    return float(abs(a) * abs(pole - w[0]) / max(abs(pole.imag), 1e-12 * abs(pole)))


def _lies_behind(branch: Branch, i: int, omega: float, flat: np.ndarray) -> bool:
    """Whether a point beside point i comes after it on the way of the branch."""
    neighbours = branch.omega[max(i - 1, 0) : i + 2]
    steps = np.diff(neighbours)
    if steps[0] * steps[-1] > 0:
        return bool((omega - branch.omega[i]) * steps[0] > 0)
    offset = flat - branch.contact[i]
    before, after = branch.contact[i - 1] - branch.contact[i], branch.contact[i + 1] - branch.contact[i]
    return bool(np.vdot(offset, after) / np.linalg.norm(after) > np.vdot(offset, before) / np.linalg.norm(before))


def peak_on_arc(balance: HarmonicBalance, branch: Branch, i: int, site: AtPeak) -> OperatingPoint | None:
    """The peak beside point i of a curve that turns back there; None where a solve fails."""
    path = parameter.of(balance)
    span = float(np.ptp(branch.omega[i - 1 : i + 2]))
    size = float(np.linalg.norm(np.ptp(branch.contact[i - 1 : i + 2], axis=0)))
    if not (span > 0 and size > 0):
        return None
    metric = Metric(size, span)
    places = [Direction(branch.contact[k], float(branch.omega[k])) for k in (i - 1, i, i + 1)]

    def solved(guess: Direction, border: Direction) -> tuple[CurvePoint, AmplitudeSlope] | None:
        solution, value = bordered.correct(path, guess, border, metric, site.newton)
        if not solution.converged:
            return None
        tangent = bordered.tangent(path, value, solution.state, border, metric, site.newton, RULES.tangent)
        point = CurvePoint.of(value, solution, tangent)
        linear = balance.linearise(solution.state)
        return point, AmplitudeSlope.on_tangent(balance, linear, solution, site.output, tangent)

    spent = 0
    try:
        middle = solved(places[1], metric.unit(places[2] - places[0]))
        spent += 1
        if middle is None:
            return None
        rises = middle[1].slope > 0
        other = solved(places[2] if rises else places[0], middle[0].tangent)
        spent += 1
        if other is None or other[1].slope * middle[1].slope > 0:
            return None
        ends = [middle, other] if rises else [other, middle]  # the amplitude rises at the first, falls at the second
        weight, best = [1.0, 1.0], min(ends, key=lambda end: end[1].miss)
        while spent < RULES.trials:
            segment = Segment(ends[0][0], ends[1][0], metric)
            if segment.length <= 2 * site.tolerance * best[1].width:
                break
            up, down = weight[0] * ends[0][1].slope, -weight[1] * ends[1][1].slope
            trial = solved(segment.at(float(np.clip(up / (up + down), 0.02, 0.98))), segment.mean_tangent)
            spent += 1
            if trial is None:
                return None
            k = 0 if trial[1].slope > 0 else 1
            ends[k], weight[k], weight[1 - k] = trial, 1.0, 0.5 * weight[1 - k]  # Illinois
            best = min(best, trial, key=lambda end: end[1].miss)
        solutions = (end[1].solution for end in [*ends, best])
        points = (OperatingPoint.of(balance, solution, site.output, spent) for solution in solutions)
        return max(points, key=lambda point: point.amplitude)
    except BorderFailed:
        return None
