"""Archard wear law: worn volume is the coefficient times normal force times slip distance.

Source  Archard 1953. Coefficient k = K / H [1/Pa]; k = mu alpha equals the energy law in full slip.
"""

from __future__ import annotations

import numpy as np

from hbm.wear_law import Exposure


def depth_rate(exposure: Exposure) -> np.ndarray:
    """(n_pair,) total wear depth per cycle, k (integral of N |ds|) / A [m]."""
    return exposure.coefficient * exposure.normal_force_times_slip / exposure.area


def depth_per_work(exposure: Exposure) -> np.ndarray:
    """(n_pair,) k / (mu A) [m/J]: under Coulomb friction the work over a cycle is mu times the integral of N |ds|."""
    friction = exposure.balance.parameters.friction
    per_work = exposure.coefficient / exposure.area
    return np.divide(per_work, friction, out=np.zeros_like(per_work), where=friction > 0)
