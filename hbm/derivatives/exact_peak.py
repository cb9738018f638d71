"""The resonance peak next to a state, found more exactly than a run needs it."""

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation.amplitude_slope import AmplitudeSlope
from tribodyn.hbm.derivatives.derivative_rules import RULES, NoDerivative
from tribodyn.hbm.derivatives.derivative_table import exact_state
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.outcome import CONVERGED


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
