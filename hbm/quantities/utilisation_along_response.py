"""Largest utilisation in fatigue along a response, such as the operating line of a wheel: 1 is the limit."""

from tribodyn.hbm.quantity import CurveQuantity, SolvedCurve


def value(curve: SolvedCurve) -> float | None:
    """The largest of the places at the converged points; None where no strength is known."""
    if curve.basis is None:
        return None
    points, basis = curve.branch.response[curve.branch.converged], curve.basis
    uses = [p.utilisation(p.stress(points, basis), basis) for p in curve.places if p.strength is not None]
    return max((float(use.max()) for use in uses if use.size), default=None)


QUANTITY = CurveQuantity("largest utilisation in fatigue along the response", "", value, rank=43)
