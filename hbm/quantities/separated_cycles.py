"""Cycles until the last touch of the contact has ended."""

from tribodyn.hbm.quantity import WearQuantity, WornContact


def value(worn: WornContact) -> float | None:
    """Cycles at the end of the run; None where it ended before that."""
    return worn.cycles if worn.history.ended.lost else None


QUANTITY = WearQuantity("cycles until every pair is separated", "cycles", value, rank=23, headline=False)
