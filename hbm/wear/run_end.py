"""When a wear run is over: the contact is lost, nothing wears any more, or a solve failed.

Two preloads differ. The static force of a vibrating contact is a mean over the cycle: a contact that lifts off in each
cycle carries a mean force by impacts even where no interference is left. The force without the harmonic loads is the
interference that wear uses up, and what a torque wrench or a load cell at a standing machine measures."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.outcome import Outcome, WearEnd
from tribodyn.hbm.wear.history import WearRow
from tribodyn.hbm.wear.wear_problem import WearProblem, WearState, assess

FADED_SHARE = 1e-3  # share of the first friction work per cycle below which wear may have faded out
ENDLESS = 1e12  # cycles: thirty years at 1 kHz, longer than any machine runs


def reason_to_stop(
    problem: WearProblem, state: WearState, rows: Sequence[WearRow] = (), step_depth: float = 0.0
) -> Outcome[WearEnd] | None:
    """Why a run ends at a state; None where it continues.

    rows : taken before; step_depth : a depth that is worth wearing [m]: wear has faded out where the deepest pair needs
        more than ENDLESS cycles for it"""
    if state.failure:
        return state.failure
    share = problem.lost_below_at_rest
    if share is not None and state.preload_at_rest <= share * (rows[0] if rows else state).preload_at_rest:
        return WearEnd.LOST_AT_REST.say(f" {share:.3g} of its first value")
    if state.separated:
        return WearEnd.LOST.say()
    preload = problem.preload_of(state)
    if preload < problem.lost_below * first_preload(problem, rows, state):
        return WearEnd.PRELOAD_LOST.say(f" {problem.lost_below:.3g} of its first value")
    lost = lost_joint(problem, state, rows) if problem.any_joint else None
    if lost is not None:
        return WearEnd.PRELOAD_LOST.say(f" {problem.lost_below:.3g} of its first value in joint {lost}")
    survival = f", the contact survives, {1e6 * state.depth.max():.4g} um worn at most, {preload:.4g} N of preload left"
    if state.rate.max() <= 0.0:
        if state.work.max() > 0.0:
            return WearEnd.NO_LOSS.say()
        return (WearEnd.NO_SLIP if len(rows) else WearEnd.NEVER_SLIPS).say(survival)
    motion = max(float(np.abs(point.state.x).max()) for point in state.points)
    if 0.0 < step_depth < np.finfo(float).eps * motion:  # no step of wear changes the motion in double precision
        numbers = f"steps of {step_depth:.2g} m beside a motion of {motion:.2g} m at the contact"
        return WearEnd.NO_STEP.say(f": {numbers} are below rounding: check the static loads, which close too little")
    fading = rows and state.work.sum() < FADED_SHARE * rows[0].energy.sum()
    if fading and state.rate.max() * ENDLESS < step_depth:
        return WearEnd.FADED.say(survival)
    return None


def lost_joint(problem: WearProblem, state: WearState, rows: Sequence[WearRow]) -> str | None:
    """The first joint whose preload has fallen below the share that the problem asks for; None for none."""
    if not rows or "n" not in problem.balance.contact.components or not problem.balance.basis.has_static:
        return None
    contact, normal = problem.balance.contact, problem.normal_force(state)
    for name in problem.wearing:
        pairs = contact.joint(name).rows
        if normal[pairs].sum() < problem.lost_below * rows[0].normal_force[pairs].sum():
            return name
    return None


def first_preload(problem: WearProblem, rows: Sequence[WearRow], state: WearState) -> float:
    """Preload of the unworn contact [N]."""
    return rows[0].preload if rows else problem.preload_of(state)


class PreloadAtRest:
    """Solves the contact at rest at the depths of a wear run, each from its neighbour.

    Nothing is solved where the problem has no `lost_below_at_rest`. The static solution does not depend on the
    frequency that it is solved at; that of the first state is taken."""

    def __init__(self, problem: WearProblem):
        self._problem = problem
        self._quiet: WearProblem | None = None
        self._before: WearState | None = None

    def of(self, state: WearState) -> WearState:
        """The state with its preload at rest [N], or why there is none."""
        problem = self._problem
        if problem.lost_below_at_rest is None or state.failure:
            return state
        if self._quiet is None:
            self._quiet = self.quiet(state)
        self._before = assess(self._quiet, state.depth, 0.0, self._before)
        solves = state.solves + self._before.solves
        if self._before.failure:
            failure = self._before.failure.kind.say(f" at rest{self._before.failure.detail}")
            return replace(state, lost=failure, preload_at_rest=float(np.nan), solves=solves)
        preload = problem.preload_of(self._before)
        return replace(state, preload_at_rest=preload, solves=solves)

    def quiet(self, state: WearState) -> WearProblem:
        """The problem without harmonic loads, at the frequency of a state."""
        first, output = self._problem.mission[0], self._problem.balance.compliance.output_names[0]
        site = AtFrequency(output, state.points[0].state.omega, first.site.newton)
        return replace(self._problem, mission=(replace(first, site=site, share=1.0, load=0.0),))
