"""Frequency of the cycle: that of the resonance peak, or the one that the scene gives."""

import numpy as np

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, Slopes, SolvedCycle


def value(cycle: SolvedCycle) -> float:
    """Frequency [Hz]. How it moves follows from the condition of the peak, see `hbm.derivatives.cycle_derivatives`."""
    return cycle.omega / (2 * np.pi)


def slopes(cycle: SolvedCycle) -> Slopes:
    """By the frequency [rad/s] alone."""
    return Slopes(by_omega=1 / (2 * np.pi))


QUANTITY = CycleQuantity(
    "frequency of the peak", "Hz", value, error=ErrorKind.UNSAMPLED_CYCLE, rank=1, digits=4, slopes=slopes
)
