"""Cycles until a pair first touches no more."""

from tribodyn.hbm.quantity import WearQuantity, WornContact
from tribodyn.hbm.wear.history import first


def value(worn: WornContact) -> float | None:
    """Cycles; None where every pair still touches."""
    return first(worn.events[1])


QUANTITY = WearQuantity("cycles until a pair first loses contact", "cycles", value, rank=25, digits=2, headline=False)
