"""Largest stress of von Mises over the cycle, at the places of the part."""

from tribodyn.hbm.fatigue import largest_von_mises
from tribodyn.hbm.stress_numbers import place_quantity

QUANTITY = place_quantity("largest stress (von Mises)", "Pa", lambda s, basis, _: largest_von_mises(s, basis), rank=7)
