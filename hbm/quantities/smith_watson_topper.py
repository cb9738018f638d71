"""Indicator of cracks at a contact by Smith, Watson and Topper: largest tension times half the range of strain.

It compares joints and places of one material. It says no life: cracks start in a layer of some 10 um in which this
stress falls steeply, surfaces wear and oxidise, and friction work is not in it.
Source  Smith, Watson and Topper, J. Materials 5 (1970) 767"""

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, largest_of

QUANTITY = CycleQuantity(
    "indicator of Smith, Watson and Topper at the contact", "Pa", by_joint=True, error=ErrorKind.CYCLE, rank=45,
    headline=False, order=0.5, **largest_of(lambda cycle: cycle.largest_of_pairs(lambda stress: stress.watson)),
)  # fmt: skip
