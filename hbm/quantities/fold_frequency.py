"""Frequency of a fold of the response, where two branches of solutions meet."""

import numpy as np

from tribodyn.hbm.quantity import FoldQuantity


def value(omega: float) -> float:
    """Frequency [Hz]."""
    return omega / (2 * np.pi)


def slope(omega: float) -> float:
    """By the frequency [rad/s]."""
    return 1 / (2 * np.pi)


QUANTITY = FoldQuantity("frequency of the fold", "Hz", value, rank=1, slope=slope)
