"""The slope of the contact forces, one block for each pair, in one pass: at many harmonics nothing is larger."""

from __future__ import annotations

import numba
import numpy as np

NOTHING = 1e-14  # slope over the stiffness of a pair from which on it counts


@numba.njit(cache=True)
def departures(jacobian, stiffness):
    """Pairs whose force departs from the stuck one, and the slope of the departure, k - d f / d x.

    jacobian : (n_pair, m, m) with coefficients innermost [N/m]; stiffness : (n_pair, n_component) [N/m]
    Returns (n_active,) pairs and (n_active, m, m) slopes
    """
    n_pair, m, _ = jacobian.shape
    n_coeff = m // stiffness.shape[1]
    active, slopes, n = np.empty(n_pair, np.int64), np.empty(jacobian.shape), 0
    for i in range(n_pair):
        out, largest = slopes[n], 0.0
        for a in range(m):
            for b in range(m):
                out[a, b] = -jacobian[i, a, b]
            out[a, a] += stiffness[i, a // n_coeff]
            for b in range(m):
                largest = max(largest, abs(out[a, b]))
        if largest > NOTHING * stiffness[i].max():
            active[n] = i
            n += 1
    return active[:n].copy(), slopes[:n]
