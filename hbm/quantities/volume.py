"""Worn volume, both surfaces together."""

from __future__ import annotations

import numpy as np

from tribodyn.hbm.quantity import EndOfLife, WearQuantity, WornContact


def value(worn: WornContact) -> float:
    """Volume at the end of the run [m3]."""
    return float(worn.depth @ worn.area[worn.pairs])


def at_end_of_life(end: EndOfLife) -> float:
    """Volume where the life ends [m3]."""
    return float(end.area @ end.depth)


def tangent(end: EndOfLife) -> np.ndarray:
    """Derivatives by depth and by the areas that wear."""
    return np.asarray(end.area @ end.by_depth + end.depth @ end.by_area)


QUANTITY = WearQuantity(
    "worn volume", "m3", value, by_joint=True, rank=13, grows=True, at_end_of_life=at_end_of_life,
    tangent=tangent,
)  # fmt: skip
