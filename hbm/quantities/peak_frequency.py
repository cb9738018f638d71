"""Frequency of the cycle: that of the resonance peak, or the one that the scene gives."""

from __future__ import annotations

import numpy as np

from tribodyn.hbm.quantity import CycleQuantity, ErrorKind, SolvedCycle


def value(cycle: SolvedCycle) -> float:
    """Frequency [Hz]. Its derivatives follow from the condition of the peak, see `hbm.derivatives`."""
    return cycle.omega / (2 * np.pi)


QUANTITY = CycleQuantity("frequency of the peak", "Hz", value, error=ErrorKind.UNSAMPLED_CYCLE, rank=1)
