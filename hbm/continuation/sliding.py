"""A solution without a neighbouring one, by way of more friction: bodies that slide to where they rest.

With much friction closed pairs stick, and where they stick is found at once. As friction falls they slide, and the
solution moves with it. A wedge that a load presses between two bodies is the example: from the stuck state Newton's
method lets go of one of its faces, and nothing holds it any more.
Source  ours
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.law import ContactParameters
from tribodyn.hbm.newton import NewtonOptions, Solution, lead
from tribodyn.hbm.threads import single

FRICTION = "friction"  # what laws call their coefficient
STARTS = (3.0, 2.5, 2.0, 1.5, 1.0, 0.5)  # decimal logarithms of friction over its own, tried in turn
MOST_STEPS = 400  # of Newton on the whole way


@single
def solve_along_friction(balance: HarmonicBalance, omega: float, options: NewtonOptions) -> Solution | None:
    """A solution at one frequency [rad/s], None where no law has a coefficient of friction or there is no way to it."""
    if not any(FRICTION in joint.parameters.numbers for joint in balance.contact.joints):
        return None
    x, spent, products = balance.stuck(omega), 0, 0
    found: Solution | None = None

    def rougher(level: float, _: float = np.nan) -> bool:
        nonlocal found, x, spent, products
        if spent >= MOST_STEPS:
            return False
        found = newton.solve(_with_friction(balance, level), omega, x, options)
        spent, products = spent + found.steps, products + found.products
        x = found.state.x if found.converged else x
        return found.converged

    first = next((level for level in STARTS if rougher(level)), None)
    if first is None or lead(first, 0.0, rougher) > 0.0 or found is None:
        return None
    return replace(found, steps=spent, products=products)


def _with_friction(balance: HarmonicBalance, level: float) -> HarmonicBalance:
    """The same problem with all coefficients of friction times ten to the level."""
    if level == 0.0:
        return balance

    def rougher(p: ContactParameters) -> ContactParameters:
        if FRICTION not in p.numbers:
            return p
        return replace(p, numbers={**p.numbers, FRICTION: p.numbers[FRICTION] * 10.0**level})

    return replace(balance, contact=balance.contact.with_parameters(rougher))
