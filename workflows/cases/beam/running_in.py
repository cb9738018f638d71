"""Example of a user's wear law: the energy law whose coefficient falls while the faces run in.

In a scene in the same folder: law = "running_in.py" in [wear]. A fresh face wears `ratio` times as fast as
one that has lost a depth well above `depth`; both are further keys of [wear]."""

from dataclasses import dataclass

import numpy as np

from tribodyn import Exposure
from tribodyn.declarations import number


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    coefficient: float = number("m3/J", role="wear_coefficient", low=0.0)
    """Worn volume per friction work of run-in faces."""
    ratio: float = number("", default=4.0, low=0.0)
    """Wear of a fresh face over that of a run-in one."""
    depth: float = number("m", default=20e-6, above=0.0)
    """Depth over which a face runs in."""


def depth_rate(exposure: Exposure) -> np.ndarray:
    """(n_pair,) total wear depth per cycle [m]."""
    values = exposure.numbers
    coefficient = values["coefficient"] * (1 + (values["ratio"] - 1) * np.exp(-exposure.depth / values["depth"]))
    return coefficient * exposure.energy / exposure.area
