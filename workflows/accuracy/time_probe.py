"""States of a result beside direct time integration of the reduced model, with Floquet multipliers of its motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from tribodyn.hbm.outcome import Outcome, SolveEnd
from tribodyn.hbm.stability.stays import stays
from tribodyn.hbm.time.stepper import IntegrationFailed, Options
from tribodyn.hbm.time.verify import verify
from tribodyn.workflows.accuracy.probes import State
from tribodyn.workflows.accuracy.time_limit import TimeUp, processor_seconds

MOST = 60  # components of a contact that a verdict integrates in time without being asked
STEPS, STEPS_PER_HARMONIC = 256, 32  # time steps per period; per period of the highest harmonic kept
PERIODS = 60
DRIFT = 1e-4  # of the vibration over one period: periodic enough for differences above a tenth of a per cent


@dataclass(frozen=True)
class InTime:
    """One state by direct time integration; differences relative to it.

    own_error : of the integration itself; stable : whether no perturbation grows, by the method that `how` names
    outcome : CONVERGED, or why there is no periodic motion to compare with
    """

    amplitude: float
    energy: float
    preload: float
    own_error: float
    stable: bool
    how: str
    outcome: Outcome[SolveEnd]


@dataclass(frozen=True)
class Checked:
    """States that were integrated, in the order of their cycles, of so many that were to be; why not all of them."""

    found: tuple[tuple[State, InTime], ...]
    wanted: int
    refusal: str


def check(seen: Sequence[State], asked: bool | None, seconds: float, skipped: str) -> Checked:
    """Integrate the first, the middle and the last state in time.

    asked : whether the scene wants it; None: where it is cheap, with contacts up to MOST components
    seconds : of the processor, for all of them; skipped : the sentence where they are used up
    """
    chosen = [seen[i] for i in sorted({0, len(seen) // 2, len(seen) - 1})] if seen else []
    found, end = list[tuple[State, InTime]](), process_time() + seconds
    if asked is False:
        return Checked((), len(chosen), "verdict.in_time is false")
    size = chosen[0].balance.contact.stiffness.size if chosen else 0
    if asked is None and size > MOST:
        why = f"its contact has {size} components, above the {MOST} that are integrated unless verdict.in_time is true"
        return Checked((), len(chosen), why)
    for state in chosen:
        try:
            with processor_seconds((end - process_time()) / (len(chosen) - len(found))):
                found.append((state, in_time(state)))
        except (ValueError, TimeUp) as reason:
            return Checked(tuple(found), len(chosen), skipped if isinstance(reason, TimeUp) else str(reason))
    return Checked(tuple(found), len(chosen), "")


def in_time(state: State) -> InTime:
    """One state by time integration of the reduced model; raises ValueError where that has no equation in time."""
    balance, solution = state.balance, state.here.state
    options = Options(
        max(STEPS, STEPS_PER_HARMONIC * balance.basis.harmonics[-1]), tolerance=DRIFT, max_periods=PERIODS
    )
    try:
        found = verify(balance, solution, options)
    except IntegrationFailed as failure:
        why = SolveEnd.INTEGRATION_FAILED.say(f" {failure}")
        return InTime(np.nan, np.nan, np.nan, np.nan, False, "time integration", why)
    stable, how = stays(balance, solution, found, options)
    output = next(iter(found.amplitude.values()), 0.0)
    return InTime(output, found.energy, found.preload, found.step_error, stable, how, found.outcome)
