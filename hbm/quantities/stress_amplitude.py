"""Equivalent amplitude of the multiaxial stress in a cycle, at the places of the part."""

from tribodyn.hbm.fatigue import equivalent_amplitude
from tribodyn.hbm.stress_numbers import place_quantity

QUANTITY = place_quantity(
    "stress amplitude", "Pa", lambda s, basis, _: equivalent_amplitude(s, basis), rank=8, headline=False
)
