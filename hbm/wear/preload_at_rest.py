"""The preload that is left when the vibration stops, along a wear run.

Two preloads differ. The static force of a vibrating contact is a mean over the cycle: a contact that lifts off in each
cycle carries a mean force by impacts even where no interference is left. The force without the harmonic loads is the
interference that wear uses up, and what a torque wrench or a load cell at a standing machine measures."""

from dataclasses import replace

import numpy as np

from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.wear.wear_problem import WearProblem, WearState, assess


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
