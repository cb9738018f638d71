"""Phase of the observed output in the lowest harmonic that is driven."""

import numpy as np

from tribodyn.hbm.quantity import CycleQuantity, Slopes, SolvedCycle


def value(cycle: SolvedCycle) -> float | None:
    """Phase of a - ib [rad]; None where the driven harmonic is not known or does not move."""
    if cycle.driven is None:
        return None
    a, b = _terms(cycle)
    return float(np.arctan2(-b, a)) if a or b else None


def slopes(cycle: SolvedCycle) -> Slopes:
    """Adjoint slopes by a and b."""
    by_response, (a, b) = np.zeros_like(cycle.response), _terms(cycle)
    cosine, sine = np.flatnonzero(cycle.basis.order == cycle.driven)
    by_response[cycle.output, [cosine, sine]] = b / (a**2 + b**2), -a / (a**2 + b**2)
    return Slopes(by_response=by_response)


def _terms(cycle: SolvedCycle) -> tuple[float, float]:
    cosine, sine = np.flatnonzero(cycle.basis.order == cycle.driven)
    return cycle.response[cycle.output, cosine], cycle.response[cycle.output, sine]


QUANTITY = CycleQuantity("phase of the response", "rad", value, relative=False, rank=3, headline=False, slopes=slopes)
