"""Folds of a frequency response, followed directly while a second parameter changes: load, gap, stiffness, wear.

The solutions at all frequencies and all values of the parameter form a surface. On it the fold is where the tangent at
constant parameter has no share in frequency; this scalar, from a bordered solve that is regular at the fold, is brought
to zero by Newton in the two coordinates of the surface, and the line of folds is followed by its own arc length, round
the cusps where two folds meet. Where kinks of the law keep Newton from it, the fold is searched along the curve.
Source  minimally bordered systems, Griewank and Reddien 1984, Govaerts 2000; differences of the scalar by steps ours.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import bordered
from tribodyn.hbm.continuation.bordered import BorderFailed, Direction, Metric
from tribodyn.hbm.continuation.curve_segment import CurvePoint
from tribodyn.hbm.continuation.curve_stepper import CurveStepper
from tribodyn.hbm.continuation.methods.arc_length import Options
from tribodyn.hbm.continuation.parameter import FREQUENCY, Parameter
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.refusal import SolverFailure


@dataclass(frozen=True)
class FoldOptions:
    """How a line of folds is followed.

    step, max_step, min_step : arc length of the first, longest and shortest step; one is the size of the vibration,
        a tenth of the frequency, or `width` times the range of the parameter
    max_points : points after which to end; trials : Newton steps allowed per fold
    frequency_scale : relative change of frequency that is as long as one of the whole state; it sets the steps alone
    difference : step along the surface by which the scalar is differentiated: the square root of Newton's tolerance,
        where the errors of truncation and of the solves are alike
    accuracy : of tangents, relative; finer than `difference` needs by the factor that differencing loses
    residual : of the scalar at a fold; the frequency is off by its square, which is below Newton's tolerance
    search_step, search_steps : arc length of the first step in the search for a fold, and steps either way"""

    step: float = 0.05
    max_step: float = 0.3
    min_step: float = 1e-3
    width: float = 0.2
    max_points: int = 500
    trials: int = 8
    frequency_scale: float = 0.1
    difference: float = 1e-4
    accuracy: float = 1e-10
    residual: float = 1e-5
    search_step: float = 1e-3
    search_steps: int = 8
    newton: NewtonOptions = field(default_factory=NewtonOptions)


class NoFold(SolverFailure):
    """No fold was found near a place."""


@dataclass(frozen=True)
class FoldPoint:
    """A fold with the direction in which its line continues.

    value : of the parameter; solution : at the fold; response_tangent : unit tangent of the response curve
    tangent, change : of (x, omega) and of the parameter along the line of folds, of unit length together"""

    value: float
    solution: Solution
    response_tangent: Direction
    tangent: Direction
    change: float

    @property
    def place(self) -> Direction:
        """(x, omega)."""
        return Direction(self.solution.state.flat, self.solution.state.omega)


class SolutionSurface:
    """Solutions over frequency and parameter, and the scalar that vanishes at folds."""

    def __init__(self, path: Parameter, options: FoldOptions, omega: float, span: float):
        self._path, self._options = path, options
        self._width, self._span = options.frequency_scale * omega, options.width * span
        self._newton = replace(options.newton, tolerance=max(1e-3 * options.newton.tolerance, 1e-13), max_steps=15)

    def _metric(self, flat: np.ndarray, balance: HarmonicBalance) -> Metric:
        vibration = np.linalg.norm(flat[:, balance.basis.order > 0]) or np.linalg.norm(flat) or 1.0
        return Metric(float(vibration), self._width)

    def _response(self, value: float) -> Parameter:
        """The response curve at one value of the parameter."""
        balance = self._path.make(value)
        return Parameter(FREQUENCY, lambda _: balance, None)

    def first(self, value: float, guess: Direction, sense: float) -> FoldPoint:
        """The fold nearest to a guess (x, omega) at a value, with its line towards `sense`; raises NoFold."""
        metric = self._metric(guess.x, self._path.make(value))
        response_tangent = self._null(self._response(value), guess, metric)
        point = self._searched(value, guess, response_tangent, metric)
        solution, response_tangent = point.solved, point.tangent
        try:
            across = self._across(value, solution, response_tangent, metric)
            scalar, slopes = self._slopes(value, point.place, response_tangent, across, metric)
        except BorderFailed as reason:
            raise NoFold(str(reason)) from None
        shares = (-slopes[1], slopes[0]) if abs(scalar) <= self._options.residual and slopes[0] != 0 else (0.0, 1.0)
        sign = -1.0 if shares[1] * sense < 0 else 1.0
        tangent = response_tangent * shares[0] + across * shares[1]
        return self._unit(FoldPoint(value, solution, response_tangent, tangent, shares[1]), metric, sign)

    def ahead(self, point: FoldPoint, step: float) -> FoldPoint:
        """The next fold of the line: by Newton, or where kinks forbid that by search at a value; raises NoFold."""
        metric = self._metric(point.place.x, self._path.make(point.value))
        value, guess = point.value + step * point.change, point.place + point.tangent * step
        try:
            following = self._newton_fold(value, guess, point.response_tangent)
            chord, change = following.place - point.place, following.value - point.value
            dot = metric.dot(chord, following.tangent) + change * following.change / self._span**2
            if 0.3 * step < self._length(metric, chord, change) < 2 * step and abs(dot) > 0.7 * step:
                return self._unit(following, metric, float(np.sign(dot)))
        except NoFold:
            pass
        return self.at(value, guess, point)

    def at(self, value: float, guess: Direction, neighbour: FoldPoint) -> FoldPoint:
        """The fold at a value, next to the fold `here` on its line; raises NoFold."""
        metric = self._metric(neighbour.place.x, self._path.make(neighbour.value))
        reach = 2 * self._length(metric, guess - neighbour.place, value - neighbour.value)
        point = self._searched(value, guess, neighbour.response_tangent, metric)
        chord = point.place - neighbour.place
        if value == neighbour.value or self._length(metric, chord, value - neighbour.value) > reach:
            raise NoFold(f"the next fold, at {self._path.say(value)}, lies on another line")
        return self._unit(FoldPoint(value, point.solved, point.tangent, chord, value - neighbour.value), metric, 1.0)

    def _newton_fold(self, value: float, guess: Direction, response_tangent: Direction) -> FoldPoint:
        """Newton for the fold near a guess (x, omega), normal to the line of folds; raises NoFold."""
        row = np.zeros(2)
        for trial in range(self._options.trials):
            response = self._response(value)
            metric = self._metric(guess.x, response.make(value))
            solution = self._solved(response, guess, response_tangent, metric)
            place = Direction(solution.state.flat, solution.state.omega)
            try:
                response_tangent = bordered.tangent(
                    response, place.p, solution.state, response_tangent, metric, self._newton, self._options.accuracy
                )
                across = self._across(value, solution, response_tangent, metric)
                scalar, slopes = self._slopes(value, place, response_tangent, across, metric)
            except BorderFailed as reason:
                raise NoFold(str(reason)) from None
            size = float(np.hypot(*slopes))
            if size == 0.0:
                break
            line = np.array([-slopes[1], slopes[0]]) / size
            if trial == 0:
                row = line
            if abs(scalar) <= self._options.residual:
                tangent = response_tangent * float(line[0]) + across * float(line[1])
                return FoldPoint(value, solution, response_tangent, tangent, float(line[1]))
            matrix = np.array([slopes, row])
            if abs(np.linalg.det(matrix)) < 1e-12 * size:
                break
            move = np.linalg.solve(matrix, [-scalar, 0.0])
            move *= min(1.0, 0.3 / max(abs(move[0]), abs(move[1]) / self._span, 1e-300))
            guess = place + response_tangent * float(move[0]) + across * float(move[1])
            value += float(move[1])
        raise NoFold(f"Newton found no fold near {self._path.say(value)}")

    def _solved(self, response: Parameter, guess: Direction, border: Direction, metric: Metric) -> Solution:
        solution, _ = bordered.correct(response, guess, border, metric, self._newton)
        if min(solution.history) > self._options.newton.tolerance:
            raise NoFold(f"no solution near {response.say(guess.p)}: {solution.outcome}")
        return replace(solution, outcome=CONVERGED)

    def _null(self, response: Parameter, guess: Direction, metric: Metric) -> Direction:
        """Tangent of the response curve at a guess, with the vibration itself as the border."""
        balance = response.make(guess.p)
        state = balance.evaluate(guess.p, balance.shaped(guess.x))
        border = metric.unit(Direction(np.where(balance.basis.order > 0, guess.x, 0.0), 0.0))
        try:
            return bordered.tangent(response, guess.p, state, border, metric, self._newton, self._options.accuracy)
        except BorderFailed as reason:
            raise NoFold(str(reason)) from None

    def _across(self, value: float, solution: Solution, tangent: Direction, metric: Metric) -> Direction:
        """d (x, omega) / d value at constant position along the response curve."""
        state, response = solution.state, self._response(value)
        force = replace(self._path, omega=state.omega).slope(value, state)
        linear, slope = response.make(value).linearise(state), response.slope(state.omega, state)
        return bordered.solve(
            linear, slope, tangent, metric, (-force, 0.0), self._options.accuracy, self._newton.max_products
        )[0]

    def _slopes(
        self, value: float, origin: Direction, border: Direction, across: Direction, metric: Metric
    ) -> tuple[float, tuple[float, float]]:
        """The scalar (share of the frequency in the unit tangent) and its derivatives along and across."""

        def scalar(v: float, place: Direction) -> float:
            response = self._response(v)
            balance = response.make(v)
            state = balance.evaluate(place.p, balance.shaped(place.x))
            return (
                bordered.tangent(response, place.p, state, border, metric, self._newton, self._options.accuracy).p
                / metric.width
            )

        reach = 1.0 / max(metric.norm(across), 1.0 / self._span)  # change of the parameter that counts as one
        central = scalar(value, origin)
        slope_along = (scalar(value, origin + border * self._options.difference) - central) / self._options.difference
        step = self._options.difference * reach
        slope_across = (scalar(value + step, origin + across * step) - central) / step
        return central, (slope_along, slope_across)

    def _length(self, metric: Metric, step: Direction, change: float) -> float:
        return float(np.hypot(metric.norm(step), change / self._span))

    def _unit(self, fold: FoldPoint, metric: Metric, sign: float) -> FoldPoint:
        """The fold with its direction of unit length, turned round where the sign is negative."""
        factor = sign / self._length(metric, fold.tangent, fold.change)
        return replace(fold, tangent=fold.tangent * factor, change=fold.change * factor)

    def _searched(self, value: float, guess: Direction, tangent: Direction, metric: Metric) -> CurvePoint:
        """The fold nearest to a guess at a value: the response curve is walked both ways; raises NoFold."""
        response = self._response(value)
        solution = self._solved(response, guess, tangent, metric)
        omega = solution.state.omega
        options = Options(step=self._options.search_step, width=1.0, newton=self._options.newton)
        ways = [
            CurveStepper(response, options, solution, omega, omega + self._width, tangent * sign)
            for sign in (1.0, -1.0)
        ]
        for _ in range(self._options.search_steps):
            for way in ways:
                for part in way.advance():
                    if part.end.fold:
                        return part.end
        raise NoFold(f"the response has no fold any more at {self._path.say(value)}")

    def next_step(self, point: FoldPoint, following: FoldPoint, step: float) -> float:
        """The step after one that went from here to there, by the turn of the line."""
        metric = self._metric(following.place.x, self._path.make(following.value))
        turn = self._length(metric, following.tangent - point.tangent, following.change - point.change)
        return step * float(np.clip(0.25 / max(turn, 1e-9), 0.5, 2.0))
