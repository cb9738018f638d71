"""One step along a solution curve: predict, correct, judge; smooth stretches, kinks and sharp corners."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tribodyn.hbm.continuation import bordered, curve_segment
from tribodyn.hbm.continuation.bordered import BorderFailed, Direction, Metric
from tribodyn.hbm.continuation.curve_segment import CurvePoint, Segment, locate_fold
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.newton import Solution

if TYPE_CHECKING:
    from tribodyn.hbm.continuation.methods.arc_length import Options


@dataclass(frozen=True)
class CurveStepRules:
    """How long the steps along a curve are; see docs/developers/ablations.md."""

    # the characteristic length falls to this share per point where the vibration gets small
    least_length_ratio: float = 0.8
    # Miss of the prediction, in steps, beyond which the step is too long: two legs that meet in a right angle miss by
    # more.
    largest_miss: float = 0.35
    tangent_accuracy: float = 1e-6  # relative; a tangent here only predicts, and the prediction is off by far more
    max_halvings: int = 6  # of a step that is in doubt: a jump of the least doubtful slant has shown itself after four
    # Step beyond the place where the tangents of the last two points foresee a fold, in distances to it: a step that
    # lands behind that fold finds it, a longer one may land behind its partner too and see neither.
    fold_reach: float = 2.0


RULES = CurveStepRules()


class CurveStepper:
    """The point reached and the step to come.

    first : the solution at `start`; the walk sets out in the direction of `stop`, or of the heading where one is given
    trouble : why the last step that failed did
    segments : the curve behind, without its solutions"""

    def __init__(
        self, path: Parameter, options: Options, first: Solution, start: float, stop: float,
        heading: Direction | None = None,
    ):  # fmt: skip
        self._path, self._options = path, options
        self._newton = replace(options.newton, max_steps=min(options.newton_limit, options.newton.max_steps))
        self._width = options.width * abs(stop - start)
        self._order = path.place(start)[0].basis.order
        self._reference = first.state.flat
        self._length = 0.0
        self._metric = self._measure(self._reference)
        onward = Direction(np.zeros_like(self._reference), float(np.sign(stop - start)))
        forward = self._metric.unit(heading or onward)
        self._point = CurvePoint.of(start, first, self._tangent(start, first, forward) or forward)
        self._bend: Direction | None = None
        self._step = options.step
        self.segments: list[Segment] = []
        self.trouble = ""

    def _measure(self, flat: np.ndarray) -> Metric:
        """The metric at a point: its length is the size of the vibration or the way that x has gone, of late."""
        vibration = np.linalg.norm(flat[:, self._order > 0])
        distance = float(np.linalg.norm(flat - self._reference))
        self._length = max(float(vibration), distance, RULES.least_length_ratio * self._length)
        length = self._length or float(np.linalg.norm(flat)) or 1.0
        return Metric(length, self._width)

    def _tangent(self, value: float, solution: Solution, border: Direction) -> Direction | None:
        try:
            return bordered.tangent(
                self._path, value, solution.state, border, self._metric, self._options.newton, RULES.tangent_accuracy
            )
        except BorderFailed:
            return None

    @property
    def sense(self) -> float:
        """Sign of the way that the parameter goes at the point reached."""
        return float(np.sign(self._point.tangent.p))

    def rewind(self, index: int) -> None:
        """Go back to the start of an earlier segment, and on from there in shorter steps."""
        segment = self.segments[index]
        del self.segments[index:]
        self._point, self._metric, self._bend = segment.start, segment.metric, None
        self._step = max(0.25 * segment.length, self._options.min_step)

    def advance(self) -> list[Segment]:
        """The curve to the next point in segments that end at its folds; none where the walk is stuck."""
        step = self._step
        while step >= self._options.min_step:
            trial = self._straight(step)
            if trial is None or trial.angle > curve_segment.RULES.kink_angle:
                trial = self._round_corner(step, trial) or trial
            pieces = None if trial is None else self._fitting(trial, step)
            if trial is not None and pieces is not None:
                parts = self._split(pieces, careful=step > 0.1 * self._step)
                if parts is not None:
                    self._accept(trial, pieces[-1], step)
                    return parts
            step *= 0.5 if trial is not None else 0.25
        return []

    def _ahead(self, step: float) -> Direction:
        """Where the curve is expected after a step."""
        prediction = self._point.place + self._point.tangent * step
        return prediction if self._bend is None else prediction + self._bend * (0.5 * step * step)

    def _straight(self, step: float) -> Segment | None:
        """One step in the hyperplane normal to the tangent; None where no solution is found there."""
        start = self._point
        solution, value = bordered.correct(self._path, self._ahead(step), start.tangent, self._metric, self._newton)
        if not solution.converged:
            self.trouble = f"no solution found in a step of {step:.1e}: {solution.outcome}"
            return None
        chord = Direction(solution.state.flat, value) - start.place
        tangent = self._tangent(value, solution, start.tangent) or self._metric.unit(chord)
        return Segment(start, CurvePoint.of(value, solution, tangent), self._metric)

    def _fitting(self, trial: Segment, step: float) -> list[Segment] | None:
        """The pieces of a step that is short for the curve, or turns at a corner whose legs are straight and meet."""
        stray = self._metric.norm(trial.end.place - self._ahead(step))
        if trial.angle <= curve_segment.RULES.kink_angle and stray <= RULES.largest_miss * step:
            pieces = self._pieces(trial, RULES.max_halvings)
            if pieces is None:
                self.trouble = f"the curve jumps to another branch at every step down to {step:.1e}"
            return pieces
        self.trouble = f"the curve turns sharply, or jumps, at every step down to {step:.1e}"
        if trial.angle < RULES.largest_miss:
            return None
        first, second, miss = trial.corner
        if min(first, second) < -0.02 * step or first + second > 2 * step or miss > 0.05 * trial.length:
            return None
        straight = self._is_straight(trial.start, 0.95 * first) and self._is_straight(trial.end, -0.95 * second)
        return [trial] if straight else None

    def _pieces(self, part: Segment, halvings: int) -> list[Segment] | None:
        """The step, cut by points between where its ends leave a doubt; None where it leaves its branch.

        On a smooth curve the slant falls with the square of the length. At a kink it stays below half of the turn.
        Across the gap between two branches that run side by side it grows as the length falls."""
        if halvings == 0 or not part.doubtful:
            return [part]
        if part.slant > 0.5 * curve_segment.RULES.kink_angle:
            return None
        solution, value = bordered.correct(self._path, part.at(0.5), part.mean_tangent, part.metric, self._newton)
        tangent = self._tangent(value, solution, part.mean_tangent) if solution.converged else None
        if tangent is None:
            return None
        middle = CurvePoint.of(value, solution, tangent)
        pieces: list[Segment] = []
        for half in (Segment(part.start, middle, part.metric), Segment(middle, part.end, part.metric)):
            half_pieces = self._pieces(half, halvings - 1)
            if half_pieces is None:
                return None
            pieces += half_pieces
        return pieces

    def arrives(self, part: Segment, value: float, solution: Solution) -> bool:
        """Whether a solution at a value within a part of the walk belongs to its branch."""
        tangent = self._tangent(value, solution, part.end.tangent)
        if tangent is None:
            return True
        way = Segment(part.start, CurvePoint.of(value, solution, tangent), part.metric)
        if way.length < self._options.min_step or way.angle > curve_segment.RULES.kink_angle:
            return True
        return self._pieces(way, RULES.max_halvings) is not None

    def _is_straight(self, point: CurvePoint, step: float) -> bool:
        """Whether the curve keeps the tangent of a point over a step, as a leg of a corner does."""
        prediction = point.place + point.tangent * step
        solution, value = bordered.correct(self._path, prediction, point.tangent, self._metric, self._newton)
        tangent = self._tangent(value, solution, point.tangent)
        return solution.converged and tangent is not None and self._metric.dot(tangent, point.tangent) > 0.99

    def _round_corner(self, step: float, trial: Segment | None) -> Segment | None:
        """The curve behind a kink where it turns so sharply that no hyperplane ahead meets it, or meets it far away.

        trial : a segment that ends on the leg behind the kink, if there is one
        The derivative ahead of the kink is that of its other side: along the null direction there, either way, the
        curve goes. A point is sought in the hyperplane that both legs cross in their sense, and none that lies on
        the leg we came on."""
        start, metric = self._point, self._metric
        ahead = start.place + start.tangent * step
        for leg in self._legs(ahead) if trial is None else [trial.end.tangent]:
            border = start.tangent + leg
            if metric.norm(border) < 1e-3:
                continue
            solution, value = bordered.correct(self._path, ahead, metric.unit(border), metric, self._newton)
            tangent = self._tangent(value, solution, leg) if solution.converged else None
            if tangent is None:
                continue
            segment = Segment(start, CurvePoint.of(value, solution, tangent), metric)
            if curve_segment.RULES.kink_angle < segment.angle < np.pi - 1e-3 - 2 * step:
                return segment
        return None

    def _legs(self, ahead: Direction) -> list[Direction]:
        """Directions in which the curve may continue, from the derivative at a place that need not lie on the curve."""
        balance, omega = self._path.place(ahead.p)
        state = balance.evaluate(omega, balance.shaped(ahead.x))
        o = self._options.newton
        try:
            leg = bordered.tangent(
                self._path, ahead.p, state, self._point.tangent, self._metric, o, RULES.tangent_accuracy
            )
        except BorderFailed:
            return []
        return [leg, leg * -1.0]

    def _split(self, pieces: list[Segment], careful: bool) -> list[Segment] | None:
        """The step, cut at the folds of its pieces; None where one seems to hide two folds or its fold is not found.

        Where not careful such a piece is taken as it is."""
        start, parts = pieces[0].start, []
        for piece in pieces:
            if not piece.turns:
                continue
            if (
                careful and curve_segment.RULES.turn_at_fold < piece.angle <= curve_segment.RULES.kink_angle
            ):  # tangents far apart
                return None
            fold = locate_fold(self._path, piece, self._options.newton, self._options.fold_tolerance)
            if fold is not None:
                parts.append(Segment(start, fold, piece.metric))
                start = fold
            elif careful:
                return None
        return [*parts, Segment(start, pieces[-1].end, pieces[-1].metric)]

    def _accept(self, segment: Segment, last: Segment, step: float) -> None:
        o = self._options
        self.segments.append(segment.bare())
        self._metric = self._measure(segment.end.place.x)
        self._point = replace(segment.end, tangent=self._metric.unit(segment.end.tangent))
        factor = 2.0 ** np.clip((o.newton_target - segment.end.solved.steps) / 2, -1, 2)
        if segment.angle > curve_segment.RULES.kink_angle:
            self._bend = None
        else:
            self._bend = (last.end.tangent - last.start.tangent) * (1.0 / last.length)
            factor = min(factor, max(0.5, o.angle / max(segment.angle, 1e-9)))
        longest = max(min(o.max_step, RULES.fold_reach * last.distance_to_fold), o.min_step)
        self._step = float(np.clip(step * factor, o.min_step, longest))
