"""Volume that wears in one cycle, where it goes with the friction work."""

from tribodyn.hbm.quantities.energy import of_work
from tribodyn.hbm.quantity import CycleQuantity, Slopes, SolvedCycle


def value(cycle: SolvedCycle) -> float | None:
    """Wear coefficient times work, summed over the pairs [m3]; None without coefficients."""
    if cycle.wear_coefficient is None or cycle.energy is None:
        return None
    return float(cycle.wear_coefficient @ cycle.energy)


def slopes(cycle: SolvedCycle) -> Slopes:
    """Adjoint slopes: those of the work, weighted."""
    assert cycle.wear_coefficient is not None
    return of_work(cycle, cycle.wear_coefficient)


QUANTITY = CycleQuantity("worn volume per cycle", "m3", value, rank=6, headline=False, slopes=slopes)
