"""What the time samples of the contact forces cost: the solution is solved again with located transitions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.newton import NewtonOptions

FINER = 8  # times the samples, for a law that cannot locate its transitions: the error falls with their square
SETTLED = 1e-2  # residual over that of the start: a step alone is half of the way where few samples are far off


def sampling_error(balance: HarmonicBalance, omega: float, x: np.ndarray) -> float:
    """Estimated relative error of the vibration of the worst output, caused by sampled contact forces.

    balance : solved at omega [rad/s] by x (n_pair, n_component, n_coeff) [m]
    The solution is put into a balance that locates its transitions, on more samples, and solved again; it is relative
    to the vibration there, inf where Newton finds none, from rest neither.
    """
    fine = balance.with_samples(max(FINER * balance.basis.n_samples, 128), balance.contact.locates)
    here, there = balance.evaluate(omega, x, jacobian=False), fine.evaluate(omega, x, jacobian=False)
    left = newton.relative_residual(there, fine.x_lin(omega))
    options = NewtonOptions()
    closer = replace(options, tolerance=max(SETTLED * left, newton.RULES.least_tolerance))
    found = newton.solve(fine, omega, x, closer)
    if not found.converged and found.history[-1] > options.tolerance:  # too far off to be a start
        found = newton.solve_from_rest(fine, omega)
        if not found.converged:
            return float("inf")
    dynamic = balance.basis.order > 0
    moved = fine.outputs(found.state)[:, dynamic]
    size, change = (np.linalg.norm(y, axis=1) for y in (moved, moved - balance.outputs(here)[:, dynamic]))
    floor = 1e-2 * size.max(initial=0.0)  # a quiet output is measured against the liveliest one
    return float((change / np.maximum(size, floor)).max()) if floor > 0 else 0.0
