"""Energy wear law: worn volume is the coefficient times the friction work.

Source  Fouvry et al. 2003; Tamatam 2021, eq. 3.29: v_w = Z alpha E / A. Coefficient alpha [m3/J].
"""

from __future__ import annotations

import numpy as np

from tribodyn.hbm.wear_law import Exposure


def depth_rate(exposure: Exposure) -> np.ndarray:
    """(n_pair,) total wear depth per cycle, alpha E / A [m]."""
    return exposure.coefficient * exposure.energy / exposure.area
