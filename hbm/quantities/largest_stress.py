"""Largest stress of von Mises over the cycle, anywhere in the part."""

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, SolvedCycle


def value(cycle: SolvedCycle) -> float | None:
    """The largest of all nodes [Pa]; None where stress is not asked for."""
    return None if cycle.whole is None else float(cycle.whole().largest.max())


def where(cycle: SolvedCycle) -> int:
    """Its node."""
    return 0 if cycle.whole is None else int(cycle.whole().largest.argmax())


QUANTITY = CycleQuantity(
    "largest stress of the part (von Mises)", "Pa", value, error=ErrorKind.CYCLE, rank=10, where=where
)
