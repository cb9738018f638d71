"""Jenkins elements with a constant normal load: one or two uncoupled tangential directions.

Each tangential spring k_t drags a slider w that holds |T| <= mu N_0; N_0 = 0 is no contact.
Source  Griffin 1980; Tamatam 2021, eq. 3.26-3.28 with N constant."""

from dataclasses import dataclass

import numba

from tribodyn.declarations import number
from tribodyn.hbm.contact import jenkins_cycle
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS

COMPONENTS = (("t1", "t2"), ("t1",), ("t2",))
LINEAR_WHERE_STUCK = True


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    friction: float = number("", role="friction", low=0.0, usual=(0.0, 1.5))
    """Coulomb coefficient."""
    normal_load: float = number("N", role="normal_load", low=0.0)
    """Constant normal load of every pair, 0 for no contact."""


def n_state(components: tuple[str, ...]) -> int:
    """One slider position per tangential direction [m]."""
    return len(components)


@numba.njit(cache=True)
def step(x, w, p, f, dfx, dfs, dsx, dss):
    """Advance one pair by one sample; writes force, memory and their derivatives, returns the status bits."""
    limit = p[4] * p[5]  # mu N_0
    bits = 0
    for c in range(x.size):
        kt = p[c]
        T = kt * (x[c] - w[c])
        if p[5] <= 0.0:
            f[c] = 0.0
            w[c] = x[c]
            dsx[c, c] = 1.0
            bits |= SEPARATES
        elif abs(T) <= limit:
            f[c] = T
            dfx[c, c] = kt
            dfs[c, c] = -kt
            dss[c, c] = 1.0
            bits |= STICKS
        else:
            f[c] = limit if T > 0.0 else -limit
            w[c] = x[c] - f[c] / kt
            dsx[c, c] = 1.0
            bits |= SLIPS
    return bits


event_based_cycle = jenkins_cycle.cycle
