"""Events that a wear step must end at: a preload at which a row is needed, and a peak that overtakes the tracked one.

Both are located in the same way for steps along the balance and in time: a step that passes an event is taken again,
shorter. A preload is interpolated along its logarithm. An overtaking is enclosed between a step before it and one
behind it, and located by regula falsi in the logarithm of the ratio of the peaks.
Source  Illinois variant: Dowell and Jarratt 1971, BIT 11"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.wear import harmonic_fallback
from tribodyn.hbm.wear.history import LIFE_SHARE, WearRow
from tribodyn.hbm.wear.run_end import first_preload
from tribodyn.hbm.wear.step_memory import StepMemory
from tribodyn.hbm.wear.step_trial import StepTrial
from tribodyn.hbm.wear.wear_problem import WearProblem, WearState


@dataclass(frozen=True)
class EventRules:
    """How events are located; see docs/developers/ablations.md."""

    # shares of an event's preload between which a step that would pass the event must end: just below it, so that the
    # next step starts beyond it
    window: tuple[float, ...] = (0.97, 0.999)
    # share of the tolerance, of the cycles, within which a jump to another peak is located
    overtaking_accuracy: float = 0.5
    # ratio of preloads after which higher peaks are searched again; where the highest other one has a share below
    # `near` of the height that overtakes, its power (near / share)^2, `rarest` at most
    search_ratio: float = 0.97
    near: float = 0.5
    rarest: float = 16.0
    offset: float = 0.4  # of the accuracy: distance of the next trial from the estimated instant of a jump


RULES = EventRules()


class PreloadEvent:
    """The next preload at which a row is needed: where life is stated to end, or where the run is to end.

    is_located_once : whether a step is shortened to it once only, as in time, where preloads scatter"""

    def __init__(self, problem: WearProblem, state: WearState, rows: Sequence[WearRow], is_located_once: bool = False):
        self._problem, self._is_located_once = problem, is_located_once
        first, self._start = first_preload(problem, rows, state), problem.preload_of(state)
        shares = [share for share in (LIFE_SHARE, problem.lost_below) if share > 0]
        self._target = max((share * first for share in shares if share * first < self._start), default=0.0)

    def is_passed(self, following: WearState) -> bool:
        """Whether a step to a state passes it."""
        return self._problem.preload_of(following) < RULES.window[0] * self._target

    def share_before(self, following: WearState) -> float:
        """Share of a step that passes it after which the preload has fallen to just below it."""
        target, end = self._target, self._problem.preload_of(following)
        aim = np.mean(RULES.window) * target
        share = np.log(self._start / aim) / np.log(self._start / max(end, 1e-3 * target))
        self._target = 0.0 if self._is_located_once else target
        return float(np.clip(share, 0.05, 0.95))


def cycles_to_loss_at_rest(problem: WearProblem, state: WearState, rows: Sequence[WearRow]) -> float:
    """Cycles after which the preload at rest, which falls linearly, is just below the share that ends the run."""
    if problem.lost_below_at_rest is None or not rows:
        return np.inf
    fall = (rows[-1].preload_at_rest - state.preload_at_rest) / rows[-1].cycles_in_step
    least = RULES.window[0] * problem.lost_below_at_rest * rows[0].preload_at_rest
    return float((state.preload_at_rest - least) / fall) if fall > 0 else np.inf


class OvertakingEvent:
    """The instant at which another peak becomes higher than the tracked one.

    search_problem : with the harmonics that peaks are searched with; accuracy : relative, of the cycles
    jump : the shortest step known to pass the event, and points : its duties at the higher peaks; None before one is
        found
    search_share : share of the first preload at which higher peaks are searched next; solves : spent"""

    def __init__(
        self, problem: WearProblem, search_problem: WearProblem, accuracy: float, state: WearState,
        rows: Sequence[WearRow],
    ):  # fmt: skip
        self._problem, self.search_problem, self._accuracy = problem, search_problem, accuracy
        self._first = first_preload(problem, rows, state) or 1.0
        self.search_share = (
            StepMemory.of_row(rows[-1]).search_share if rows else RULES.search_ratio * self.preload_share(state)
        )
        self.jump: StepTrial | None = None
        self.points: tuple[OperatingPoint, ...] | None = None
        self.solves = 0
        self._stride_before, self._nearness_before, self._nearness_behind = 0.0, 0.0, 0.0

    def preload_share(self, state: WearState) -> float:
        """Preload of a state over the first one."""
        return self._problem.preload_of(state) / self._first

    def search(self, state: WearState) -> float:
        """Search for peaks that have overtaken those of a state; sets `points`. Returns nearness of the nearest one."""
        problem = self.search_problem
        results = [
            duty.site.dominant_peak(problem.in_duty(duty, state.depth), point)
            for duty, point in zip(problem.mission, state.points, strict=True)
        ]
        self.solves += sum(result.solves for result in results)
        higher = any(result.point for result in results)
        points = tuple(result.point or tracked for result, tracked in zip(results, state.points, strict=True))
        self.points = points if higher else None
        return max(result.nearness for result in results)

    def postpone(self, state: WearState, nearness: float) -> None:
        """Set the share at which to search again: the later, the lower the other peaks are."""
        rarity = RULES.rarest if nearness == 0 else (RULES.near / nearness) ** 2
        self.search_share = self.preload_share(state) * RULES.search_ratio ** float(np.clip(rarity, 1.0, RULES.rarest))

    def next_stride(self, trial: StepTrial) -> float | None:
        """Length of the step to try next; None where the event is located, or the trial does not pass one."""
        if self.jump is None and self.preload_share(trial.following) > self.search_share:
            return None
        points = self.points
        nearness = self.search(harmonic_fallback.converted(self.search_problem, trial.following))
        if self.points is not None:
            self.jump, self._nearness_behind = trial, nearness
        elif self.jump is None:
            self.postpone(trial.following, nearness)
            return None
        else:
            if self._stride_before != 0:  # Illinois: the end that stays counts less
                self._nearness_behind = np.sqrt(self._nearness_behind)
            self.points, self._stride_before, self._nearness_before = points, trial.stride, nearness
        accuracy = self._accuracy * trial.following.cycles
        if self.jump.stride - self._stride_before <= accuracy:
            return None
        return self._interpolated(self.jump.stride, accuracy)

    def _interpolated(self, after: float, accuracy: float) -> float:
        """The stride to try between one before the event and one behind it; their mean where nearness is not known."""
        before, low, high = self._stride_before, self._nearness_before, self._nearness_behind
        if not 0 < low < 1 < high:
            return 0.5 * (before + after)
        estimate = before + (after - before) * np.log(1 / low) / np.log(high / low)
        offset = RULES.offset * accuracy
        trial = estimate + (offset if estimate - before < after - estimate else -offset)
        return float(np.clip(trial, before + 0.5 * offset, after - 0.5 * offset))
