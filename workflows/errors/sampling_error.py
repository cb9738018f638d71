"""The error that sampled contact forces make, estimated by locating their transitions between samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.newton import NewtonOptions

FINER = 8  # times the samples, for a law that cannot locate its transitions: the error falls with their square
CONVERGED_SHARE = 1e-2  # residual over that of the start: a step alone is half of the way where few samples are far off
FEWEST_SAMPLES = 128


def sampling_error(balance: HarmonicBalance, omega: float, x: np.ndarray) -> float:
    """Estimated relative error of the vibration of the worst output, caused by sampled contact forces.

    balance : solved at omega [rad/s] by x (n_pair, n_component, n_coeff) [m]
    The solution is put into a balance that locates its transitions, on more samples, and solved again. The error is
    relative to the vibration there, inf where Newton finds none, from rest neither.
    """
    n_samples = max(FINER * balance.basis.n_samples, FEWEST_SAMPLES)
    fine = balance.with_samples(n_samples, balance.contact.is_event_based)
    state, start = balance.evaluate(omega, x, jacobian=False), fine.evaluate(omega, x, jacobian=False)
    residual = newton.relative_residual(start, fine.x_lin(omega))
    options = NewtonOptions()
    loose = replace(options, tolerance=max(CONVERGED_SHARE * residual, newton.CRITERION.least_tolerance))
    solution = newton.solve(fine, omega, x, loose)
    if not solution.converged and solution.history[-1] > options.tolerance:  # too far off to be a start
        solution = newton.solve_from_rest(fine, omega)
        if not solution.converged:
            return float("inf")
    dynamic = balance.basis.order > 0
    vibration = fine.outputs(solution.state)[:, dynamic]
    change = vibration - balance.outputs(state)[:, dynamic]
    sizes, changes = (np.linalg.norm(y, axis=1) for y in (vibration, change))
    floor = 1e-2 * sizes.max(initial=0.0)  # a quiet output is measured against the liveliest one
    return float((changes / np.maximum(sizes, floor)).max()) if floor > 0 else 0.0
