"""Unilateral contact: a normal spring that pushes and never pulls, no tangential part and no memory.

N = max(k_n (v - gap), 0).
Source  Tamatam 2021, eq. 3.24 and chapter 6 (leaf seal).
"""

from __future__ import annotations

import numba
import numpy as np

from tribodyn.hbm.contact import located as transitions
from tribodyn.hbm.contact.law import SEPARATES, STICKS, ContactCycle, ContactParameters
from tribodyn.hbm.harmonics import HarmonicBasis

COMPONENTS = (("n",),)
LINEAR_WHERE_STUCK = True

located = transitions.cycle


def n_state(components: tuple[str, ...]) -> int:
    """No memory."""
    return 0


@numba.njit(cache=True)
def step(x, s, p, f, dfx, dfs, dsx, dss):
    """One pair at one sample; a closed pair counts as sticking."""
    N = p[0] * (x[0] - p[3])
    if N <= 0.0:
        f[0] = 0.0
        return SEPARATES
    f[0] = N
    dfx[0, 0] = p[0]
    return STICKS


def cycle(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool = True
) -> ContactCycle:
    """The cycle at the samples of the basis; a Jacobian is k_n times prefix sums at the samples where contact changes.

    x : (n_pair, 1, n_coeff) [m]; memory : (n_pair, 0)
    """
    kn = parameters.stiffness[:, :1]
    load = kn * (basis.to_time(x[:, 0]) - parameters.gap[:, None])
    closed = load > 0.0
    force = basis.from_time(np.where(closed, load, 0.0))
    status = STICKS * closed.any(axis=1) + SEPARATES * (~closed).any(axis=1)
    if not jacobian:
        return ContactCycle(force[:, None], None, status)
    jac = np.zeros((len(x), basis.n_coeff, basis.n_coeff))
    jac[closed.all(axis=1)] = np.eye(basis.n_coeff)
    partly = np.flatnonzero(closed.any(axis=1) & ~closed.all(axis=1))
    edge = np.diff(closed[partly].astype(int), axis=1, prepend=0, append=0)  # +1 closes, -1 opens
    row, sample = np.nonzero(edge)
    np.add.at(jac, partly[row], -edge[row, sample, None, None] * basis.prefix_sums[0][sample])
    return ContactCycle(force[:, None], jac * kn[:, :, None], status)
