"""Volume that is worn off body 2."""

from tribodyn.hbm.quantities import volume
from tribodyn.hbm.quantity import WearQuantity, WornContact


def value(worn: WornContact) -> float:
    """Its share of the worn volume [m3]."""
    return (1 - worn.share_of_body_1) * volume.value(worn)


QUANTITY = WearQuantity("volume worn off body 2", "m3", value, rank=15, headline=False)
