"""Archard wear law: worn volume is the coefficient times normal force times slip distance.

Source  Archard 1953. Coefficient k = K / H [1/Pa]; k = mu alpha equals the energy law in full slip."""

from dataclasses import dataclass

import numpy as np

from tribodyn.declarations import number
from tribodyn.hbm.wear.law import Exposure


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    coefficient: float = number("m3/J", role="wear_coefficient", low=0.0, usual=(0.0, 1e-9))
    """Worn volume per normal force and slip distance, k = K / H; 1 m3/J is 1/Pa."""


def depth_rate(exposure: Exposure) -> np.ndarray:
    """(n_pair,) total wear depth per cycle, k (integral of N |ds|) / A [m]."""
    return exposure.numbers["coefficient"] * exposure.normal_force_times_slip / exposure.area
