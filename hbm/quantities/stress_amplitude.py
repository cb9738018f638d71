"""Equivalent amplitude of the multiaxial stress in a cycle, at the places of the part."""

import numpy as np

from tribodyn.hbm.fatigue import StressPlace, equivalent_amplitude
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.stress_numbers import place_quantity


def number(stress: np.ndarray, basis: HarmonicBasis, place: StressPlace) -> float:
    """Of a cycle of stress (6, n_coeff) [Pa]."""
    return float(equivalent_amplitude(stress, basis))


QUANTITY = place_quantity("stress amplitude", "Pa", number, rank=8, headline=False)
