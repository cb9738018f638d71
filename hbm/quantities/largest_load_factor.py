"""Largest factor on the vibrating loads along a response under control, where it is found."""

from tribodyn.hbm.quantity import CurveQuantity, SolvedCurve


def value(curve: SolvedCurve) -> float | None:
    """Load factor of the converged points; None where the force is given."""
    branch = curve.branch
    return float(branch.load_factor[branch.converged].max()) if branch.controlled else None


QUANTITY = CurveQuantity("largest load factor", "", value, rank=42, headline=False)
