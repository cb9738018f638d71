"""Cycles until a pair first opens in a part of the cycle that was closed all through it."""

from tribodyn.hbm.quantity import WearQuantity, WornContact
from tribodyn.hbm.wear.history import first


def value(worn: WornContact) -> float | None:
    """Cycles; None where none opens."""
    return first(worn.events[0])


QUANTITY = WearQuantity("cycles until a pair first lifts", "cycles", value, rank=24, digits=2)
