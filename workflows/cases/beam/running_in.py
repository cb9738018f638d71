"""Example of a wear law of one's own: the energy law whose coefficient falls while the faces run in.

In a scene, beside which this file lies: law = "running_in.py" in [wear]. A fresh face wears RATIO times as fast as one
that has lost a depth well above DEPTH.
"""

from __future__ import annotations

import numpy as np

from tribodyn.hbm.wear_law import Exposure

RATIO = 4.0
DEPTH = 20e-6  # [m]


def depth_rate(exposure: Exposure) -> np.ndarray:
    """(n_pair,) total wear depth per cycle [m]; the coefficient of the scene is that of the run-in faces [m3/J]."""
    coefficient = exposure.coefficient * (1 + (RATIO - 1) * np.exp(-exposure.depth / DEPTH))
    return coefficient * exposure.energy / exposure.area
