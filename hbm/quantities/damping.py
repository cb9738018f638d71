"""Damping ratio of a nonlinear mode at an amplitude."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tribodyn.hbm.quantity import ModeQuantity

if TYPE_CHECKING:
    from tribodyn.hbm.continuation.free_vibration import ModePoint


def value(point: ModePoint) -> float:
    """Damping ratio."""
    return point.zeta


def tangent(point: ModePoint, change: np.ndarray) -> float:
    """Change of the ratio with that of the unknowns."""
    return float(change[-2])


QUANTITY = ModeQuantity("damping ratio of the nonlinear mode", "", value, rank=2, tangent=tangent)
