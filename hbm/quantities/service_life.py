"""Cycles until the contact is lost or a place of the part is spent by fatigue, whichever comes first."""

from tribodyn.hbm.quantities import life
from tribodyn.hbm.quantity import ErrorKind, WearQuantity, WornContact


def lives(worn: WornContact) -> dict[str, float]:
    """What ends -> cycles until then, the contact as ""; only what ends."""
    ends = {"": life.value(worn)} | {name: fatigue.life for name, fatigue in worn.fatigue.items()}
    return {name: cycles for name, cycles in ends.items() if cycles is not None}


def value(worn: WornContact) -> float | None:
    """Cycles; None where nothing ends, or no place has a known strength."""
    return min(lives(worn).values(), default=None) if applies(worn) else None


def where(worn: WornContact) -> str:
    """The place that ends first, "" where the contact does."""
    ends = lives(worn)
    return min(ends, key=ends.__getitem__, default="")


def remark(worn: WornContact) -> str:
    """What ends first."""
    name = where(worn)
    if not name:
        return "until the contact is lost"
    course = "Miner's sum is 1" if worn.fatigue[name].strength.knee else "the endurance limit is reached"
    return f"until {course} at place {name}"


def applies(worn: WornContact) -> bool:
    """Whether the strength of a place is known."""
    return any(place.strength is not None for place in worn.places)


QUANTITY = WearQuantity(
    "cycles until contact or endurance is lost", "cycles", value, error=ErrorKind.DURATION, rank=22, remark=remark,
    applies=applies, where=where,
)  # fmt: skip
