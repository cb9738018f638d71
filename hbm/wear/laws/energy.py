"""Energy wear law: worn volume is the coefficient times the friction work.

Source  Fouvry et al. 2003; Tamatam 2021, eq. 3.29: v_w = Z alpha E / A. Coefficient alpha [m3/J]."""

from dataclasses import dataclass

import numpy as np

from tribodyn.declarations import number
from tribodyn.hbm.wear.law import Exposure


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    coefficient: float = number("m3/J", role="wear_coefficient", low=0.0, usual=(0.0, 1e-9))
    """Worn volume per friction work, alpha."""


def depth_rate(exposure: Exposure) -> np.ndarray:
    """(n_pair,) total wear depth per cycle, alpha E / A [m]."""
    return exposure.numbers["coefficient"] * exposure.energy / exposure.area
