"""Whether a machine stays at a periodic motion: by its multipliers in time where it has them, else by Hill's method."""

from __future__ import annotations

from dataclasses import replace

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.stability import exponents, floquet
from tribodyn.hbm.time import wave_in_time
from tribodyn.hbm.time.period_search import PeriodSearch
from tribodyn.hbm.time.push import push
from tribodyn.hbm.time.time_integration import Options, TimeStepper
from tribodyn.hbm.time.verify import Verification

MULTIPLIERS = "its Floquet multipliers in time"
HILL = "Hill's method"
PUSHED = "a push in time"
PERIODS, EVERY = 120, 8  # of a push at most, and after which to see whether it died away
SAME = 0.2  # largest difference of the vibration at the contact, relative, up to which both motions are one


def stays(balance: HarmonicBalance, state: State, found: Verification | None, options: Options) -> tuple[bool, str]:
    """Whether no perturbation of the motion near a balance state grows, and the method that says so.

    found : the state beside time integration, which may have come to another motion, or to none; None: not compared
    Of a large model a multiplier above 1 is that of differences. Where sliders just reach their limit these have a
    kink, and a combination of both sides may grow though no motion does: there a push decides.
    Hill's method takes the contact's answer to a perturbation as that to a steady vibration. Where pairs slip and lift
    in a cycle that may miss what grows, so that it serves only where there are no multipliers
    """
    same = found is not None and found.motion.periodic and found.contact <= SAME
    if same and not wave_in_time.is_wave(balance):
        try:
            largest = floquet.largest(balance, state, options)
        except ValueError:
            return exponents.stability(balance, state).stable, HILL
        if largest <= 1 + floquet.GROWTH or floquet.size(balance, state.omega, options) <= floquet.DENSE:
            return largest <= 1 + floquet.GROWTH, MULTIPLIERS
        return not _pushed_away(balance, state, options), PUSHED
    return exponents.stability(balance, state).stable, HILL


def _pushed_away(balance: HarmonicBalance, state: State, options: Options) -> bool:
    """Whether the periodic motion near a state, which time integration has found before, is left after a push."""
    stepper = TimeStepper(balance, state.omega, options)
    found = PeriodSearch(stepper, replace(options, accelerate=True), False).mix(stepper.start_from(state))
    plain = PeriodSearch(stepper, replace(options, accelerate=False, max_periods=PERIODS), False)
    return push(plain, found, EVERY).away
