"""Utilisation of the endurance limit in high-cycle fatigue, at the places of the part: 1 is the limit."""

from tribodyn.hbm.stress_numbers import place_quantity

QUANTITY = place_quantity(
    "utilisation in fatigue",
    "",
    lambda s, basis, place: place.utilisation(s, basis) if place.strength else None,
    rank=9,
)
