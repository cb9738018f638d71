"""Exact derivatives of the numbers of a cycle at a fixed frequency, and along a resonance peak.

At a peak of A(w, p), where the slope a_w of a = ln A vanishes, dw/dp = - a_wp / a_ww, and dq/dp has q_w dw/dp
besides. a_wp and a_ww are differences along the curve of the exact gradient, of all parameters together. A peak that is
a corner of the curve, where a contact transition begins, remains where both sides meet: dw/dp = - [A_p] / [A_w], with
the jumps of both."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation.amplitude_slope import AmplitudeSlope
from tribodyn.hbm.derivatives.adjoint_gradient import CycleNumber, Gradient, cycle_numbers
from tribodyn.hbm.derivatives.derivative_rules import RULES, NoDerivative
from tribodyn.hbm.derivatives.derivative_table import (
    Derivatives,
    PointSlopes,
    derivatives_at,
    exact_state,
    point_slopes,
)
from tribodyn.hbm.derivatives.parameter_change import ParameterChange
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.quantities import amplitude
from tribodyn.hbm.threads import single


def slope_at(balance: HarmonicBalance, state: State, output: str) -> AmplitudeSlope:
    """Slope of the amplitude of an output at a solved state."""
    return AmplitudeSlope.of(balance, Solution(state, CONVERGED, 0, 0, ()), output)


def exact_peak(
    balance: HarmonicBalance, state: State, output: str, options: NewtonOptions | None
) -> tuple[tuple[AmplitudeSlope, ...], float]:
    """The peak next to a state, by secants of the slope, and half width of the resonance [rad/s].

    Two points where the slope does not vanish but jumps: those on both sides of the corner"""

    def solve_at(omega: float, origin: AmplitudeSlope) -> AmplitudeSlope:
        return slope_at(balance, exact_state(balance, omega, origin.predict(omega), options), output)

    start = previous = slope_at(balance, exact_state(balance, state.omega, state.x, options), output)
    longest = RULES.first_step * start.omega
    step = float(np.clip(start.distance, -longest, longest))
    for _ in range(2, RULES.max_steps):
        point = solve_at(previous.omega + step, previous)
        curvature = (point.slope - previous.slope) / step if step else 0.0
        if not curvature < 0:
            break
        width = float(np.sqrt(-2 / curvature) * point.height)
        previous, step = point, float(np.clip(-point.slope / curvature, -width / 2, width / 2))
        if abs(step) <= RULES.peak_tolerance * width:
            return (point,), width
    low = high = start
    for _ in range(RULES.max_steps):
        if low.slope > 0 > high.slope:
            break
        longest *= 2
        if high.slope > 0:
            low, high = high, solve_at(high.omega + longest, high)
        else:
            low, high = solve_at(low.omega - longest, low), low
    hertz = f"{state.omega / (2 * np.pi):.6g} Hz"
    if not low.slope > 0 > high.slope:
        raise NoDerivative(f"no peak of {output} lies next to {hertz}")
    width = min(low.width, high.width)
    while high.omega - low.omega > RULES.corner_width * width:
        middle = solve_at((low.omega + high.omega) / 2, low)
        low, high = (middle, high) if middle.slope > 0 else (low, middle)
    if max(low.miss, high.miss) <= RULES.peak_tolerance:
        return (low,), width
    if balance.basis.transitions != "located":
        raise NoDerivative(
            f"the peak of {output} at {hertz} is a corner of the curve, as forces at samples have many: "
            'harmonics.transitions = "located" has none but where a contact transition begins'
        )
    return (low, high), width


Changes = Iterable[ParameterChange]


@single
def at_frequency(
    balance: HarmonicBalance, state: State, output: str, changes: Changes, wear: Mapping[str, float] | None = None,
    options: NewtonOptions | None = None,
) -> Derivatives:  # fmt: skip
    """Derivatives at the fixed frequency of a state, from which it is solved more exactly.

    output : the observed one; changes : the parameters; wear : joint -> wear coefficient [m3/J]
    Raises  NoDerivative at a fold, or where the state is not solved"""
    state = exact_state(balance, state.omega, state.x, options)
    numbers = (number for number in cycle_numbers(balance, state, output, wear) if number.moves_with_state)
    gradient = Gradient(balance, state, tuple(numbers))
    parameters, (point,) = point_slopes([gradient], changes)
    return derivatives_at(gradient, parameters, point)


@single
def at_peak(
    balance: HarmonicBalance, state: State, output: str, changes: Changes, wear: Mapping[str, float] | None = None,
    options: NewtonOptions | None = None,
) -> Derivatives:  # fmt: skip
    """Derivatives along the resonance peak next to a state; see `at_frequency`.

    Values are those of the peak itself: one Newton step on its condition from the state, `RULES.peak_tolerance` away.
    A peak that is a corner of the curve remains where the curve has its corner
    Raises  NoDerivative where no peak lies next to the state, as at a fold"""
    ends, width = exact_peak(balance, state, output, options)

    def gradient_near(end: AmplitudeSlope, widths: float) -> Gradient:
        omega = end.omega + widths * width
        neighbours = exact_state(balance, omega, end.predict(omega), options)
        return Gradient(balance, neighbours, tuple(cycle_numbers(balance, neighbours, output, wear)))

    if len(ends) == 2:
        low, high = (
            [gradient_near(end, side * n**2) for n in (1, 2, 3, 4)]
            for end, side in zip(ends, RULES.corner_sides, strict=True)
        )
        return _at_corner(low, high, changes)
    gradient, *neighbours = (gradient_near(ends[0], side) for side in (0.0, -RULES.curve_step, RULES.curve_step))
    row = _amplitude_row(gradient.numbers)
    neighbours = [replace(g, numbers=(g.numbers[_amplitude_row(g.numbers)],)) for g in neighbours]
    parameters, (point, *points) = point_slopes([gradient, *neighbours], changes)
    slope = point.by_frequency[row] / point.values[row]
    curvature, moves = _curvature_and_moves(points, width, float(slope))
    point = replace(point, values=point.values - slope / curvature * point.by_frequency)
    return derivatives_at(gradient, parameters, point, moves)


def peak_moves(
    balance: HarmonicBalance, state: State, output: str, changes: Changes, options: NewtonOptions | None = None
) -> np.ndarray:
    """(n_change + n_pair,) d omega of the peak that a state is at, by the changes and by the gap of every pair."""
    peak = slope_at(balance, exact_state(balance, state.omega, state.x, options), output)
    if peak.miss > RULES.curve_step:  # one that a run ended at for another reason than a slope that vanishes
        (peak, *corner), _ = exact_peak(balance, state, output, options)
        if corner:
            raise NoDerivative("the peak is a corner of the curve, where a contact transition begins")
    neighbours = []
    for side in (-RULES.curve_step, RULES.curve_step):
        omega = peak.omega + side * peak.width
        neighbour = exact_state(balance, omega, peak.predict(omega), options)
        numbers = cycle_numbers(balance, neighbour, output)
        neighbours.append(Gradient(balance, neighbour, (numbers[_amplitude_row(numbers)],)))
    return _curvature_and_moves(point_slopes(neighbours, changes)[1], peak.width, peak.distance / peak.width**2)[1]


def _amplitude_row(numbers: Sequence[CycleNumber]) -> int:
    """Of the number whose maximum is the peak; raises NoDerivative where nothing vibrates."""
    for row, number in enumerate(numbers):
        if number.quantity is not None and number.quantity.value is amplitude.value:
            return row
    raise NoDerivative("the observed output does not vibrate")


def _curvature_and_moves(points: Sequence[PointSlopes], width: float, slope: float) -> tuple[float, np.ndarray]:
    """(ln A)_ww of two points on both sides of a peak, and d omega of the peak by every column.

    slope : (ln A)_w halfway between them; width : half width of the resonance [rad/s]"""
    slopes = [np.concatenate([p.by_frequency[:1], p.columns[0]]) / p.values[0] for p in points]
    curvature, *mixed = (slopes[1] - slopes[0]) / (2 * RULES.curve_step * width)
    if not curvature < 0:
        raise NoDerivative("the response has no maximum next to this point")
    if abs(slopes[0][0] + slopes[1][0] - 2 * slope) > RULES.corner * abs(slopes[1][0] - slopes[0][0]):
        raise NoDerivative("the curve has a corner next to the peak, where a contact transition begins")
    return float(curvature), -np.asarray(mixed) / curvature


def _at_corner(low: Sequence[Gradient], high: Sequence[Gradient], changes: Changes) -> Derivatives:
    """Along a corner of the curve, from points that tend to it below and above it."""
    common = set.intersection(*({number.name for number in g.numbers} for g in (*low, *high)))
    gradients = [replace(g, numbers=tuple(q for q in g.numbers if q.name in common)) for g in (*low, *high)]
    row = _amplitude_row(gradients[0].numbers)
    parameters, points = point_slopes(gradients, changes)
    lower, upper = PointSlopes.limit(points[:4]), PointSlopes.limit(points[4:])
    moves = (upper.columns[row] - lower.columns[row]) / (lower.by_frequency[row] - upper.by_frequency[row])
    both_sides = [side.columns + side.by_frequency[:, None] * moves for side in (lower, upper)]
    size = np.abs(both_sides).max(axis=(0, 2), keepdims=True)[0]
    if (np.abs(both_sides[1] - both_sides[0]) > RULES.corner * size).any():
        raise NoDerivative("the peak is a corner of the curve where more than one contact transition begins")
    return replace(derivatives_at(gradients[0], parameters, lower, moves), follows_corner=True)
