"""Mean wear depth over the area of the contact, both surfaces together."""

from tribodyn.hbm.quantity import WearQuantity, WornContact


def value(worn: WornContact) -> float:
    """Depth at the end of the run [m]."""
    area = worn.area[worn.pairs]
    return float(worn.depth @ area / area.sum())


QUANTITY = WearQuantity("mean wear depth", "m", value, by_joint=True, rank=12, grows=True)
