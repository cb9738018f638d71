"""Impact wear law: worn volume is the coefficient times the work that impacts put into the contact spring (ours).

A pair that opens and closes is compressed anew after every impact; the normal force works on it while it closes,
W = integral of N dv over dv > 0, which is k v_max^2 / 2 for one impact on a linear spring. A pair that never opens
is not struck and does not wear. Coefficient [m3/J].
Source  ours, in the spirit of impact wear proportional to impact energy (Rabinowicz 1965); Tamatam 2021, chapter 6,
names the wear of a leaf seal by chattering as the next step and gives no law"""

from dataclasses import dataclass

import numpy as np

from tribodyn.declarations import number
from tribodyn.hbm.contact.contact_law import SEPARATES
from tribodyn.hbm.wear.law import Exposure
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    coefficient: float = number("m3/J", role="wear_coefficient", low=0.0, usual=(0.0, 1e-9))
    """Worn volume per work of impacts."""


def depth_rate(exposure: Exposure) -> np.ndarray:
    """(n_pair,) total wear depth per cycle, alpha W / A [m]."""
    return exposure.numbers["coefficient"] * impact_work(exposure) / exposure.area


def impact_work(exposure: Exposure) -> np.ndarray:
    """(n_pair,) work of the normal force on closing pairs over one cycle, 0 where a pair never opens [J]."""
    if "n" not in exposure.components:
        raise Refusal("the wear law impact needs a contact law with a normal component: take components with n")
    n = exposure.components.index("n")
    x, force = exposure.history
    return np.where(exposure.status & SEPARATES, loading_work(force[:, n], x[:, n]), 0.0)


def loading_work(force: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """Work of a force along a periodic path where it is positive: what a spring takes up before giving it back.

    force, displacement : (..., n_samples) of one period [N], [m]
    Returns (...) [J]; trapezoidal rule, exact for a linear spring between samples"""
    path = np.roll(displacement, -1, axis=-1) - displacement
    mean = 0.5 * (force + np.roll(force, -1, axis=-1))
    return np.maximum(mean * path, 0.0).sum(axis=-1)
