"""Largest utilisation of the endurance limit in high-cycle fatigue, anywhere in the part: 1 is the limit."""

import numpy as np

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, SolvedCycle


def value(cycle: SolvedCycle) -> float | None:
    """The largest of all nodes; None where stress is not asked for or no strength is known."""
    use = np.zeros(0) if cycle.whole is None else cycle.whole().utilisation
    return float(np.nanmax(use)) if np.isfinite(use).any() else None


def where(cycle: SolvedCycle) -> int:
    """Its node."""
    return 0 if cycle.whole is None else int(np.nanargmax(cycle.whole().utilisation))


QUANTITY = CycleQuantity(
    "largest utilisation of the part in fatigue", "", value, error=ErrorKind.CYCLE, rank=11, where=where
)
