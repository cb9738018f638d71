"""A number of the stress at each place of a part: the largest of all places, and how it moves with the outputs."""

from collections.abc import Callable
from functools import partial

import numpy as np

from tribodyn.hbm.fatigue import StressPlace
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, Slopes, SolvedCycle, largest_of

PlaceNumber = Callable[[np.ndarray, HarmonicBasis, StressPlace], np.ndarray | None]
"""Computes a number from a cycle of stress (6, n_coeff) [Pa] at a place; None where there is none."""


def place_quantity(title: str, unit: str, number: PlaceNumber, rank: int, headline: bool = True) -> CycleQuantity:
    """The quantity of a number of the stress: the largest of all places, and that of each place."""
    return CycleQuantity(
        title, unit, by_place=True, error=ErrorKind.CYCLE, rank=rank, headline=headline,
        slopes=partial(slopes_of_largest, number=number), **largest_of(partial(values_at_places, number=number)),
    )  # fmt: skip


def values_at_places(cycle: SolvedCycle, number: PlaceNumber) -> dict[str, float]:
    """Place that the cycle is asked of -> its number, of those that have one."""
    stress = [place.stress(cycle.response, cycle.basis) for place in cycle.places]
    values = {p.name: number(s, cycle.basis, p) for p, s in zip(cycle.places, stress, strict=True)}
    return {name: float(value) for name, value in values.items() if value is not None}


def slopes_of_largest(cycle: SolvedCycle, number: PlaceNumber, step: float = 1e-6) -> Slopes:
    """Adjoint slopes of the largest number by the outputs of its place, by central differences of the number itself.

    step : over the largest coefficient; the number is a closed expression of a few coefficients, right to rounding"""
    by_response = np.zeros_like(cycle.response)
    values = values_at_places(cycle, number)
    if not values:
        return Slopes()
    (place,) = (place for place in cycle.places if place.name == max(values, key=values.__getitem__))
    stress = place.stress(cycle.response, cycle.basis)
    size = step * float(np.abs(stress).max())
    slopes = np.zeros(stress.shape)
    for entry in np.ndindex(*stress.shape) if size else ():
        moved = [stress.copy(), stress.copy()]
        moved[0][entry] += size
        moved[1][entry] -= size
        above, below = (number(each, cycle.basis, place) for each in moved)
        if above is not None and below is not None:
            slopes[entry] = float(above - below) / (2 * size)
    by_response[place.rows] = slopes
    return Slopes(by_response=by_response)
