"""A wear step along a motion that is integrated in time: a Rosenbrock step of second order (steady_motion)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tribodyn.hbm.continuation.operating_point import AtFrequency
from tribodyn.hbm.wear.history import WearRow
from tribodyn.hbm.wear.sdirk_stages import RULES as STAGE_RULES
from tribodyn.hbm.wear.steady_motion import SteadyMotion
from tribodyn.hbm.wear.step_control import Tolerance, expected_life, growth, local_error
from tribodyn.hbm.wear.step_events import OvertakingEvent, PreloadEvent, cycles_to_loss_at_rest
from tribodyn.hbm.wear.step_memory import StepMemory, predicted_cycles
from tribodyn.hbm.wear.step_trial import NoSolution, StepTrial, accurate_step
from tribodyn.hbm.wear.wear_problem import WearProblem, WearState, assess, follow_balance, worn_state
from tribodyn.hbm.wear.wear_rows import row_of
from tribodyn.hbm.wear.wear_rule import WearStep

# first depth of a step, and the shortest: the scatter of the rates is no error that shorter steps lower; both over the
# tolerance on depth
FIRST_DEPTH = 0.3
SHORTEST_DEPTH = 0.05


class _MarchedStep:
    """A step from a state along its steady motion; periods : marched."""

    def __init__(
        self, problem: WearProblem, motion: SteadyMotion, tolerance: Tolerance, state: WearState, depth_limit: float
    ):
        self._problem, self._motion, self._tolerance, self._state = problem, motion, tolerance, state
        self._depth_limit, self._start_error = depth_limit, state.means_in_time.error
        self.unit = tolerance.share * tolerance.scale / float(state.rate.max())
        self.has_fixed_frequency = all(isinstance(duty.site, AtFrequency) for duty in problem.mission)
        self.solves, self.periods = 0, state.means_in_time.periods

    def attempt(self, stride: float) -> StepTrial:
        problem, state, tolerance = self._problem, self._state, self._tolerance
        depth, cycles = self._motion.predicted_depth(state, stride), state.cycles + stride
        following = replace(state, depth=depth, cycles=cycles, solves=0)
        if not self.has_fixed_frequency:
            following = assess(problem, depth, cycles, state)
        following, worn, deviation = self._motion.step(state, following, stride)
        means = following.means_in_time
        self.solves, self.periods = self.solves + following.solves, self.periods + means.periods
        life = float(expected_life(tolerance, cycles, state.depth + worn))
        scatter = 0.5 * stride * float(np.hypot(self._start_error, means.error)) / (tolerance.share * life)
        # rates that scatter may agree by chance
        local = max(scatter, local_error(tolerance, problem.area, deviation, following.rate, stride, life))
        error = max(local, float(np.abs(deviation).max()) / self._depth_limit)
        rates, works = state.rate + following.rate, state.work + following.work
        work = np.divide(worn * works, rates, out=0.5 * stride * works, where=rates > 0)  # that goes with the depth
        return StepTrial(stride, following, worn, work, error, local)

    def accepts(self, trial: StepTrial) -> bool:
        return trial.error <= 1.0 or trial.stride <= SHORTEST_DEPTH * self.unit

    def shortened(self, trial: StepTrial, share: float) -> float:
        return trial.stride * share

    def next_stride(self, trial: StepTrial) -> float:
        return max(trial.stride * growth(trial.error), SHORTEST_DEPTH * self.unit)

    def failure(self, stride: float, trial: StepTrial) -> NoSolution | None:
        return None


def marched_step(
    problem: WearProblem, motion: SteadyMotion, tolerance: Tolerance, state: WearState, rows: Sequence[WearRow]
) -> WearStep:
    """A step along the steady motion of a state; where another peak has overtaken behind it, wear continues there."""
    overtaking = OvertakingEvent(problem, problem, 0.0, state, rows)
    # held to the depth that is left, too: more lifts pairs that go on touching, with most of a life still to come
    limit = tolerance.share * tolerance.scale * min(overtaking.preload_share(state), 1.0)
    method = _MarchedStep(problem, motion, tolerance, state, limit)
    stride = predicted_cycles(rows) or FIRST_DEPTH * method.unit
    stride = min(stride, cycles_to_loss_at_rest(problem, state, rows))
    trial = accurate_step(method, stride, PreloadEvent(problem, state, rows, is_located_once=True))
    assert isinstance(trial, StepTrial)
    next_cycles = trial.stride * growth(trial.error)
    end = state.depth + trial.worn, state.cycles + trial.stride
    keeps_balance = method.has_fixed_frequency and motion.always
    following = follow_balance(problem, state, *end) if keeps_balance else assess(problem, *end, state)
    solves = state.solves + method.solves + following.solves
    if not following.failure and overtaking.preload_share(following) <= overtaking.search_share:
        nearness = overtaking.search(following)
        overtaking.postpone(following, nearness)
        solves += overtaking.solves
        if overtaking.points is not None:
            following = worn_state(problem, following.depth, following.cycles, overtaking.points, 0)
            next_cycles = 0.0
    slopes = np.full(len(state.points), STAGE_RULES.unknown_slope)
    memory = StepMemory(next_cycles, slopes, overtaking.search_share).arrays()
    spent = replace(state, solves=solves)
    row = row_of(problem, spent, trial.stride, trial.worn, trial.work, trial.local_error, memory)
    return WearStep(replace(row, periods=method.periods), lambda: replace(following, solves=0), has_constant_rate=False)
