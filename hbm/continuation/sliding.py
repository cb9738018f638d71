"""A solution without a neighbouring one, by way of more friction: bodies that slide to where they rest.

With much friction closed pairs stick, and where they stick is found at once. As friction falls they slide, and the
solution moves with it. A wedge that a load presses between two bodies is the example: from the stuck state Newton's
method lets go of one of its faces, and nothing holds it any more.
Source  ours; continuation in a parameter of the problem as in Allgower and Georg 1990, chapter 1
"""

from __future__ import annotations

from dataclasses import replace

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.law import ContactParameters
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.threads import single

FRICTION = "friction"  # what laws call their coefficient
STARTS = (3.0, 2.5, 2.0, 1.5, 1.0, 0.5)  # decimal logarithms of friction over its own, tried in turn
SHORTEST = 0.02  # step of the decimal logarithm of friction
GROWTH = 1.6  # of a step after one that converged
MOST_STEPS = 400  # of Newton on the whole way


@single
def solve_along_friction(balance: HarmonicBalance, omega: float, options: NewtonOptions) -> Solution | None:
    """A solution at one frequency [rad/s], None where no law has a coefficient of friction or there is no way to it."""
    if not any(FRICTION in joint.parameters.numbers for joint in balance.contact.joints):
        return None
    x, stride, left, products = balance.stuck(omega), 1.0, MOST_STEPS, 0
    for level in STARTS:
        found = newton.solve(_with_friction(balance, level), omega, x, options)
        if found.converged:
            break
        left, products = left - found.steps, products + found.products
    while found.converged:
        left, products = left - found.steps, products + found.products
        if level == 0.0:
            return replace(found, steps=MOST_STEPS - left, products=products)
        x = found.state.x
        while left > 0 and stride > SHORTEST:
            target = max(0.0, level - stride)
            found = newton.solve(_with_friction(balance, target), omega, x, options)
            if found.converged:
                level, stride = target, GROWTH * stride
                break
            left, products, stride = left - found.steps, products + found.products, 0.5 * stride
        else:
            return None
    return None


def _with_friction(balance: HarmonicBalance, level: float) -> HarmonicBalance:
    """The same problem with all coefficients of friction times ten to the level."""
    if level == 0.0:
        return balance

    def rougher(p: ContactParameters) -> ContactParameters:
        if FRICTION not in p.numbers:
            return p
        return replace(p, numbers={**p.numbers, FRICTION: p.numbers[FRICTION] * 10.0**level})

    return replace(balance, contact=balance.contact.with_parameters(rougher))
