"""Motions at one frequency that a contact comes to by different ways: from below, from above, from a larger load.

Where faces lift or slip, more than one motion may satisfy the balance at a frequency, and what was before decides which
of them a machine makes. Neighbours are followed in natural steps; over a step without a solution the last one is kept,
so that a way ends in a motion or in none.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.threads import single


@dataclass(frozen=True)
class WayRules:
    """Where the ways to a frequency begin, and their steps."""

    below: float = 0.8  # frequencies that a way begins at, over the one it goes to
    above: float = 1.25
    larger: float = 2.0  # load factor that a way begins at, over the one it goes to
    steps: int = 40


RULES = WayRules()


@single
def arrivals(balance: HarmonicBalance, omega: float, options: NewtonOptions | None = None) -> list[Solution]:
    """Solutions at a frequency [rad/s] that sweeps up and down and a falling load lead to; those that are found.

    They may be one and the same
    """
    options, load = options or NewtonOptions(), balance.load_factor
    start = min(RULES.above * omega, balance.omega_max)
    rising = ((balance, value) for value in np.linspace(RULES.below * omega, omega, RULES.steps + 1))
    falling = ((balance, value) for value in np.linspace(start, omega, RULES.steps + 1))
    weaker = ((balance.with_load(value), omega) for value in np.linspace(RULES.larger * load, load, RULES.steps + 1))
    return [last for way in (rising, falling, weaker) if (last := _followed(way, options)) is not None]


def _followed(way: Iterator[tuple[HarmonicBalance, float]], options: NewtonOptions) -> Solution | None:
    """The solution at the end of a way, None where there is none near the one before."""
    solution = newton.solve_from_rest(*next(way), options)
    x = solution.state.x
    for balance, omega in way:
        solution = newton.solve(balance, omega, x, options)
        if solution.converged:
            x = solution.state.x
    return solution if solution.converged else None
