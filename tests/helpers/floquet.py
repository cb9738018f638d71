"""Floquet multipliers of a stability that was found."""

import numpy as np

from tribodyn.hbm.stability.exponents import Stability


def multipliers(stability: Stability) -> np.ndarray:
    """(n,) complex factors exp(lambda T) by which perturbations change over one period."""
    return np.exp(stability.exponents * 2 * np.pi / stability.omega)
