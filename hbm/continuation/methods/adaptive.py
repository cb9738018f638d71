"""Adaptive continuation: natural steps, dense only where the response bends.

After each step the response extrapolated through the last four points is compared with the solved one. The difference
gives the fourth derivative, hence the error of a cubic interpolation between the points; the step is chosen so that
this error stays at the tolerance. A step that was too long is kept as a point further on. At a fold the sweep jumps,
as a measured one does, and says where."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tribodyn.declarations import number, require_limits
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import parameter
from tribodyn.hbm.continuation.branch import Branch, BranchBuilder, OnPoint
from tribodyn.hbm.continuation.methods.arc_length import beyond, solve_along_load
from tribodyn.hbm.continuation.methods.natural import EXTRAPOLATION_DEGREE, extrapolate
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.outcome import BranchEnd, Outcome
from tribodyn.hbm.threads import single
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class AdaptiveRules:
    """When a step is taken back, and when the response has jumped; see docs/developers/ablations.md.

    least_error_share : of the miss of extrapolation that counts as error of interpolation. On a smooth curve the share
        follows from the fourth derivative and may vanish; next to a kink that formula does not hold
    jump_error : error estimate in the shortest step, over the tolerance, beyond which the response has jumped: a step
        that is shorter than the first by thousands of times cannot be that wrong on one and the same curve
    snap_steps : steps ahead within which a point that was solved before, or the stop, is taken for the next one
    crawled : points in the shortest step that miss the tolerance: a response with so many of them is rough however
        close they lie, as where pairs come to rest anew at every point, and the shortest step is doubled
    rejected_error : error estimate, over the tolerance, that takes a step back; one solve is worth a factor of two"""

    least_error_share: float = 0.3
    jump_error: float = 1e3
    snap_steps: float = 1.2
    crawled: int = 50
    rejected_error: float = 2.0


@dataclass(frozen=True)
class Options:
    """How points are placed."""

    tolerance: float = number(default=1e-3, above=0.0)
    """Error of the interpolated response, relative to the largest response met so far, for each output."""
    step: float = number(default=5e-3, above=0.0, high=1.0)
    """First step, relative to the range."""
    max_step: float = number(default=0.05, above=0.0, high=1.0)
    """Longest step, relative to the range."""
    min_step: float = number(default=1e-6, above=0.0, high=1.0)
    """Shortest step, relative to the range; a response that is not found in it, or changes abruptly, has jumped."""
    max_points: int = number(default=5000, low=2)
    """Points after which to end."""
    rules: AdaptiveRules = field(default_factory=AdaptiveRules, kw_only=True)
    newton: NewtonOptions = field(default_factory=NewtonOptions, kw_only=True)
    guess: np.ndarray | None = field(default=None, kw_only=True)
    """(n_pair, n_component, n_coeff) neighbour of the first solution [m]; from rest by default."""
    load_paths: bool = field(default=True, kw_only=True)
    """Whether a jump that Newton does not make is made along the load, which takes as long as many points."""
    jumps: bool = field(default=True, kw_only=True)
    """Whether the response is followed beyond a jump; otherwise the branch ends there."""

    def __post_init__(self) -> None:
        require_limits(self, "adaptive continuation")
        if not self.min_step <= self.step <= self.max_step:
            raise Refusal(
                f"adaptive steps must obey min_step <= step <= max_step, "
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
    """Follow the response from one frequency, or value of a parameter, to another.

    start, stop : [rad/s] or in the unit of the parameter, either order
    on_point : called with points done, points expected at the present pace, and the last point
    Returns a Branch; `end` says where it ends and why, and where the response jumped to another branch on the way"""
    options = options or Options()
    sweep = _AdaptiveSweep(parameter.of(problem), options, start, stop)
    while (end := sweep.advance()) is None:
        sweep.builder.tell(on_point, stop, options.max_points)
    if end.kind is BranchEnd.REACHED:
        sweep.builder.tell(on_point, stop, options.max_points)
    return sweep.builder.finish(end)


class _AdaptiveSweep:
    """The last points, the step to come, and points solved ahead."""

    def __init__(self, path: Parameter, options: Options, start: float, stop: float):
        first = None
        if options.guess is not None:
            first = newton.solve(*path.place(start), options.guess, options.newton)
        if first is None or not first.converged:
            first = solve_along_load(*path.place(start), options.newton)
        self._path, self._options, self._stop = path, options, stop
        self.builder = BranchBuilder(path)
        self.builder.add(start, first)
        self._span = stop - start
        self._step, self._shortest, self._crawled = options.step, options.min_step, 0
        self._ahead: list[tuple[float, Solution]] = []  # the nearest last
        self._clean = 0  # first point after the last jump
        self._response = [self._outputs(start, first)]
        self._largest = self._size(self._response[0])
        self._jumps: list[float] = []
        self._first = first

    @property
    def notes(self) -> str:
        """Where the response jumped to another branch; empty where it did not."""
        places = ", ".join(self._path.say(value) for value in self._jumps)
        return f"; the response jumped at {places}" if places else ""

    def advance(self) -> Outcome[BranchEnd] | None:
        """One point more; why the branch ends, or None."""
        builder, limit = self.builder, self._options.max_points
        trouble = "" if self._first.converged else str(self._first.outcome)
        if not trouble and builder.value[-1] != self._stop:
            trouble = f"{limit} points were allowed" if len(builder.value) >= limit else self._step_on()
        if trouble:
            return BranchEnd.ENDED.say(f" {self._path.say(builder.value[-1])}: {trouble}")
        if builder.value[-1] == self._stop:
            end = BranchEnd.JUMPED if self._jumps else BranchEnd.REACHED
            return end.say(f" {self._path.say(self._stop)}{self.notes}")
        return None

    def _outputs(self, value: float, solution: Solution) -> np.ndarray:
        return self._path.place(value)[0].outputs(solution.state)

    def _size(self, response: np.ndarray) -> np.ndarray:
        """(n_output,) size of a response or of a difference of two [m]."""
        return np.linalg.norm(response, axis=1)

    def _step_on(self) -> str:
        """One point more; a sentence where that fails."""
        origin = self.builder.value[-1]
        while True:
            value, solution = self._solve(origin)
            if not solution.converged:
                if self._step <= self._options.min_step:
                    return "" if self._options.jumps and self._jump(origin) else str(solution.outcome)
                self._step = max(0.25 * self._step, self._options.min_step)
                continue
            response = self._outputs(value, solution)
            error = self._error(value, response)
            step = abs((value - origin) / self._span)
            if error > self._options.rules.rejected_error and step > self._options.rules.snap_steps * self._shortest:
                self._ahead.append((value, solution))
                self._step = max(step * self._factor(error), self._shortest)
                continue
            self._crawled += error > self._options.rules.rejected_error
            if self._crawled == self._options.rules.crawled:
                self._crawled, self._shortest = 0, min(2 * self._shortest, self._options.max_step)
            jumped = error > self._options.rules.jump_error
            if jumped and not self._options.jumps:
                return f"the response jumps at {self._path.say(value)}"
            self._accept(value, solution, response, jumped)
            if not jumped:
                self._step = float(np.clip(step * self._factor(error), self._shortest, self._options.max_step))
            return ""

    def _jump(self, origin: float) -> bool:
        """Continue behind a fold, small or large, where no solution follows on the one here; whether there is one."""
        o, remaining = self._options, (self._stop - origin) / self._span
        values, step = [], o.min_step
        while step < o.max_step:
            step *= 10
            values.append(origin + min(step, remaining) * self._span)
        result = beyond(self._path, self.builder.x[-1], values, o.newton, o.load_paths)
        if result is None:
            return False
        value, solution = result
        self._ahead = [a for a in self._ahead if abs(a[0] - origin) > abs(value - origin)]
        self._accept(value, solution, self._outputs(value, solution), jumped=True)
        return True

    def _factor(self, error: float) -> float:
        return float(np.clip(0.9 * max(error, 1e-12) ** (-1 / (EXTRAPOLATION_DEGREE + 1)), 0.2, 2.0))

    def _solve(self, origin: float) -> tuple[float, Solution]:
        """The next point: the stop or one solved ahead where it is near, else one solved anew."""
        value = origin + self._step * self._span
        if self._ahead and abs(self._ahead[-1][0] - origin) <= self._options.rules.snap_steps * abs(value - origin):
            return self._ahead.pop()
        if abs(self._stop - origin) <= self._options.rules.snap_steps * abs(value - origin):
            value = self._stop
        first = max(self._clean, len(self.builder.value) - EXTRAPOLATION_DEGREE - 1)
        guess = extrapolate(np.array(self.builder.value[first:]), self.builder.x[first:], value)
        return value, newton.solve(*self._path.place(value), guess, self._options.newton)

    def _error(self, value: float, response: np.ndarray) -> float:
        """Estimated error of interpolation in the step to a value, relative to the tolerance."""
        first = max(self._clean, len(self.builder.value) - EXTRAPOLATION_DEGREE - 1)
        parameters = np.array(self.builder.value[first:])
        if len(parameters) < EXTRAPOLATION_DEGREE:  # too few points to tell: the first steps are short anyway
            return 1.0
        missed = self._size(response - extrapolate(parameters, self._response[first:], value))
        window = np.append(parameters[1:], value)  # of the polynomial that interpolates here, at worst
        between = np.linspace(parameters[-1], value, 9)[1:-1]
        share = np.abs(np.prod(between[:, None] - window, axis=1)).max() / np.abs(np.prod(value - parameters))
        share = max(share, self._options.rules.least_error_share)
        scale = np.maximum(self._largest, self._size(response))
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = np.where(scale > 0, missed / scale, 0.0)
        return float(share * relative.max(initial=0.0) / self._options.tolerance)

    def _accept(self, value: float, solution: Solution, response: np.ndarray, jumped: bool) -> None:
        self.builder.add(value, solution)
        self._response.append(response)
        self._largest = np.maximum(self._largest, self._size(response))
        if jumped:
            self._jumps.append(value)
            self._clean = len(self.builder.value) - 1
            self._step = self._options.step
