"""How far the curve depends on the load path: largest width of the range of amplitudes over its middle."""

import numpy as np

from tribodyn.hbm.quantity import CurveQuantity, SolvedCurve


def value(curve: SolvedCurve) -> float | None:
    """Relative width, the largest of all points; None where the bounds were not computed."""
    spread = curve.spread
    return float(np.nanmax(spread)) if spread is not None and curve.branch.converged.any() else None


QUANTITY = CurveQuantity("spread by the load path", "", value, rank=43)
