"""Exact derivatives of the numbers of a nonlinear mode at a fixed amplitude."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.free_vibration import FreeVibration, ModePoint
from tribodyn.hbm.continuation.nonlinear_modes import newton_on
from tribodyn.hbm.derivatives.derivative_rules import RULES, NoDerivative
from tribodyn.hbm.derivatives.derivative_table import Derivatives
from tribodyn.hbm.derivatives.parameter_change import BalanceInputs, ParameterChange
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.quantity import ModeQuantity, quantities_of
from tribodyn.hbm.threads import single


@single
def at_mode(
    problem: FreeVibration,
    point: ModePoint,
    changes: Iterable[ParameterChange],
    options: NewtonOptions | None = None,
    modal: bool = True,
) -> Derivatives:
    """Derivatives of the numbers of a nonlinear mode at a fixed amplitude.

    modal : the amplitude is that of the mass-normalised mode, else the motion of the output in it
    One solution of the linearised problem for each parameter, whose residual is differenced at the same motion.
    Raises  NoDerivative where the mode is not solved"""
    balance, exact = problem.balance, replace(options or NewtonOptions(), tolerance=RULES.mode_tolerance)
    normal = np.zeros(len(point.coordinates))
    normal[-1] = 1.0
    point, outcome, _ = newton_on(problem, point, normal, exact)
    if outcome != CONVERGED:
        raise NoDerivative(f"the mode is not solved: {outcome}")

    def residual(inputs: BalanceInputs) -> np.ndarray:
        changed_balance = inputs.balance or HarmonicBalance.of(
            inputs.model, inputs.contact.joints, balance.basis, inputs.excitation, balance.omega_max, inputs.memory
        )
        changed = FreeVibration(changed_balance, problem.mode, problem.output)
        a = point.a if modal else point.a * problem.per_amplitude / changed.per_amplitude
        return changed.at(point.x, point.omega, point.zeta, a).residual

    def slope(change: ParameterChange) -> np.ndarray:
        up, down, *far = (residual(i) for i in (change.above, change.below, *(change.double_step or ())))
        difference = ((8 * (up - down) - (far[0] - far[1])) / 12 if far else (up - down) / 2) / change.step
        return difference if change.contact_part is None else difference + slope(change.contact_part)

    quantities = [(q, q.tangent) for q in quantities_of(ModeQuantity) if q.tangent is not None]
    names, columns = list[str](), []
    for change in changes:
        right = replace(point, residual=slope(change))
        moves = problem.correction(right, normal, RULES.adjoint_tolerance, exact.max_products)
        names.append(change.name)
        columns.append([tangent(point, moves) for _, tangent in quantities])
    n = len(quantities)
    slopes, values = np.reshape(columns, (-1, n)).T, np.array([q.value(point) for q, _ in quantities])
    return Derivatives(
        tuple(q.name for q, _ in quantities), values, tuple(names), slopes, np.zeros(len(names), bool), slopes, slopes,
        np.zeros(n), np.zeros((n, balance.contact.n_pair)), balance.evaluate(point.omega, point.x),
    )  # fmt: skip
