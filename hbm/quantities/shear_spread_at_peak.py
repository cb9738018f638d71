"""The same spread by the load path at the peak of the curve."""

import numpy as np

from tribodyn.hbm.quantity import CurveQuantity, SolvedCurve


def value(curve: SolvedCurve) -> float | None:
    """Relative width at the highest converged point; None where the bounds were not computed."""
    branch, spread = curve.branch, curve.spread
    if spread is None or not branch.converged.any():
        return None
    height = np.where(branch.converged, branch.amplitude(branch.output_names[0]), -1.0)
    return float(spread[int(np.argmax(height))])


QUANTITY = CurveQuantity("spread by the load path at the peak", "", value, rank=44)
