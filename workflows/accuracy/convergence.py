"""Bounds of discretisation errors from solutions on other meshes.

Differences are relative and signed: (other - own) over the finer of both. Sizes are of elements, over the scene's own.
Sources  Roache 1994, J. Fluids Eng. 116, and 1998, Verification and Validation, 5.9: a safety on an error that is
         extrapolated from other meshes; Eca and Hoekstra 2014, J. Comput. Phys. 262: the range of the data bounds the
         error where answers scatter. The sum of both differences is ours, its constants are those of the scoreboard
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

SAFETY = 1.35  # of a bound from two meshes: it covers orders from 0.75 on, of corners and borders of contacts
UNSETTLED = 2.0  # times as much where the meshes are too coarse for any order
# weight of the coarser mesh in the error of a resultant force, which settles at second order, where the whole weight
# stands for 2.7 times the error: with half of it an error of second order counts twice, one of first order 1.1 times
RESULTANT = 0.5
STEEPER = 1.4  # times as much where an answer changes faster with finer elements than with coarser ones
SETTLED = 0.2  # relative difference to another mesh above which a quantity has not begun to settle


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


def bound(seen: Sequence[Difference], settled: bool = True, coarser_counts: float = 1.0) -> float:
    """Relative error of the scene's own answer, from its differences to others that change the same.

    seen : at least one; settled : whether the meshes are fine enough for an order
    coarser_counts : weight of the coarser mesh beside a finer one, RESULTANT for a force
    With a finer and a coarser mesh, of sizes s and t: SAFETY (|f| / (1 - s^2) + |c| s / (1 + s) / (t - 1)) of both
    differences. The first term is an error of second order, as the finer mesh tells it; the second makes the sum SAFETY
    times an error of first order, too. No order is observed: edges with a single element cannot be made coarser, and
    two meshes agree by chance. So a difference that vanishes deceives nobody. One side alone: the error of first order.
    """
    finer = [one for one in seen if one.size < 1]
    coarser = [one for one in seen if one.size > 1]
    if not finer:
        return max(abs(one.change) / (one.size - 1) for one in coarser)
    fine = min(finer, key=lambda one: one.size)
    if not coarser:
        return abs(fine.change) / (1 - fine.size)
    coarse = min(coarser, key=lambda one: one.size)
    second = abs(fine.change) / (1 - fine.size**2)
    rest = abs(coarse.change) * fine.size / (1 + fine.size) / (coarse.size - 1)
    return SAFETY * (1.0 if settled else UNSETTLED) * (second + coarser_counts * rest)


def has_settled(differences: Sequence[Difference]) -> bool:
    """Whether no quantity differs so much from that on another mesh that nothing can be said of its order."""
    return all(abs(one.change) <= SETTLED for one in differences)


def steepens(seen: Sequence[Difference]) -> bool:
    """Whether a finer mesh changes an answer by more, for its size, than a coarser one does: no order shows."""
    finer = [abs(one.change) / (1 - one.size) for one in seen if one.size < 1]
    coarser = [abs(one.change) / (one.size - 1) for one in seen if one.size > 1]
    return bool(finer and coarser) and max(finer) > max(coarser)
