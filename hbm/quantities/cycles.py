"""Vibration cycles that the run has passed."""

from tribodyn.hbm.quantity import WearQuantity, WornContact


def value(worn: WornContact) -> float:
    """Cycles at the end of the run."""
    return worn.cycles


def remark(worn: WornContact) -> str:
    """Why the run ended."""
    return str(worn.history.end).split(";")[0]


QUANTITY = WearQuantity("cycles of the run", "cycles", value, rank=20, remark=remark)
