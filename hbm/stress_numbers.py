"""A number of the stress at each place of a part: the largest of all places, and how it moves with the outputs."""

from collections.abc import Callable
from functools import partial

import numpy as np

from tribodyn.hbm.fatigue import StressPlace
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, Slopes, SolvedCycle

PlaceNumber = Callable[[np.ndarray, HarmonicBasis, StressPlace], float | None]
"""Computes a number from a cycle of stress (6, n_coeff) [Pa] at a place; None where there is none."""


def place_quantity(title: str, unit: str, number: PlaceNumber, rank: int, headline: bool = True) -> CycleQuantity:
    """The quantity of a number of the stress: the largest of all places, and that of each place."""
    return CycleQuantity(
        title, unit, partial(largest, number=number), by_place=True, error=ErrorKind.CYCLE, rank=rank,
        headline=headline, slopes=partial(slopes_of_largest, number=number),
        where=lambda cycle: max(_values(cycle, number), key=lambda pair: pair[0])[1].name,
    )  # fmt: skip


def largest(cycle: SolvedCycle, number: PlaceNumber) -> float | None:
    """The largest number of all places that the cycle is asked of; None without."""
    return max((value for value, _ in _values(cycle, number)), default=None)


def slopes_of_largest(cycle: SolvedCycle, number: PlaceNumber, step: float = 1e-6) -> Slopes:
    """Adjoint slopes of the largest number by the outputs of its place, by central differences of the number itself.

    step : over the largest coefficient; the number is a closed expression of a few coefficients, right to rounding"""
    by_response = np.zeros_like(cycle.response)
    values = _values(cycle, number)
    if not values:
        return Slopes()
    _, place = max(values, key=lambda pair: pair[0])
    stress = place.stress(cycle.response, cycle.basis)
    size = step * float(np.abs(stress).max())
    slopes = np.zeros(stress.shape)
    for entry in np.ndindex(*stress.shape) if size else ():
        moved = [stress.copy(), stress.copy()]
        moved[0][entry] += size
        moved[1][entry] -= size
        above, below = (number(each, cycle.basis, place) for each in moved)
        if above is not None and below is not None:
            slopes[entry] = (above - below) / (2 * size)
    by_response[place.rows] = slopes
    return Slopes(by_response=by_response)


def _values(cycle: SolvedCycle, number: PlaceNumber) -> list[tuple[float, StressPlace]]:
    places = [(place, place.stress(cycle.response, cycle.basis)) for place in cycle.places]
    values = [(number(stress, cycle.basis, place), place) for place, stress in places]
    return [(value, place) for value, place in values if value is not None]
