"""Frequency of a nonlinear mode at an amplitude."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tribodyn.hbm.quantity import ModeQuantity

if TYPE_CHECKING:
    from tribodyn.hbm.continuation.free_vibration import ModePoint


def value(point: ModePoint) -> float:
    """Frequency [Hz]."""
    return point.omega / (2 * np.pi)


def tangent(point: ModePoint, change: np.ndarray) -> float:
    """Change of the frequency with that of the unknowns, where it counts in shares of itself."""
    return float(point.omega / (2 * np.pi) * change[-3])


QUANTITY = ModeQuantity("frequency of the nonlinear mode", "Hz", value, rank=1, tangent=tangent)
