"""Utilisation of the endurance limit in high-cycle fatigue, at the places of the part: 1 is the limit."""

import numpy as np

from tribodyn.hbm.fatigue import StressPlace
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.stress_numbers import place_quantity


def number(stress: np.ndarray, basis: HarmonicBasis, place: StressPlace) -> float | None:
    """Of a cycle of stress (6, n_coeff) [Pa]; None where the strength of the material is not known."""
    return None if place.strength is None else float(place.utilisation(stress, basis))


QUANTITY = place_quantity("utilisation in fatigue", "", number, rank=9)
