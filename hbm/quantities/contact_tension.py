"""Largest tension along the faces of a contact over the cycle, which lies at the edge behind a slipping part of it.

There it falls like the root of the distance, so that its error falls like the root of the element size."""

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, largest_of

QUANTITY = CycleQuantity(
    "largest tension along the contact", "Pa", by_joint=True, error=ErrorKind.CYCLE, rank=44, headline=False, order=0.5,
    **largest_of(lambda cycle: cycle.largest_of_pairs(lambda stress: stress.tension)),
)  # fmt: skip
