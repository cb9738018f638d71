"""Indicator of fretting fatigue by Ruiz: tension along the contact times friction work per area and way of slip.

A pair that slips to and fro by d under the shear t does the work 2 t d per area and cycle: t d is half of the work.
Fitted to dovetails of one alloy, it ranks places of a joint, and has no physical ground and no limit for others; it
grows with slip without end, where much slip wears cracks away.
Source  Ruiz and Chen, Proc. Int. Conf. Fatigue of Engineering Materials and Structures, IMechE 1986, C241/86, 187"""

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, SolvedCycle, largest_of


def numbers(cycle: SolvedCycle) -> dict[int, float]:
    """Its node -> it [Pa N/m]; none where the work is not known."""
    energy, area = cycle.energy, cycle.area
    return {} if energy is None or area is None else cycle.largest_of_pairs(lambda s: s.tension * energy / (2 * area))


QUANTITY = CycleQuantity(
    "indicator of Ruiz at the contact", "Pa N/m", by_joint=True, error=ErrorKind.CYCLE, rank=46, headline=False,
    order=0.5, **largest_of(numbers),
)  # fmt: skip
