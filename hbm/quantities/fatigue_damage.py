"""Miner's sum over the cycles of the run and the duties of its mission, at the worst place: 1 is a crack."""

from tribodyn.hbm.quantity import ErrorKind, WearQuantity, WornContact


def value(worn: WornContact) -> float | None:
    """The sum; None where no place has an S-N line."""
    sums = [float(place.miner_sum()[1][-1]) for place in worn.fatigue.values() if place.strength.knee]
    return max(sums, default=None)


def applies(worn: WornContact) -> bool:
    """Whether a place has an S-N line."""
    return any(place.strength is not None and place.strength.knee is not None for place in worn.places)


QUANTITY = WearQuantity(
    "Miner's sum of fatigue", "", value, error=ErrorKind.DURATION, rank=29, grows=True, headline=False, applies=applies,
)  # fmt: skip
