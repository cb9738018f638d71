"""Archard wear law: worn volume is the coefficient times normal force times slip distance.

Source  Archard 1953. Coefficient k = K / H [1/Pa]; k = mu alpha equals the energy law in full slip.
"""

from __future__ import annotations

import numpy as np

from tribodyn.hbm.wear_law import Exposure


def depth_rate(exposure: Exposure) -> np.ndarray:
    """(n_pair,) total wear depth per cycle, k (integral of N |ds|) / A [m]."""
    return exposure.coefficient * exposure.normal_force_times_slip / exposure.area
