"""Whether a machine stays at a periodic motion: by its multipliers in time where it has them, else by Hill's method."""

from __future__ import annotations

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.stability import exponents, floquet
from tribodyn.hbm.time import wave_in_time
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.verify import Verification

MULTIPLIERS = "its Floquet multipliers in time"
HILL = "Hill's method"
SAME = 0.2  # largest difference of the vibration at the contact, relative, up to which both motions are one


def stays(balance: HarmonicBalance, state: State, found: Verification | None, options: Options) -> tuple[bool, str]:
    """Whether no perturbation of the motion near a balance state grows, and the method that says so.

    found : the state beside time integration, which may have come to another motion, or to none; None: not compared
    Hill's method takes the contact's answer to a perturbation as that to a steady vibration. Where pairs slip and lift
    in a cycle that may miss what grows, so that it serves only where there are no multipliers
    """
    same = found is not None and found.motion.periodic and found.contact <= SAME
    if same and not wave_in_time.is_wave(balance):
        try:
            return not floquet.leaves(balance, state, options), MULTIPLIERS
        except ValueError:
            return exponents.stability(balance, state).stable, HILL
    return exponents.stability(balance, state).stable, HILL
