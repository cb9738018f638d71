"""Largest wear depth of any pair, both surfaces together."""

from tribodyn.hbm.quantity import ErrorKind, WearQuantity, WornContact


def value(worn: WornContact) -> float:
    """Depth at the end of the run [m]."""
    return float(worn.depth.max())


QUANTITY = WearQuantity(
    "largest wear depth", "m", value, by_joint=True, error=ErrorKind.DEPTH, rank=11, grows=True,
)  # fmt: skip
