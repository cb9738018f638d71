"""A contact law as a user writes one: a spring and a slider on ground that moves on steadily, such as a belt.

In an instant dt the ground takes the slider on by speed dt; where the spring would hold more than the limit, it slips.
"""

from dataclasses import dataclass

import numba

from tribodyn.declarations import number
from tribodyn.hbm.contact.contact_law import SLIPS, STICKS

COMPONENTS = (("t1",),)
VELOCITY = True  # for the time of a step


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    friction: float = number("", role="friction", low=0.0)
    """Coulomb coefficient."""
    normal_load: float = number("N", role="normal_load", low=0.0)
    """Constant normal load."""
    speed: float = number("m/s")
    """Of the ground."""


def n_state(components: tuple[str, ...]) -> int:
    """The slider's position [m]."""
    return 1


@numba.njit
def step(x, w, p, f, dfx, dfs, dsx, dss):
    """Advance one pair by one sample; writes force, memory and their derivatives, returns the status bits."""
    k, limit = p[0], p[4] * p[5]
    w[0] += p[6] * p[p.size - 1]
    f[0] = k * (x[0] - w[0])
    if abs(f[0]) <= limit:
        dfx[0, 0], dfs[0, 0], dss[0, 0] = k, -k, 1.0
        return STICKS
    f[0] = limit if f[0] > 0.0 else -limit
    w[0], dsx[0, 0] = x[0] - f[0] / k, 1.0
    return SLIPS
