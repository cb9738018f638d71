"""Largest wear depth of any pair, both surfaces together."""

from __future__ import annotations

import numpy as np

from tribodyn.hbm.quantity import EndOfLife, ErrorKind, WearQuantity, WornContact


def value(worn: WornContact) -> float:
    """Depth at the end of the run [m]."""
    return float(worn.depth.max())


def at_end_of_life(end: EndOfLife) -> float:
    """Depth where the life ends [m]."""
    return float(end.depth.max())


def tangent(end: EndOfLife) -> np.ndarray:
    """Derivatives of the depth of the deepest pair."""
    return np.asarray(end.by_depth[int(end.depth.argmax())])


QUANTITY = WearQuantity(
    "largest wear depth", "m", value, by_joint=True, error=ErrorKind.DEPTH, rank=11, grows=True,
    at_end_of_life=at_end_of_life, tangent=tangent,
)  # fmt: skip
