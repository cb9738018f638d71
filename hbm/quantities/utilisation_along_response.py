"""Largest utilisation in fatigue along a response, such as the operating line of a wheel: 1 is the limit."""

from tribodyn.hbm.quantity import CurveQuantity, SolvedCurve, largest_of


def utilisations(curve: SolvedCurve) -> dict[str, float]:
    """Place whose strength is known -> its largest at the converged points."""
    if curve.basis is None or not curve.branch.converged.any():
        return {}
    points, basis = curve.branch.response[curve.branch.converged], curve.basis
    judged = [place for place in curve.places if place.strength is not None]
    return {place.name: float(place.utilisation(place.stress(points, basis), basis).max()) for place in judged}


QUANTITY = CurveQuantity("largest utilisation in fatigue along the response", "", rank=43, **largest_of(utilisations))
