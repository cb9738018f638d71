"""States of a result beside direct time integration of the reduced model, with Floquet multipliers of its motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.outcome import Outcome, SolveEnd
from tribodyn.hbm.stability.stays import MULTIPLIERS, stays
from tribodyn.hbm.time.stepper import IntegrationFailed, Options as TimeOptions
from tribodyn.hbm.time.verify import verify
from tribodyn.workflows.errors import states
from tribodyn.workflows.errors.options import Options
from tribodyn.workflows.errors.states import State
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.verdict import Status
from tribodyn.workflows.scene.scene_file import SceneFile

# a motion is periodic enough for differences above a tenth of a per cent
INTEGRATION = TimeOptions(256, tolerance=1e-4, max_periods=60)
STEPS_PER_HARMONIC = 32


@dataclass(frozen=True)
class Finding:
    """One state by direct time integration; differences relative to it.

    cycles : of the state; own_error : of the integration itself
    stable : whether no perturbation grows, by the method that `how` names
    outcome : CONVERGED, or why there is no periodic motion to compare with
    """

    cycles: float
    amplitude: float
    energy: float
    preload: float
    own_error: float
    stable: bool
    how: str
    outcome: Outcome[SolveEnd]

    @property
    def doubt(self) -> float:
        """Difference that the integration itself may make, relative."""
        return 3 * float(np.fmax(self.own_error, INTEGRATION.tolerance))

    def judged(self, quantity: str, error: float | None, worn: float | None = None) -> tuple[Status | None, str]:
        """Why a quantity is not reported, if it is not; error : of the balance, if known; worn : see `missed`."""
        where = f"after {self.cycles:.3g} cycles" if self.cycles else "of the unworn contact"
        miss = abs({"amplitude": self.amplitude, "preload": self.preload}.get(quantity, self.energy))
        allowed = (error or 0.0) + self.doubt
        if self.outcome.kind is not SolveEnd.CONVERGED and not miss <= allowed:
            return Status.NOT_PERIODIC, f"{where}: {self.outcome}"
        if not self.stable and (miss > self.doubt or self.how == MULTIPLIERS):
            return Status.UNSTABLE, f"{where}, by {self.how}"
        if worn is not None:
            miss, allowed, where = worn, error or 0.0, "over the wear"
        if miss > allowed:
            return Status.CONTRADICTED, f"{where}, by {miss:.1%}"
        return None, ""


def missed(findings: Sequence[Finding], result: Result) -> float:
    """How far the work of its states in time puts a wear of the balance off, relative to it.

    A depth takes (1 + energy) times the cycles where the balance does that much more work than the motion in time: a
    life is off by the mean over its cycles. A finding stands for the cycles nearest to it, wear in time needs none.
    So few do not show that they cancel, their amounts are taken, less their own doubt.
    """
    wear = result.wear
    assert wear is not None
    rows = slice(0, max(states.later_rows(result), default=0) + 1)
    taken = wear.cycles_in_step[rows]
    apart = np.subtract.outer(wear.cycles[rows] + taken / 2, [finding.cycles for finding in findings])
    sure = np.array([max(abs(finding.energy) - finding.doubt, 0.0) for finding in findings])
    return float(np.sum(sure[np.abs(apart).argmin(axis=1)] * taken * ~wear.in_time[rows]) / (taken.sum() or 1.0))


def check(
    file: SceneFile,
    balance: HarmonicBalance,
    result: Result,
    first: State | None,
    asked: bool | None,
    options: Options,
) -> list[Finding]:
    """The unworn state, one halfway through the life and one near its end, integrated in time.

    asked : whether the scene wants it; None: for contacts of up to `options.max_time_components`
    """
    if first is None or asked is False:
        return []
    if asked is None and first.balance.contact.stiffness.size > options.max_time_components:
        return []
    found = []
    for row in (None, *states.later_rows(result)):
        if row is not None and result.wear is not None and result.wear.in_time[row]:
            continue
        try:
            found.append(_integrated(first if row is None else states.worn_state(file, balance, result, row)))
        except (ValueError, RuntimeError):  # a model without an equation in time, a row that is not solved again
            break
    return found


def _integrated(state: State) -> Finding:
    """One state by time integration of the reduced model; raises ValueError where that has no equation in time."""
    balance, solution = state.balance, state.here.state
    steps = max(INTEGRATION.steps, STEPS_PER_HARMONIC * balance.basis.harmonics[-1])
    options = TimeOptions(steps, tolerance=INTEGRATION.tolerance, max_periods=INTEGRATION.max_periods)
    try:
        found = verify(balance, solution, options)
    except IntegrationFailed as failure:
        why = SolveEnd.INTEGRATION_FAILED.say(f" {failure}")
        return Finding(state.cycles, np.nan, np.nan, np.nan, np.nan, False, "time integration", why)
    stable, how = stays(balance, solution, found, options)
    output = next(iter(found.amplitude.values()), 0.0)
    return Finding(state.cycles, output, found.energy, found.preload, found.step_error, stable, how, found.outcome)
