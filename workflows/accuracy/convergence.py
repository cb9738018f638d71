"""Bounds of discretisation errors from solutions on other meshes: Roache's grid convergence index.

Differences are relative and signed: (other - own) over the finer of both. Sizes are of elements, over the scene's own.
Sources  Roache 1994, J. Fluids Eng. 116, and 1998, Verification and Validation, 5.9: safety 1.25 with three meshes that
         show an order, 3 otherwise; Eca and Hoekstra 2014, J. Comput. Phys. 262: the range of the data
         bounds the error where answers scatter
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

ORDERS = (
    0.75,
    2.0,
)  # re-entrant corners and borders of contacts leave less than first order; linear elements reach second
OBSERVED, GUESSED = 1.25, 3.0  # safety where the order is observed, and where the meshes are too coarse to have one
SETTLED = 0.5  # relative difference to a finer mesh above which a quantity has not begun to settle


@dataclass(frozen=True)
class Difference:
    """size : of the other's elements over those of the scene; change : relative to the finer of both, signed."""

    size: float
    change: float


def difference(size: float, other: float, own: float) -> Difference:
    """The difference of an answer to the scene's own."""
    finer = other if size < 1 else own
    if finer == 0:
        return Difference(size, 0.0 if other == own else 1.0)
    return Difference(size, (other - own) / abs(finer))


def bound(seen: Sequence[Difference], settled: bool = True) -> float:
    """Relative error of the scene's own answer, from its differences to others that change the same.

    seen : at least one; settled : whether the meshes are fine enough for an order
    A finer and a coarser mesh tell the order, which is kept within ORDERS. The bound is never below the difference to
    the coarser one, with the same safety: a difference that vanishes by chance deceives nobody. Otherwise the error is
    of first order.
    """
    finer = [one for one in seen if one.size < 1]
    coarser = [one for one in seen if one.size > 1]
    if not finer:
        return max(abs(one.change) / (one.size - 1) for one in coarser)
    fine = min(finer, key=lambda one: one.size)
    if not coarser:
        return abs(fine.change) / (1 - fine.size)
    change, coarse = abs(fine.change), min(coarser, key=lambda one: one.size)
    if not settled:
        error = GUESSED * change / (1 - fine.size ** ORDERS[1])
    elif fine.change * coarse.change >= 0:  # answers go up and down: no order is observed
        error = OBSERVED * change / (1 - fine.size)
    else:
        error = OBSERVED * change / (1 - fine.size ** _order(fine, coarse))
    return max(error, OBSERVED * abs(coarse.change))


def has_settled(differences: Sequence[Difference]) -> bool:
    """Whether no quantity differs so much from that on a finer mesh that nothing can be said of its order."""
    return all(abs(one.change) <= SETTLED for one in differences if one.size < 1)


def _order(fine: Difference, coarse: Difference) -> float:
    """Order within ORDERS by which both differences fit c (size^p - 1)."""
    orders = np.linspace(*ORDERS, 101)
    ratios = (coarse.size**orders - 1) / (1 - fine.size**orders)
    return float(np.interp(abs(coarse.change) / abs(fine.change), ratios, orders)) if fine.change else ORDERS[1]
