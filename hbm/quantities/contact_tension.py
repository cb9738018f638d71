"""Largest tension along the faces of a contact over the cycle, which lies at the edge behind a slipping part of it."""

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, largest_of

QUANTITY = CycleQuantity(
    "largest tension along the contact", "Pa", by_joint=True, error=ErrorKind.CYCLE, rank=44, headline=False,
    **largest_of(lambda cycle: cycle.largest_of_pairs(lambda stress: stress.tension)),
)  # fmt: skip
