"""Largest stress of von Mises over the cycle, at the places of the part."""

import numpy as np

from tribodyn.hbm.fatigue import StressPlace, largest_von_mises
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.stress_numbers import place_quantity


def number(stress: np.ndarray, basis: HarmonicBasis, place: StressPlace) -> float:
    """Of a cycle of stress (6, n_coeff) [Pa]."""
    return float(largest_von_mises(stress, basis))


QUANTITY = place_quantity("largest stress (von Mises)", "Pa", number, rank=7)
