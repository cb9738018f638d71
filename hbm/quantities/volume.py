"""Worn volume, both surfaces together."""

from tribodyn.hbm.quantity import WearQuantity, WornContact


def value(worn: WornContact) -> float:
    """Volume at the end of the run [m3]."""
    return float(worn.depth @ worn.area[worn.pairs])


QUANTITY = WearQuantity(
    "worn volume", "m3", value, by_joint=True, rank=13, grows=True,
)  # fmt: skip
