"""Root mean square of the vibration of the observed output."""

import numpy as np

from tribodyn.hbm.quantity import CycleQuantity, Slopes, SolvedCycle


def value(cycle: SolvedCycle) -> float:
    """About the mean [m]."""
    return float(np.linalg.norm(_vibration(cycle)) / np.sqrt(2))


def slopes(cycle: SolvedCycle) -> Slopes:
    """Adjoint slopes by the harmonics of the output."""
    by_response, vibration = np.zeros_like(cycle.response), _vibration(cycle)
    if vibration.any():
        by_response[cycle.output] = vibration / (np.sqrt(2) * np.linalg.norm(vibration))
    return Slopes(by_response=by_response)


def _vibration(cycle: SolvedCycle) -> np.ndarray:
    return np.where(cycle.basis.order > 0, cycle.response[cycle.output], 0.0)


QUANTITY = CycleQuantity("r.m.s. of the vibration", "m", value, rank=3, headline=False, slopes=slopes)
