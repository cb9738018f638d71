"""What the time samples of the contact forces cost: one Newton step towards forces with located transitions."""

from __future__ import annotations

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance

FINER = 8  # times the samples, for a law that cannot locate its transitions: the error falls with their square


def sampling_error(balance: HarmonicBalance, omega: float, x: np.ndarray) -> float:
    """Estimated relative error of the vibration of the worst output, caused by sampled contact forces.

    balance : solved at omega [rad/s] by x (n_pair, n_component, n_coeff) [m]
    The solution is put into a balance that locates its transitions, on more samples, and one Newton step is taken.
    """
    fine = balance.with_samples(max(FINER * balance.basis.n_samples, 128), balance.contact.locates)
    here, there = balance.evaluate(omega, x, jacobian=False), fine.evaluate(omega, x)
    linear = fine.linearise(there)
    step = linear.solve(-there.residual, 1e-3)[0]
    moved = fine.at(omega).outputs(there.g - here.g + linear.departure_slope(step))
    dynamic = balance.basis.order > 0
    size = np.linalg.norm(balance.outputs(here)[:, dynamic], axis=1)
    change = np.linalg.norm(moved[:, dynamic], axis=1)
    floor = 1e-2 * size.max(initial=0.0)  # a quiet output is measured against the liveliest one
    return float((change / np.maximum(size, floor)).max()) if floor > 0 else 0.0
