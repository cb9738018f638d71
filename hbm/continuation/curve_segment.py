"""Points and segments of a solution curve: interpolation between two points, kinks, and the fold between them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tribodyn.hbm.continuation import bordered
from tribodyn.hbm.continuation.bordered import BorderFailed, Direction, Metric
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.outcome import CONVERGED


@dataclass(frozen=True)
class CurveRules:
    """How a step along a curve and a fold within it are judged; see docs/developers/ablations.md."""

    kink_angle: float = 0.75  # turn between neighbouring points beyond which they lie on either side of a kink [rad]
    # of Newton's tolerance elsewhere: near a fold the state goes as the root of the parameter
    fold_newton_share: float = 1e-3
    fold_trials: int = 80
    fold_tangent_accuracy: float = 1e-10  # relative; the sign of their frequency part says where the fold is
    # Slant of a step, the angle between its chord and the mean of its tangents, up to which it needs no check [rad]:
    # the slant of a smooth curve falls with the square of the step, and few steps have more.
    largest_slant: float = 0.03
    # A tangent that turns past a fold and back past its partner turns by at least the angles that both ends have to a
    # fold. A step whose ends differ by more than that over this factor may hide such a pair.
    fold_turn: float = 1.2
    turn_at_fold: float = 0.35  # of the tangent, in a step over a fold, beyond which it may have passed three [rad]


RULES = CurveRules()


@dataclass(frozen=True, eq=False)
class CurvePoint:
    """A point of the curve.

    place : (x, p); tangent : unit tangent, which points along the walk
    solution : what was solved there, None once it is behind"""

    place: Direction
    tangent: Direction
    solution: Solution | None = None
    fold: bool = False

    @classmethod
    def of(cls, value: float, solution: Solution, tangent: Direction, fold: bool = False) -> CurvePoint:
        """The point of a solution."""
        return cls(Direction(solution.state.flat, value), tangent, solution, fold)

    @property
    def value(self) -> float:
        """The parameter."""
        return self.place.p

    @property
    def solved(self) -> Solution:
        """The solution of a point that is not behind yet."""
        if self.solution is None:
            raise RuntimeError("the point lies behind: its solution is gone")
        return self.solution

    def bare(self) -> CurvePoint:
        """The point without its solution, which is large."""
        return replace(self, solution=None)


@dataclass(frozen=True, eq=False)
class Segment:
    """The curve between two neighbouring points, in one metric."""

    start: CurvePoint
    end: CurvePoint
    metric: Metric

    @cached_property
    def chord(self) -> Direction:
        """From start to end."""
        return self.end.place - self.start.place

    @cached_property
    def length(self) -> float:
        """Length of the chord."""
        return self.metric.norm(self.chord)

    @cached_property
    def angle(self) -> float:
        """Turn of the tangent between the ends [rad]."""
        return float(np.arccos(np.clip(self.metric.dot(self.start.tangent, self.end.tangent), -1.0, 1.0)))

    @cached_property
    def mean_tangent(self) -> Direction:
        """Unit direction along which both ends advance alike, so that hyperplanes normal to it cut the curve once."""
        return self.metric.unit(self.start.tangent + self.end.tangent)

    @cached_property
    def slant(self) -> float:
        """Angle between the chord and `mean_tangent` [rad]: zero on a circle, at most half of the turn round a kink."""
        advance = self.metric.dot(self.chord, self.mean_tangent)
        return float(np.arctan2(np.sqrt(max(self.length**2 - advance**2, 0.0)), advance))

    @cached_property
    def corner(self) -> tuple[float, float, float]:
        """Where the tangents of the ends come closest: ahead of the start, before the end, and how far apart."""
        cosine = np.cos(self.angle)
        advance_at_start, advance_at_end = (
            self.metric.dot(self.chord, self.start.tangent),
            self.metric.dot(self.chord, self.end.tangent),
        )
        sine2 = max(1.0 - cosine**2, 1e-30)  # parallel tangents meet far away, not beyond all numbers
        a, b = (
            (advance_at_start - cosine * advance_at_end) / sine2,
            (advance_at_end - cosine * advance_at_start) / sine2,
        )
        miss = self.chord - self.start.tangent * a - self.end.tangent * b
        return a, b, self.metric.norm(miss)

    @property
    def turns(self) -> bool:
        """Whether the parameter turns back between the ends, none of which is the fold itself."""
        if self.start.fold or self.end.fold:
            return False
        return self.start.tangent.p * self.end.tangent.p < 0

    @property
    def doubtful(self) -> bool:
        """Whether the ends alone do not tell the curve between: it may leave its branch, or turn back twice."""
        if self.slant > RULES.largest_slant:
            return True
        if self.turns:
            return False
        to_fold = sum(np.arcsin(min(abs(end.tangent.p) / self.metric.width, 1.0)) for end in (self.start, self.end))
        return bool(to_fold < RULES.fold_turn * self.angle)

    @property
    def distance_to_fold(self) -> float:
        """Arc length from the end to where its tangent, turning on as before, has no share in the parameter."""
        before, after = self.start.tangent.p, self.end.tangent.p
        if self.end.fold or before * after <= 0 or abs(after) >= abs(before):
            return np.inf
        return self.length * abs(after) / (abs(before) - abs(after))

    def bare(self) -> Segment:
        """The segment without the solutions at its ends."""
        return Segment(self.start.bare(), self.end.bare(), self.metric)

    def meets(self, other: Segment) -> bool:
        """Whether the ranges of the parameter of two segments meet."""
        low, high = sorted((self.start.value, self.end.value))
        a, b = sorted((other.start.value, other.end.value))
        return a <= high and low <= b

    def crosses(self, bound: float) -> bool:
        """Whether the segment leaves through a bound of the parameter; one that starts on it may leave it inwards."""
        a, b = self.start.value - bound, self.end.value - bound
        return a * b < 0 or (b == 0.0 and a != 0.0)

    def at(self, s: float) -> Direction:
        """The Hermite cubic through the ends and their tangents at s in 0..1, or two straight lines round a kink."""
        if self.angle > RULES.kink_angle:
            a, b, _ = self.corner
            if s * (a + b) < a:
                return self.start.place + self.start.tangent * (s * (a + b))
            return self.end.place - self.end.tangent * ((1 - s) * (a + b))
        h = self.length
        return (
            self.start.place * ((1 + 2 * s) * (1 - s) ** 2)
            + self.end.place * (s * s * (3 - 2 * s))
            + self.start.tangent * (h * s * (1 - s) ** 2)
            + self.end.tangent * (h * s * s * (s - 1))
        )

    def guess_at(self, bound: float) -> np.ndarray:
        """(n_contact, n_coeff) x of the interpolation where it crosses a bound of the parameter."""
        low, high = 0.0, 1.0
        side = np.sign(self.start.value - bound)
        for _ in range(50):
            s = 0.5 * (low + high)
            if np.sign(self.at(s).p - bound) == side:
                low = s
            else:
                high = s
        return self.at(high).x

    def passes(self, path: Parameter, point: CurvePoint, sense: float, options: NewtonOptions) -> bool:
        """Whether the segment passes through a known point, in its sense (1) or against it (-1).

        A close call is decided by solving in the hyperplane through the point, from the segment"""
        if self.length == 0.0 or point is self.start or point is self.end or self.angle > RULES.kink_angle:
            return False
        metric = self.metric
        s = metric.dot(point.place - self.start.place, self.chord) / self.length**2
        border = metric.unit(point.tangent)
        if not 0.0 <= s <= 1.0 or sense * metric.dot(border, self.chord) < 0.9 * self.length:
            return False
        point_on_segment = self.at(s)
        if metric.norm(point.place - point_on_segment) > 0.05 * self.length:
            return False
        guess = point_on_segment + border * metric.dot(point.place - point_on_segment, border)
        solution, value = bordered.correct(path, guess, border, metric, options)
        miss = metric.norm(Direction(solution.state.flat, value) - point.place)
        return solution.converged and miss < 1e-4 * self.length


def locate_fold(path: Parameter, segment: Segment, options: NewtonOptions, tolerance: float) -> CurvePoint | None:
    """The point between the ends of a segment where the parameter turns back: the tangent's share in it is zero.

    tolerance : relative, on the parameter
    Returns the fold, also where it is a kink with tangents of either sign beside it; None where a solve fails"""
    tight = replace(options, tolerance=max(RULES.fold_newton_share * options.tolerance, 1e-13))
    metric = segment.metric
    try:
        ends = [replace(p, tangent=_sharp_tangent(path, p, metric, tight)) for p in (segment.start, segment.end)]
        if ends[0].tangent.p * ends[1].tangent.p >= 0:  # one end is the fold, up to the accuracy of its tangent before
            return replace(min(ends, key=lambda end: abs(end.tangent.p)), fold=True)
        segment, weight, corner = Segment(ends[0], ends[1], metric), [1.0, 1.0], np.inf
        for _ in range(RULES.fold_trials):
            before, corner = corner, _corner_value(segment)
            is_stationary = abs(corner - before) <= 0.1 * tolerance * abs(corner)
            guess = segment.at(_share(segment, weight, is_stationary))
            solution, value = bordered.correct(path, guess, segment.mean_tangent, metric, tight)
            if min(solution.history) > options.tolerance:
                return None
            tangent = bordered.tangent(
                path, value, solution.state, segment.mean_tangent, metric, tight, RULES.fold_tangent_accuracy
            )
            point = CurvePoint.of(value, replace(solution, outcome=CONVERGED), tangent, fold=True)
            if tangent.p * segment.start.tangent.p > 0:  # Illinois: halve the weight of an end that stays
                segment, weight = Segment(point, segment.end, metric), [1.0, 0.5 * weight[1]]
            else:
                segment, weight = Segment(segment.start, point, metric), [0.5 * weight[0], 1.0]
            steepest = max(abs(segment.start.tangent.p), abs(segment.end.tangent.p))
            slope = abs(tangent.p) if segment.angle < RULES.kink_angle else steepest
            if is_stationary or slope * segment.length <= tolerance * abs(value) or segment.length < 1e-13:
                return point
    except BorderFailed:
        return None
    return point


def _sharp_tangent(path: Parameter, point: CurvePoint, metric: Metric, options: NewtonOptions) -> Direction:
    """The tangent of a point, more accurate than the walk has it; raises BorderFailed."""
    balance, omega = path.place(point.value)
    flat = point.place.x
    state = balance.evaluate(omega, balance.shaped(flat))
    return bordered.tangent(path, point.value, state, point.tangent, metric, options, RULES.fold_tangent_accuracy)


def _corner_value(segment: Segment) -> float:
    """The parameter where the tangents of the ends meet; none where the segment is smooth."""
    a, b, _ = segment.corner
    if segment.angle <= RULES.kink_angle or min(a, b) <= 0:
        return float("nan")
    return segment.start.value + a * segment.start.tangent.p


def _share(segment: Segment, weight: list[float], is_stationary: bool) -> float:
    """Where between its ends to look for the fold of a segment, 0..1.

    Round a corner it is on the longer leg, close to where the tangents meet, so that both legs get short in turn and
    the meeting point settles; there at last. Elsewhere it is the secant's zero of the tangent's share in the parameter.
    """
    if segment.angle > RULES.kink_angle:
        a, b, _ = segment.corner
        if min(a, b) <= 0:
            return 0.5
        if is_stationary:
            return a / (a + b)
        return (0.9 * a if a > b else a + 0.1 * b) / (a + b)
    a, b = abs(segment.start.tangent.p) * weight[0], abs(segment.end.tangent.p) * weight[1]
    return float(np.clip(a / (a + b), 0.02, 0.98))
