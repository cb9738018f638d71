"""Unilateral contact: a normal spring that pushes and never pulls, no tangential part and no memory.

N = max(k_n (v - gap), 0).
Source  Tamatam 2021, eq. 3.24 and chapter 6 (leaf seal)."""

import numba

from tribodyn.hbm.contact import jenkins_cycle
from tribodyn.hbm.contact.contact_law import SEPARATES, STICKS

COMPONENTS = (("n",),)
LINEAR_WHERE_STUCK = True

event_based_cycle = jenkins_cycle.cycle


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
