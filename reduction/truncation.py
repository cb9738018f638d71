"""What the modes left out of a Craig-Bampton basis cost, without computing them."""

from __future__ import annotations

import numpy as np

from tribodyn.fem.factor import Factor


def frequency_error(factor: Factor, residual: np.ndarray, omega: np.ndarray, omitted: float) -> np.ndarray:
    """Estimated relative error of reduced frequencies, always too high ones.

    The residual of a reduced mode lies in the omitted fixed-interface modes. One step of exact dynamic condensation
    would lower its eigenvalue by r^T (K_ss - lambda M_ss)^-1 r, which is at most r^T K_ss^-1 r / (1 - lambda/lambda_o).
    Springs between masters, such as a stuck contact, leave the residual at the slaves as it is.

    factor : of K_ss; residual : (n_slave, k) of mass-normalised reduced modes; omega : (k,) [rad/s]
    omitted : first fixed-interface frequency left out [rad/s]
    Returns (k,); 0 for rigid-body modes, inf for modes above the first omitted one
    Source  first-order perturbation of Leung's exact condensation (1978)
    """
    flexible = np.einsum("sk,sk->k", residual, factor.solve(residual)) / 2
    room = 1 - (omega / omitted) ** 2
    error = np.full(len(omega), np.inf)
    elastic = omega > 1e-6 * omega.max()
    error[~elastic] = 0.0
    safe = elastic & (room > 0)
    error[safe] = flexible[safe] / (omega[safe] ** 2 * room[safe])
    return error
