"""Natural continuation: the parameter is stepped, the solution follows by extrapolation of its last points.

A step that fails is halved. Where that does not help the curve is followed by arc length: if it has a fold there, the
sweep jumps as a measured one does, to where the curve comes to the next value or else to what is found from rest. A
value without a solution is a gap: the sweep continues behind it, and comes back to it from there."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tribodyn.declarations import number, require_limits
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation import parameter
from tribodyn.hbm.continuation.branch import Branch, BranchBuilder, OnPoint
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.outcome import BranchEnd, Outcome, SolveEnd
from tribodyn.hbm.threads import single

EXTRAPOLATION_DEGREE = 2  # higher ones amplify the kinks of the contact


@dataclass(frozen=True)
class NaturalRules:
    """How a step that fails is made all the same; see docs/developers/ablations.md.

    least_spacing : of the points extrapolated from, in steps: closer ones amplify what Newton leaves
    max_fold_points : by arc length on the way round folds, after which the sweep looks from rest
    abrupt : miss of the extrapolation, in the longer of the last two steps of x, from which on a step is solved
        backwards: over a jump it does not lead back
    same_point : distance, in steps of x, within which it has led back"""

    least_spacing: float = 0.5
    max_fold_points: int = 200
    abrupt: float = 0.5
    same_point: float = 1e-2


@dataclass(frozen=True)
class Options:
    """How points are placed."""

    n_points: int = number(default=200, low=2)
    """Equidistant values, ends included; `response.points` of a scene by default."""
    refinements: int = number(default=6, low=0)
    """Times that a step which fails, or does not lead back, may be halved."""
    rules: NaturalRules = field(default_factory=NaturalRules, kw_only=True)
    newton: NewtonOptions = field(default_factory=NewtonOptions, kw_only=True)

    def __post_init__(self) -> None:
        require_limits(self, "natural continuation")


@single
def follow(
    problem: HarmonicBalance | Parameter,
    start: float,
    stop: float,
    options: Options | None = None,
    on_point: OnPoint | None = None,
) -> Branch:
    """Follow the response from one frequency, or value of a parameter, to another.

    start, stop : [rad/s] or in the unit of the parameter, either order
    on_point : called with points done, points wanted, and the last point
    Returns a Branch; its end says at which folds the response jumped, and where and why a branch ends early. Points
        of the branch that are folds are marked"""
    options = options or Options()
    sweep, end = _NaturalSweep(parameter.of(problem), start, stop, options), None
    while end is None:
        end = sweep.advance()
        if on_point is not None and sweep.done:
            on_point(sweep.done + 1, options.n_points, sweep.builder.points[-1])
    return sweep.builder.finish(end)


class _NaturalSweep:
    """The values to come, and the solution at the last. done : values that are behind, the first not counted."""

    def __init__(self, path: Parameter, start: float, stop: float, options: Options):
        self._path, self._stop, self._options = path, stop, options
        self._solution = arc_length.first_on(path, start, options.newton)
        rising = np.linspace(min(start, stop), max(start, stop), options.n_points)
        self._targets = (rising if start <= stop else rising[::-1])[1:]  # the same values either way
        self.builder = BranchBuilder(path)
        self.builder.add(start, self._solution)
        self.done = 0
        self._jumps: list[float] = []

    @property
    def notes(self) -> str:
        """At which folds the response jumped, and where there is no solution; empty where neither is so."""
        builder, say = self.builder, self._path.say
        places = sorted({*self._jumps, *(builder.value[i] for i in builder.folds)})
        gaps = [point.value for point in builder.points if point.outcome.kind is not SolveEnd.CONVERGED]
        texts = (("the response jumped", places), ("no solution was found", gaps))
        return "".join(f"; {text} at {', '.join(map(say, values))}" for text, values in texts if values)

    def advance(self) -> Outcome[BranchEnd] | None:
        """The next value; why the branch ends, or None."""
        path, builder, options = self._path, self.builder, self._options
        solution = self._solution
        if solution.converged:
            value = self._targets[self.done]
            solution = self._step(value, options.refinements)
            if not solution.converged and path.place(value)[0].simpler() is None:
                solution = _by_arc_length(path, builder, solution, value, self._stop, options)
            if not solution.converged:
                solution = self._behind_gap(solution)
            self._solution = solution
            self.done += 1
        if not solution.converged:
            return BranchEnd.ENDED.say(f" {path.say(builder.value[-1])}: {solution.outcome}")
        if self.done == len(self._targets):
            end = BranchEnd.JUMPED if self.notes else BranchEnd.REACHED
            return end.say(f" {path.say(self._stop)}{self.notes}")
        return None

    def _behind_gap(self, failed: Solution) -> Solution:
        """The solution at the first of four values that has one, and from there, if possible, the one that failed."""
        path, builder, options = self._path, self.builder, self._options
        values = self._targets[self.done : self.done + 4].tolist()
        last = max((i for i, p in enumerate(builder.points) if p.outcome.kind is SolveEnd.CONVERGED), default=None)
        result = None if last is None else arc_length.beyond(path, builder.x[last], values, options.newton)
        if result is None:
            return failed
        value, solution = result
        at = builder.value[-1]
        back = newton.solve(*path.place(at), solution.state.x, options.newton)
        if back.converged:
            builder.truncate(len(builder.value) - 1)
            builder.add(at, back)
            self._jumps.append(at)
        builder.add(value, solution)
        self.done += values.index(value)
        return solution

    def _step(self, value: float, halvings: int) -> Solution:
        """One step to `value`, through points in between where it fails or does not lead back."""
        builder, options = self.builder, self._options
        guess = predict(builder, value, options.rules.least_spacing)
        solution = newton.solve(*self._path.place(value), guess, options.newton)
        led_back = solution.converged and self._leads_back(value, solution.state)
        if not led_back and halvings > 0:
            middle = self._step(0.5 * (builder.value[-1] + value), halvings - 1)
            return self._step(value, halvings - 1) if middle.converged else middle
        builder.add(value, solution)
        if solution.converged and not led_back:
            self._jumps.append(value)
        return solution

    def _leads_back(self, value: float, state: State) -> bool:
        """Whether a step to a value, where it is far from the extrapolation, comes back to the point before.

        It does where that is near the tangent at its end, else where it is solved from there"""
        builder, rules, path, x = self.builder, self._options.rules, self._path, state.x
        origin, before, last = builder.value[-1], builder.x[-1], len(builder.value) - 1
        first = max(builder.stretch, last - EXTRAPOLATION_DEGREE)
        step = np.linalg.norm(x - before)
        if last - first < 1:
            return True
        miss = x - extrapolate(np.array(builder.value[first:]), builder.x[first:], value)
        far = rules.abrupt * max(step, np.linalg.norm(before - builder.x[-2]))  # where it turns, steps are short
        if np.linalg.norm(miss) <= far:
            return True
        slope, _, _ = path.place(value)[0].linearise(state).solve(-path.slope(value, state), rules.same_point)
        if np.linalg.norm(x - before - (value - origin) * slope.reshape(x.shape)) <= far:
            return True
        back = newton.solve(*path.place(origin), x, self._options.newton)
        return back.converged and bool(np.linalg.norm(back.state.x - before) <= rules.same_point * step)


def _by_arc_length(
    path: Parameter, builder: BranchBuilder, failed: Solution, value: float, stop: float, options: Options
) -> Solution:
    """Replace the failed last point by the fold that made it fail, if any, and the solution behind it, at `value`."""
    previous_value, origin, shape, rules = builder.value[-2], builder.value[0], failed.state.x.shape, options.rules
    way = arc_length.Options(
        width=arc_length.Options.width * abs((stop - origin) / (value - previous_value)),
        bounds=(min(origin, value), max(origin, value)),
        guess=builder.x[-2],
        max_points=rules.max_fold_points,
        newton=options.newton,
    )
    curve = arc_length.follow(path, previous_value, value, way)
    arrived = curve.parameter[-1] == value and curve.converged[-1]
    if not (arrived or curve.folds):
        return failed
    builder.truncate(len(builder.value) - 1)
    for first in curve.folds[:1]:
        fold, x = float(curve.parameter[first]), curve.contact[first].reshape(shape)
        builder.add(fold, newton.solve(*path.place(fold), x, options.newton), fold=True)
    if arrived:
        solution = newton.solve(*path.place(value), curve.contact[-1].reshape(shape), options.newton)
    else:
        solution = arc_length.solve_along_load(*path.place(value), options.newton)
        if not solution.converged:
            reason = SolveEnd.AT_FOLD.say(f" {path.say(fold)}; arc_length goes round it")
            solution = replace(solution, outcome=reason)
    builder.add(value, solution)
    return solution


def predict(builder: BranchBuilder, value: float, least_spacing: float = NaturalRules.least_spacing) -> np.ndarray:
    """Extrapolation of the last points to a value of the parameter: (n_pair, n_component, n_coeff) [m].

    Points closer together than half of the step, as halved steps leave them, would blow up their differences; those
    before a fold lie on another leg of the curve."""
    spacing = least_spacing * abs(value - builder.value[-1])
    chosen = [len(builder.value) - 1]
    for i in reversed(range(builder.stretch, chosen[0])):
        if len(chosen) > EXTRAPOLATION_DEGREE:
            break
        if abs(builder.value[i] - builder.value[chosen[-1]]) >= spacing:
            chosen.append(i)
    rows = chosen[::-1]
    return extrapolate(np.array([builder.value[i] for i in rows]), [builder.x[i] for i in rows], value)


def extrapolate(abscissas: np.ndarray, values: Sequence[np.ndarray] | np.ndarray, at: float) -> np.ndarray:
    """Lagrange polynomial through values known at points (n,), taken at another point."""
    places = abscissas.tolist()
    ratios = [[(at - b) / (a - b) for b in places if b != a] for a in places]
    return np.sum([math.prod(w) * value for w, value in zip(ratios, values, strict=True)], axis=0)
