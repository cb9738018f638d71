"""Largest utilisation in fatigue along a response, such as the operating line of a wheel: 1 is the limit."""

from tribodyn.hbm.quantity import CurveQuantity, SolvedCurve


def utilisations(curve: SolvedCurve) -> dict[str, float]:
    """Place whose strength is known -> its largest at the converged points."""
    if curve.basis is None or not curve.branch.converged.any():
        return {}
    points, basis = curve.branch.response[curve.branch.converged], curve.basis
    judged = [place for place in curve.places if place.strength is not None]
    return {place.name: float(place.utilisation(place.stress(points, basis), basis).max()) for place in judged}


def value(curve: SolvedCurve) -> float | None:
    """The largest of the places; None where no strength is known."""
    return max(utilisations(curve).values(), default=None)


def where(curve: SolvedCurve) -> str:
    """Its place, "" for none."""
    of_place = utilisations(curve)
    return max(of_place, key=of_place.__getitem__, default="")


QUANTITY = CurveQuantity("largest utilisation in fatigue along the response", "", value, rank=43, where=where)
