"""Largest utilisation of the endurance limit in high-cycle fatigue, anywhere in the part: 1 is the limit."""

import numpy as np

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, SolvedCycle, largest_of


def numbers(cycle: SolvedCycle) -> dict[int, float]:
    """The node of the largest -> it; none where stress is not asked for or no strength is known."""
    use = np.zeros(0) if cycle.whole is None else cycle.whole().utilisation
    return {int(np.nanargmax(use)): float(np.nanmax(use))} if np.isfinite(use).any() else {}


QUANTITY = CycleQuantity(
    "largest utilisation of the part in fatigue", "", error=ErrorKind.CYCLE, rank=11, **largest_of(numbers)
)
