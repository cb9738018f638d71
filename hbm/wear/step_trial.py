"""The length of a wear step: trials of one method until one is accurate enough and passes no event."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from tribodyn.hbm.outcome import Outcome, WearEnd
from tribodyn.hbm.wear.wear_problem import WearState

if TYPE_CHECKING:
    from tribodyn.hbm.wear.step_events import OvertakingEvent, PreloadEvent


@dataclass(frozen=True)
class StepTrial:
    """A step of `stride` cycles.

    following : the state that it leads to; worn : (n_pair,) depth [m], work : (n_pair,) friction work [J] of the step
    error : over the tolerance, which the length follows; local_error : what the history states
    is_lost : whether no solution follows on the branch of the step's start"""

    stride: float
    following: WearState
    worn: np.ndarray
    work: np.ndarray
    error: float
    local_error: float
    is_lost: bool = False


@dataclass(frozen=True)
class NoSolution:
    """A step with no solution behind it, however short: why, and the solves spent."""

    failure: Outcome[WearEnd] | None
    solves: int


class StepMethod(Protocol):
    """A method of taking a step from one state."""

    solves: int

    def attempt(self, stride: float) -> StepTrial:
        """A step of some cycles."""

    def accepts(self, trial: StepTrial) -> bool:
        """Whether a trial is accurate enough."""

    def shortened(self, trial: StepTrial, share: float) -> float:
        """The stride that is a share of one that passes an event."""

    def next_stride(self, trial: StepTrial) -> float:
        """The stride to try behind one that is not accurate enough."""

    def failure(self, stride: float, trial: StepTrial) -> NoSolution | None:
        """Why a stride is too short to be tried; None where it is not."""


def accurate_step(
    method: StepMethod, stride: float, preload: PreloadEvent, overtaking: OvertakingEvent | None = None
) -> StepTrial | NoSolution:
    """Try strides until one is accurate enough; where it would pass an event, it ends there.

    stride : to try first. Where another peak overtakes, the step is `overtaking.jump`"""
    while True:
        trial = method.attempt(stride)
        if trial.error <= 1.0 and preload.is_passed(trial.following):
            stride = method.shortened(trial, preload.share_before(trial.following))
        elif method.accepts(trial):
            enclosed = None if overtaking is None else overtaking.next_stride(trial)
            if enclosed is None:
                return trial if overtaking is None or overtaking.jump is None else overtaking.jump
            stride = enclosed
            continue
        elif overtaking is not None and overtaking.jump is not None:
            return overtaking.jump
        else:
            stride = method.next_stride(trial)
        if failure := method.failure(stride, trial):
            return failure
