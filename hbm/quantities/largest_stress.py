"""Largest stress of von Mises over the cycle, anywhere in the part."""

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, SolvedCycle, largest_of


def numbers(cycle: SolvedCycle) -> dict[int, float]:
    """The node of the largest -> it [Pa]; none where stress is not asked for."""
    stress = None if cycle.whole is None else cycle.whole().largest
    return {} if stress is None else {int(stress.argmax()): float(stress.max())}


QUANTITY = CycleQuantity(
    "largest stress of the part (von Mises)", "Pa", error=ErrorKind.CYCLE, rank=10, **largest_of(numbers)
)
