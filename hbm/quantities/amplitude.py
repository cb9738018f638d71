"""Vibration amplitude of the observed output."""

from __future__ import annotations

import numpy as np

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, MotionInTime, Slopes, SolvedCycle


def value(cycle: SolvedCycle) -> float:
    """Amplitude [m]; see `hbm.continuation.branch.amplitude`."""
    return cycle.amplitude


def slopes(cycle: SolvedCycle) -> Slopes:
    """Adjoint slopes by the harmonics of the output."""
    by_response = np.zeros_like(cycle.response)
    row = cycle.response[cycle.output]
    if cycle.amplitude > 0:
        by_response[cycle.output] = np.where(cycle.basis.order > 0, row, 0.0) / cycle.amplitude
    return Slopes(by_response=by_response)


def in_time(motion: MotionInTime) -> tuple[float, float]:
    """Mean amplitude over the periods."""
    return float(motion.means.amplitude[0]), 0.0


QUANTITY = CycleQuantity(
    "vibration amplitude", "m", value, error=ErrorKind.CYCLE, rank=2, slopes=slopes, in_time=in_time
)
