"""Whether the motions of a worn contact are stable: the growth of the fastest growing perturbation by Hill's method.

A machine leaves a periodic motion that a push grows on, so that the wear of that motion is no machine's.
"""

from __future__ import annotations

from dataclasses import replace

from tribodyn.hbm.stability import exponents
from tribodyn.hbm.time import wave_in_time
from tribodyn.hbm.wear.evolution import WearProblem, WearState

# Unknowns of a balance, of all sectors of a wave, up to which all states are looked at: Hill's method takes less than a
# fifth of the time of a wear step (beam: 73 ms of 0.5 s with 1029)
MOST_UNKNOWNS = 2000


def with_growth(problem: WearProblem, state: WearState, always: bool = False) -> WearState:
    """The state with the growth of its perturbations per radian of the vibration, the largest of all its duties.

    Above 0 a perturbation grows: what Hill's method takes for rounding is taken off

    always : of balances of any size, but waves; nan stays where it is not known: no solution, no exponents, too many
        unknowns
    """
    balance = problem.balance
    sectors = wave_in_time.sectors_of(balance)
    few = balance.contact.stiffness.size * balance.basis.n_coeff * sectors <= MOST_UNKNOWNS
    if state.failure or not (few or (always and not wave_in_time.is_wave(balance))):
        return state
    growth = -float("inf")
    try:
        for duty, point in zip(problem.mission, state.points, strict=True):
            found = exponents.stability(problem.in_duty(duty, state.depth), point.state)
            growth = max(growth, float(found.exponents[0].real) / found.omega - exponents.RULES.neutral_growth)
    except ValueError:  # a model without exponents
        return state
    return replace(state, growth=growth)
