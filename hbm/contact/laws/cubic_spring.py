"""Cubic spring: the smooth reference law, f = k x + k_3 x^3 in every component on its own.

No friction, no gap, no memory: what a smooth law should give (Duffing) can be checked against closed forms. The force
of harmonics up to H is exact at more than 4 H samples."""

from dataclasses import dataclass

import numba

from tribodyn.declarations import number
from tribodyn.hbm.contact.contact_law import STICKS

COMPONENTS = (("t1", "t2", "n"), ("t1", "t2"), ("t1", "n"), ("t2", "n"), ("t1",), ("t2",), ("n",))
SAMPLES_ONLY = True


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    cubic: float = number("N/m3")
    """Cubic coefficient k_3 of every pair and component."""


def n_state(components: tuple[str, ...]) -> int:
    """No memory."""
    return 0


@numba.njit(cache=True)
def step(x, s, p, f, dfx, dfs, dsx, dss):
    """One pair at one sample; it always counts as sticking."""
    for c in range(x.size):
        f[c] = p[c] * x[c] + p[4] * x[c] ** 3
        dfx[c, c] = p[c] + 3.0 * p[4] * x[c] ** 2
    return STICKS
