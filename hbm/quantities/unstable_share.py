"""Share of the cycles that were worn along an unstable solution of the balance."""

from tribodyn.hbm.quantity import WearQuantity, WornContact


def value(worn: WornContact) -> float | None:
    """Share of the cycles; None where stability is not known."""
    return worn.history.unstable_share


QUANTITY = WearQuantity("unstable share of the cycles", "", value, rank=32, headline=False)
