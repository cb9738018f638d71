"""Motions that share a frequency, each marched in time from where harmonic balance has it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.stability import exponents
from tribodyn.hbm.stability.folds_in_time import amplitude_in_time, march, solutions_at
from tribodyn.hbm.threads import single

DEPARTURE = 0.3  # relative change of amplitude that means that a motion has left its branch; on it a few per cent


@dataclass(frozen=True)
class Coexisting:
    """A solution that shares its frequency with others, and a plain march in time that began there.

    amplitude : by harmonic balance; in_time : after the march of `periods` [m]; returns : whether it ended where it
        began
    growth : largest real part of Hill's exponents [1/s]
    """

    amplitude: float
    stable: bool
    growth: float
    in_time: float
    periods: int
    returns: bool


@single
def coexisting(
    balance: HarmonicBalance, branch: Branch, low: float, high: float, output: str, frequencies: int = 24
) -> tuple[float, list[Coexisting]]:
    """The first frequency between two folds that two stable solutions and an unstable one share, each marched in time.

    low, high : [rad/s]; frequencies : tried between them
    Returns the frequency [rad/s] and the solutions; nan and none where there are no such three
    """
    row = balance.compliance.output_names.index(output)
    for omega in np.linspace(low, high, frequencies)[1:-1]:
        states = solutions_at(balance, branch, omega)
        hill = [exponents.stability(balance, state) for state in states]
        if [spectrum.stable for spectrum in hill] != [True, False, True]:
            continue
        solutions = []
        for state, spectrum in zip(states, hill, strict=True):
            motion = march(balance, state, omega)
            ours = float(np.linalg.norm(balance.outputs(state)[row, balance.basis.order > 0]))
            theirs = amplitude_in_time(balance, motion, output)
            growth, returns = float(spectrum.exponents.real.max()), abs(theirs / ours - 1) < DEPARTURE
            solutions.append(Coexisting(ours, spectrum.stable, growth, theirs, motion.periods, returns))
        return float(omega), solutions
    return float("nan"), []
