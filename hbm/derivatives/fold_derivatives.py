"""Exact derivatives of the frequency of a fold of the response.

The transpose of the balance R(x, w, p) = 0 has a solution l without right-hand side at a fold, so that along the fold
l . (R_w dw + R_p dp) = 0."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation import bordered, parameter
from tribodyn.hbm.continuation.bordered import Direction, Metric
from tribodyn.hbm.continuation.fold_curve import FoldOptions
from tribodyn.hbm.derivatives.adjoint_gradient import CycleNumber, Gradient
from tribodyn.hbm.derivatives.derivative_rules import RULES, NoDerivative
from tribodyn.hbm.derivatives.derivative_table import Derivatives, PointSlopes, derivatives_at, point_slopes
from tribodyn.hbm.derivatives.parameter_change import ParameterChange
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.quantity import FoldQuantity, quantities_of
from tribodyn.hbm.threads import single


@single
def at_fold(
    balance: HarmonicBalance, state: State, changes: Iterable[ParameterChange], options: NewtonOptions | None = None
) -> Derivatives:
    """Derivatives of every number of the fold next to a state; see `cycle_derivatives.at_frequency`.

    Raises  NoDerivative where no fold lies next to the state"""
    state = _exact_fold(balance, state, options)
    gradient = Gradient(balance, state, (CycleNumber.zero(balance, state),), at_fold=True)
    parameters, (point,) = point_slopes([gradient], changes)
    quantities = [(q, q.slope) for q in quantities_of(FoldQuantity) if q.slope is not None]
    slopes = np.array([[slope(state.omega)] for _, slope in quantities]) / -point.by_frequency[0]
    fold_slopes = PointSlopes(
        np.array([q.value(state.omega) for q, _ in quantities]), np.zeros(len(quantities)),
        slopes * point.above, slopes * point.below, slopes * point.by_gap,
    )  # fmt: skip
    derivatives = derivatives_at(gradient, parameters, fold_slopes)
    return replace(derivatives, names=tuple(q.name for q, _ in quantities))


def _exact_fold(balance: HarmonicBalance, state: State, options: NewtonOptions | None) -> State:
    """The fold next to a state, by secants of the share of the frequency in the tangent."""
    exact, path = replace(options or NewtonOptions(), tolerance=RULES.state_tolerance), parameter.of(balance)
    vibration = np.where(balance.basis.order > 0, state.flat, 0.0)
    metric = Metric(float(np.linalg.norm(vibration)), FoldOptions.frequency_scale * state.omega)

    def correct(guess: Direction, tangent: Direction) -> tuple[State, Direction]:
        point = bordered.correct(path, guess, tangent, metric, exact)[0].state
        return point, bordered.tangent(path, point.omega, point, tangent, metric, exact, RULES.adjoint_tolerance)

    try:
        point, tangent = correct(Direction(state.flat, state.omega), metric.unit(Direction(vibration, 0.0)))
        step = RULES.curve_step
        following, following_tangent = correct(Direction(point.flat, point.omega) + tangent * step, tangent)
        bend = (following_tangent.p - tangent.p) / step
        for _ in range(RULES.max_steps):
            point, tangent = following, following_tangent
            step = -tangent.p / bend if bend else np.inf
            if not abs(step) <= 1.0 or abs(step) <= RULES.fold_tolerance:
                break
            following, following_tangent = correct(Direction(point.flat, point.omega) + tangent * step, tangent)
        if abs(step) <= RULES.fold_tolerance:
            return point
    except bordered.BorderFailed:
        pass
    raise NoDerivative(f"no fold lies next to {state.omega / (2 * np.pi):.6g} Hz")
