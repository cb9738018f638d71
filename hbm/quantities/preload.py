"""Mean normal force of the contact over a cycle."""

import numpy as np

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, MotionInTime, Slopes, SolvedCycle


def value(cycle: SolvedCycle) -> float | None:
    """Sum over the pairs [N]; at a row of wear that of all joints that wear."""
    if not cycle.joint:
        return cycle.preload
    return None if cycle.normal_force is None else float(cycle.normal_force[cycle.pairs].sum())


def slopes(cycle: SolvedCycle) -> Slopes:
    """Adjoint slopes: the static normal force itself."""
    by_force = np.zeros_like(cycle.displacement)
    if "n" in cycle.components and cycle.basis.has_static:
        by_force[:, cycle.components.index("n"), 0] = 1.0
    return Slopes(by_force=cycle.mask * by_force)


def in_time(motion: MotionInTime) -> tuple[float, float]:
    """Mean of one sector."""
    return float(motion.means.normal_force.sum() / motion.sectors), 0.0


QUANTITY = CycleQuantity(
    "preload", "N", value, by_joint=True, error=ErrorKind.CYCLE, rank=5, slopes=slopes, in_time=in_time, at_rest=True
)
