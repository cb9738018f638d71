"""The wear rule of the thesis: explicit steps of Z cycles, as many as let the deepest pair wear by a given depth.

Source  Tamatam 2021, eq. 3.29-3.31 and figure 3.6."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from tribodyn.declarations import number
from tribodyn.hbm.wear.history import StepScheme, WearRow
from tribodyn.hbm.wear.wear_problem import WearProblem, WearState, assess
from tribodyn.hbm.wear.wear_rows import row_of
from tribodyn.hbm.wear.wear_rule import RuleSettings, StepCost, WearRule, WearStep
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class Parameters:
    step: float = number("m", role="accuracy", above=0.0)
    "Largest depth that one step may wear, v_w,max."


class Rule(WearRule):
    """step_depth : largest depth that one step may wear, v_w,max [m]; Z is whole, and at least one cycle."""

    SCHEME = StepScheme.EXPLICIT
    COST = StepCost(411, 0.01, -0.5, 3)  # Tamatam 2021, table 4.2

    def __init__(self, problem: WearProblem, step_depth: float):
        if not step_depth > 0:
            raise Refusal("the wear step must be a positive depth", key="wear.step", value=step_depth)
        super().__init__(problem)
        self.step_depth = step_depth

    @classmethod
    def build(cls, problem: WearProblem, settings: RuleSettings) -> Self:
        return cls(problem, settings.numbers["step"])

    @property
    def least_depth(self) -> float:
        return self.step_depth

    def step(self, state: WearState, rows: Sequence[WearRow]) -> WearStep:
        cycles = max(1.0, float(np.floor(self.step_depth / state.rate.max())))  # eq. 3.30
        row = row_of(self.problem, state, cycles, cycles * state.rate, cycles * state.work)
        depth = state.depth + row.worn  # eq. 3.31, total of both surfaces
        return WearStep(row, lambda: assess(self.problem, depth, state.cycles + cycles, state))
