"""A spring that slips at a force of its own, whatever presses it: a joint with tight bolts.

It is written as a user writes a law: no other file knows it, its number has another name than those of the shipped
laws, and it has no more than its step. All tests of contact laws must accept it.
Source  Jenkins element with a constant limit, as Iwan 1966 combines many"""

from dataclasses import dataclass

import numba

from tribodyn.declarations import number
from tribodyn.hbm.contact.contact_law import SLIPS, STICKS

COMPONENTS = (("t1", "t2"), ("t1",))
LINEAR_WHERE_STUCK = True


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    strength: float = number("N", role="slip_force", low=0.0)
    """Force at which a pair slips, in each direction."""


def n_state(components: tuple[str, ...]) -> int:
    """One slider position per direction [m]."""
    return len(components)


@numba.njit(cache=True)
def step(x, s, p, f, dfx, dfs, dsx, dss):
    """Advance one pair by one sample; writes force, memory and their derivatives, returns the status bits."""
    bits = 0
    for c in range(x.size):
        k, limit = p[c], p[4]
        f[c] = k * (x[c] - s[c])
        if abs(f[c]) <= limit:
            dfx[c, c] = k
            dfs[c, c] = -k
            dss[c, c] = 1.0
            bits |= STICKS
        else:
            f[c] = limit if f[c] > 0.0 else -limit
            s[c] = x[c] - f[c] / k
            dsx[c, c] = 1.0
            bits |= SLIPS
    return bits
