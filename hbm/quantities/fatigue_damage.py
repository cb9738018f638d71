"""Miner's sum over the cycles of the run and the duties of its mission, at the worst place: 1 is a crack."""

from tribodyn.hbm.quantity import ErrorKind, WearQuantity, WornContact, largest_of


def sums(worn: WornContact) -> dict[str, float]:
    """Place -> its sum, of those with an S-N line."""
    return {name: float(p.miner_sum()[1][-1]) for name, p in worn.fatigue.items() if p.strength.knee}


def applies(worn: WornContact) -> bool:
    """Whether a place has an S-N line."""
    return any(place.strength is not None and place.strength.knee is not None for place in worn.places)


QUANTITY = WearQuantity(
    "Miner's sum of fatigue", "", error=ErrorKind.DURATION, rank=29, grows=True, headline=False, applies=applies,
    **largest_of(sums),
)  # fmt: skip
