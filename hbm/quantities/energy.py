"""Friction work of one vibration cycle."""

import numpy as np

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, MotionInTime, Slopes, SolvedCycle


def value(cycle: SolvedCycle) -> float | None:
    """Work of the pairs [J]; see `HarmonicBalance.energy`."""
    return None if cycle.energy is None else float(cycle.energy[cycle.pairs].sum())


def slopes(cycle: SolvedCycle) -> Slopes:
    """Adjoint slopes of the sum over pairs that work."""
    return of_work(cycle, cycle.mask[:, 0, 0])


def of_work(cycle: SolvedCycle, weight: np.ndarray) -> Slopes:
    """Adjoint slopes of a weighted sum of the work of the pairs; weight : (n_pair,)."""
    x, force, energy = cycle.displacement, cycle.force, cycle.energy
    assert energy is not None
    by_x, by_force = np.zeros_like(x), np.zeros_like(x)
    static, harmonic = int(cycle.basis.has_static), np.pi * np.asarray(cycle.basis.dynamic)
    works = (weight * (energy != 0))[:, None] * harmonic
    for c in (i for i, name in enumerate(cycle.components) if name != "n"):
        cosine, sine = np.s_[:, c, static::2], np.s_[:, c, static + 1 :: 2]
        by_force[cosine], by_force[sine] = works * x[sine], -works * x[cosine]
        by_x[cosine], by_x[sine] = -works * force[sine], works * force[cosine]
    return Slopes(by_x, by_force)


def in_time(motion: MotionInTime) -> tuple[float, float]:
    """Mean work of a period, and what is rounding of it."""
    return float(motion.energy.sum()), motion.least_energy


QUANTITY = CycleQuantity(
    "friction work per cycle", "J", value, by_joint=True, error=ErrorKind.CYCLE, rank=4, slopes=slopes, in_time=in_time
)
