"""Volume that is worn off body 1."""

from tribodyn.hbm.quantities import volume
from tribodyn.hbm.quantity import WearQuantity, WornContact


def value(worn: WornContact) -> float:
    """Its share of the worn volume [m3]."""
    return worn.share_of_body_1 * volume.value(worn)


QUANTITY = WearQuantity("volume worn off body 1", "m3", value, rank=14, headline=False)
