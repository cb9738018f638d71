"""Friction work over all cycles of the run."""

from tribodyn.hbm.quantity import WearQuantity, WornContact


def value(worn: WornContact) -> float:
    """Work of the pairs [J]."""
    return float(worn.work.sum())


QUANTITY = WearQuantity("accumulated friction work", "J", value, by_joint=True, rank=31, digits=2, grows=True)
