"""Stability by Floquet multipliers of the integrated motion, to hold Hill's method against."""

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.stability import floquet
from tribodyn.hbm.stability.exponents import Stability


def stability_in_time(balance: HarmonicBalance, state: State) -> Stability:
    """The stability of the motion that time integration finds from a state: no assumption of Hill's method."""
    exponents = floquet.floquet_exponents(balance.standing(state.omega), state)
    return Stability(state.omega, exponents[np.lexsort((exponents.imag, -exponents.real))])


def multipliers(stability: Stability) -> np.ndarray:
    """(n,) complex factors exp(lambda T) by which perturbations change over one period."""
    return np.exp(stability.exponents * 2 * np.pi / stability.omega)
