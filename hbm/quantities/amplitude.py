"""Vibration amplitude of the observed output."""

import numpy as np

from tribodyn.hbm.harmonics import amplitude_slope
from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, MotionInTime, Slopes, SolvedCycle


def value(cycle: SolvedCycle) -> float:
    """Amplitude [m]; half the range of the cycle."""
    return cycle.amplitude


def slopes(cycle: SolvedCycle) -> Slopes:
    """Adjoint slopes by the harmonics of the output."""
    by_response = np.zeros_like(cycle.response)
    by_response[cycle.output] = amplitude_slope(cycle.response[cycle.output], cycle.basis.harmonics)
    return Slopes(by_response=by_response)


def in_time(motion: MotionInTime) -> tuple[float, float]:
    """Mean amplitude over the periods."""
    return float(motion.means.amplitude[0]), 0.0


QUANTITY = CycleQuantity(
    "vibration amplitude", "m", value, error=ErrorKind.CYCLE, rank=2, slopes=slopes, in_time=in_time
)
