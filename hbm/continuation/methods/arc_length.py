"""Pseudo arc length continuation: the solution curve in (x, parameter) is followed round its folds.

One step: predict along the tangent (bent by the last change of the tangent), correct in the hyperplane normal to it.
The step grows and shrinks with the Newton steps and the turn of the tangent. Kinks, as contact laws make them, are
crossed where their two legs are straight and meet; behind one that turns by more than a right angle the curve is looked
for in the directions that the derivative there offers. A step whose chord is not along its tangents is halved until it
shows whether it stays on its branch, and none is taken to a neighbouring one. A walk that comes back onto its own way
took a wrong turn: it is rewound and resumes in shorter steps. Where all that fails, as where contacts impact and the
curve has gaps, the parameter alone takes a short step over the place, and the branch says where.
Source  Keller 1977 (pseudo arc length); step control and kinks ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tribodyn.declarations import number, require_limits
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import parameter
from tribodyn.hbm.continuation.branch import Branch, BranchBuilder, OnPoint
from tribodyn.hbm.continuation.curve_segment import CurvePoint, Segment
from tribodyn.hbm.continuation.curve_stepper import CurveStepper
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.continuation.stiffening import solve_along_friction, solve_along_stiffness
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.outcome import CONVERGED, BranchEnd, Outcome, SolveEnd
from tribodyn.hbm.threads import single
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class ArcLengthRules:
    """What a walk does where the curve ends, turns into itself or brings nothing; see docs/developers/ablations.md.

    gap_steps : of the parameter over a gap in the curve, shares of its range, tried in turn; the last one, which could
        miss a peak, along the load, too
    max_gaps : a curve with more is none
    max_rewinds : times that a walk which came back onto its own way goes back, to four times shorter steps
    headway : share of the range that `patience` waits for
    max_landings : times that it goes back from a bound where it lands on another branch
    ramp_patience : points of a curve over the load that brings no more load; whole curves take 190 or so"""

    gap_steps: tuple[float, ...] = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
    max_gaps: int = 20
    max_rewinds: int = 4
    headway: float = 1e-3
    max_landings: int = 20
    ramp_patience: int = 150


@dataclass(frozen=True)
class Options:
    """How a curve is followed. An arc length of one is the size of the vibration, or `width` times the range.

    bounds : values of the parameter between which the curve is followed, start and stop by default
    guess : (n_pair, n_component, n_coeff) neighbour of the first solution [m]; from rest by default
    patience : points in which the curve has to come further from its start by `rules.headway`; any by default"""

    step: float = number(default=0.05, above=0.0)
    """Arc length of the first step."""
    max_step: float = number(default=0.25, above=0.0)
    """Arc length of the longest step."""
    min_step: float = number(default=1e-6, above=0.0)
    """Arc length of the shortest step."""
    width: float = number(default=0.1, above=0.0)
    """Share of the range of the parameter that counts as an arc length of one."""
    angle: float = number("rad", default=0.25, above=0.0)
    """Turn of the tangent that one step aims at."""
    newton_target: int = number(default=4, low=1)
    """Newton steps that one step of the curve aims at."""
    newton_limit: int = number(default=12, low=1)
    """Newton steps after which the step of the curve is halved."""
    max_points: int = number(default=5000, low=2)
    """Points after which to end."""
    max_growth: float = number(default=1e8, above=1.0)
    """Response over that of the first point at which the curve is taken to be lost."""
    fold_tolerance: float = number(default=1e-9, above=0.0)
    """Relative accuracy of the parameter at a fold."""
    bounds: tuple[float, float] | None = field(default=None, kw_only=True)
    guess: np.ndarray | None = field(default=None, kw_only=True)
    patience: int | None = field(default=None, kw_only=True)
    rules: ArcLengthRules = field(default_factory=ArcLengthRules, kw_only=True)
    newton: NewtonOptions = field(default_factory=NewtonOptions, kw_only=True)

    def __post_init__(self) -> None:
        require_limits(self, "continuation by arc length")
        if not self.min_step <= self.step <= self.max_step:
            raise Refusal(
                f"arc length steps must obey min_step <= step <= max_step, "
                f"not {self.min_step:g}, {self.step:g}, {self.max_step:g}"
            )


@single
def follow(
    problem: HarmonicBalance | Parameter,
    start: float,
    stop: float,
    options: Options | None = None,
    on_point: OnPoint | None = None,
) -> Branch:
    """Follow the solution curve from `start` towards `stop`, folds included, until it leaves the bounds.

    start, stop : [rad/s] or in the unit of the parameter, either order
    on_point : called with points done, points expected at the present pace, and the last point
    Returns a Branch with its folds; its end says whether it reached the stop, came back, closed on itself or got stuck
    Raises  Refusal where start and stop are the same or out of the bounds"""
    options = options or Options()
    path, bounds = parameter.of(problem), options.bounds or (min(start, stop), max(start, stop))
    if start == stop:
        raise Refusal(f"start and stop are the same, {path.say(start)}: there is no curve to follow")
    if not bounds[0] <= start <= bounds[1]:
        raise Refusal(f"the start, {path.say(start)}, lies outside of the bounds of the continuation")
    if options.guess is not None:
        first = newton.solve(*path.place(start), options.guess, options.newton)
    else:
        first = first_on(path, start, options.newton)
    walk = _Walk(path, options, first, start, stop, bounds)
    while (end := walk.advance()) is None:
        walk.builder.tell(on_point, stop, options.max_points)
    return walk.builder.finish(end)


def first_on(path: Parameter, value: float, options: NewtonOptions) -> Solution:
    """The first point of a path, without a neighbouring one: from rest, by other ways where that fails.

    On a path over the load these ways would be the path itself"""
    solve = newton.solve_from_rest if path.name == parameter.LOAD else solve_along_load
    return solve(*path.place(value), options)


@single
def solve_along_load(balance: HarmonicBalance, omega: float, options: NewtonOptions | None = None) -> Solution:
    """Solve at one frequency [rad/s] without a neighbouring solution, also where the curve in the load has folds.

    Where a contact law names a simpler one, Newton from that one's solution and the way from soft springs come first:
    the curve over the load has corners where a pair can just stick. Then Newton from rest and its load ramp are tried,
    and where it finds no rest, from that by falling friction; a body that then slides away has no other way. Else the
    curve of solutions over the load is followed, which leads where a rising load would, or, where it turns back,
    through no load to the opposite one, whose solution is that of half a period later if all loads have odd harmonics;
    where that ends too, friction falls from where all closed pairs stick, and then the contact is stiffened from soft
    springs
    Returns a Solution; its outcome is the one from rest where no way leads to the load"""
    options = options or NewtonOptions()
    if (simpler := balance.simpler()) is not None:
        simple_solution = solve_along_load(simpler, omega, options)
        solution = newton.solve(balance, omega, simple_solution.state.x, options)
        reached = (
            solution
            if simple_solution.converged and solution.converged
            else solve_along_stiffness(balance, omega, options)
        )
        if reached:
            return reached
    first = newton.solve_from_rest(balance, omega, options)
    if first.outcome.kind is SolveEnd.NO_REST and (
        rest_state := solve_along_friction(balance.with_load(0.0), omega, options)
    ):
        first = newton.solve_from_rest(balance, omega, options, rest_state)
    if first.converged or first.outcome.kind is SolveEnd.NOT_HELD:
        return first
    full, loads = balance.load_factor, balance.excitation
    odd = loads.base is None and all(h % 2 or h == 0 for h, _ in loads.loads)
    ramp_options = Options(
        newton=options, patience=ArcLengthRules.ramp_patience, bounds=(-full, full) if odd else (0.0, full)
    )
    ramp = follow(parameter.load(balance, omega), 0.0, full, ramp_options)
    if abs(ramp.parameter[-1]) == full:
        half_later = (-1.0) ** balance.basis.order if ramp.parameter[-1] < 0 else 1.0
        last = newton.solve(balance, omega, half_later * ramp.contact[-1].reshape(first.state.x.shape), options)
        if last.converged:
            return last
    alternative = solve_along_friction(balance, omega, options) or solve_along_stiffness(balance, omega, options)
    return alternative or first


def beyond(
    path: Parameter, x: np.ndarray, values: Sequence[float], options: NewtonOptions, load_paths: bool = True
) -> tuple[float, Solution] | None:
    """The first of some values that has a solution, near a neighbouring x or else along the load; None without one."""
    for value in values:
        solution = newton.solve(*path.place(value), x, options)
        if not solution.converged and load_paths:
            solution = solve_along_load(*path.place(value), options)
        if solution.converged:
            return value, solution
    return None


class _Walk:
    """Steps taken into a branch, and the reasons to end it."""

    def __init__(
        self, path: Parameter, options: Options, first: Solution, start: float, stop: float, bounds: tuple[float, float]
    ):
        self._path, self._options, self._bounds = path, options, bounds
        self._start, self._reach = start, abs(stop - start)
        self.builder = BranchBuilder(path)
        self.builder.add(start, first)
        if first.converged:
            self._stepper = CurveStepper(path, options, first, start, stop)
        self._first: CurvePoint | None = None
        self._size = float(np.linalg.norm(self.builder.x[0]))
        self._rows = [1]  # points in the branch before each segment
        self._rewinds = self._landings = 0
        self._jumps: list[float] = []
        self._milestone, self._since = self._start, 1  # how far it came, and how many points there were then

    @property
    def notes(self) -> str:
        """Where the walk stepped over gaps in the curve; empty where it did not."""
        places = ", ".join(self._path.say(value) for value in self._jumps)
        return f"; stepped over gaps in the curve at {places}" if places else ""

    def advance(self) -> Outcome[BranchEnd] | None:
        """One step more; why the branch ends, or None."""
        end = self._step_on()
        return None if end is None else end.kind.say(end.detail + self.notes)

    def _step_on(self) -> Outcome[BranchEnd] | None:
        builder, path = self.builder, self._path
        place = path.say(builder.value[-1])
        if builder.points[0].outcome != CONVERGED:
            return BranchEnd.ENDED.say(f" {place}: {builder.points[0].outcome}")
        if len(builder.value) >= self._options.max_points:
            return BranchEnd.ENDED.say(f" {place}: {self._options.max_points} points were allowed")
        if self._is_stuck():
            reason = f"{self._options.patience} points brought it hardly further than {path.say(self._milestone)}"
            return BranchEnd.ENDED.say(f" {place}: {reason}")
        parts = self._stepper.advance()
        if not parts:
            if self._jump():
                return None
            return BranchEnd.ENDED.say(f" {place}: {self._stepper.trouble}")
        self._first = self._first or parts[0].start.bare()
        for part in parts:
            bound = next((b for b in self._bounds if part.crosses(b)), None)
            if bound is not None:
                return self._land(part, bound)
            if part.turns:  # a fold that is a kink, right behind the last point
                builder.mark_fold()
            builder.add(part.end.value, part.end.solved, fold=part.end.fold)
        self._rows.append(len(builder.value))
        return self._came_back(parts)

    def _is_stuck(self) -> bool:
        """Whether the points that the patience allows brought the walk hardly further."""
        current, count = self.builder.value[-1], len(self.builder.value)
        if abs(current - self._start) > abs(self._milestone - self._start) + self._options.rules.headway * self._reach:
            self._milestone, self._since = current, count
        return self._options.patience is not None and count >= self._since + self._options.patience

    def _jump(self) -> bool:
        """Step over a gap in the curve, its parameter moving on as before; whether there is a solution behind."""
        origin, span, sense = self.builder.value[-1], self._bounds[1] - self._bounds[0], self._stepper.sense
        o, path, x = self._options, self._path, self.builder.x[-1]
        steps = [share * span for share in o.rules.gap_steps if len(self._jumps) < o.rules.max_gaps and sense]
        values = [value for value in (origin + sense * s for s in steps) if self._bounds[0] < value < self._bounds[1]]
        result = beyond(path, x, values[: len(o.rules.gap_steps) - 1], o.newton, load_paths=False)
        if result is None and path.name != parameter.LOAD:
            result = beyond(path, x, values[len(o.rules.gap_steps) - 1 :], o.newton)
        if result is not None:
            value, solution = result
            self._jumps.append(value)
            self.builder.add(value, solution)
            self._stepper = CurveStepper(path, o, solution, value, value + sense * self._reach)
            self._rows, self._first = [len(self.builder.value)], None
            return True
        return False

    def _land(self, part: Segment, bound: float) -> Outcome[BranchEnd] | None:
        """Solve at the bound that the curve crosses; None where that leads elsewhere, and shorter steps are to come."""
        balance, omega = self._path.place(bound)
        flat = part.guess_at(bound)
        guess = balance.shaped(flat)
        last = newton.solve(balance, omega, guess, self._options.newton)
        astray = last.converged and not self._stepper.arrives(part, bound, last)
        if astray and part.length > self._options.min_step and self._landings < self._options.rules.max_landings:
            self._landings += 1
            self._rewind(len(self._stepper.segments) - 1)
            return None
        self.builder.add(bound, last)
        if astray:
            return BranchEnd.ENDED.say(f" {self._path.say(bound)}: the curve jumps to another branch there")
        if not last.converged:
            return BranchEnd.ENDED.say(f" {self._path.say(bound)}: {last.outcome}")
        end = BranchEnd.TURNED_BACK if bound == self._start else BranchEnd.REACHED
        return end.say(f" {self._path.say(bound)}")

    def _came_back(self, parts: list[Segment]) -> Outcome[BranchEnd] | None:
        """Whether the curve is closed, or lost itself in infinity or in its own past."""
        builder, place, newton_options = self.builder, self._path.say(self.builder.value[-1]), self._options.newton
        growth = self._options.max_growth
        if np.linalg.norm(builder.x[-1]) > growth * self._size > 0:
            reason = f"the response grows without bound, {growth:.0e} times that of the first point"
            return BranchEnd.ENDED.say(f" {place}: {reason}")
        first, history = self._first, self._stepper.segments
        if first and len(history) > 3 and any(p.passes(self._path, first, 1.0, newton_options) for p in parts):
            return BranchEnd.CLOSED.say(f": came back to its first point after {len(builder.value)} points")
        return self._lost(parts, place)

    def _lost(self, parts: list[Segment], place: str) -> Outcome[BranchEnd] | None:
        """Whether the walk is back on its own way: then it went wrong there, is rewound and continues in shorter steps.

        Against its sense it turned where it should not; in its sense it left the curve for a closed one beside it."""
        history, newton_options = self._stepper.segments, self._options.newton
        for index in range(1, len(history) - 2):
            candidates = [p for p in parts if p.meets(history[index])]
            for sense in (-1.0, 1.0):
                if not any(p.passes(self._path, history[index].start, sense, newton_options) for p in candidates):
                    continue
                if self._rewinds == self._options.rules.max_rewinds:
                    return BranchEnd.ENDED.say(f" {place}: the curve came back onto itself")
                self._rewinds += 1
                index = index if sense < 0 else max(index - 2, 0)
                self._rewind(index)
                return None
        return None

    def _rewind(self, index: int) -> None:
        """Back to the start of an earlier segment."""
        self._stepper.rewind(index)
        self.builder.truncate(self._rows[index])
        del self._rows[index + 1 :]
