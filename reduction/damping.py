"""Linear damping of a reduced system."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh

from tribodyn.fem.system import SecondOrderSystem


def modal_damping(system: SecondOrderSystem, ratio: float) -> np.ndarray:
    """The same damping ratio in every mode of the free system, none for rigid-body modes.

    C = M Phi diag(2 zeta omega) Phi^H M over all modes of the dense system without contact
    Returns C (n, n) [N s/m]
    Raises  ValueError for a ratio below 0
    """
    if not ratio >= 0:
        raise ValueError(f"damping: ratio = {ratio}: give a part of critical damping of 0 or more, such as 0.01")
    values, phi = eigh(system.stiffness, system.mass)
    # below this an eigenvalue is rounding of a rigid-body mode
    values[values < len(values) * np.finfo(float).eps * values[-1]] = 0.0
    weighted = system.mass @ phi
    return (weighted * (2 * ratio * np.sqrt(values))) @ weighted.conj().T


def rayleigh(system: SecondOrderSystem, alpha: float, beta: float) -> np.ndarray:
    """C = alpha M + beta K (n, n) [N s/m]; alpha [1/s], beta [s].

    Raises  ValueError for a negative coefficient
    """
    if not (alpha >= 0 and beta >= 0):
        raise ValueError(f"damping: alpha = {alpha} and beta = {beta} must not be negative")
    return alpha * system.mass + beta * system.stiffness
