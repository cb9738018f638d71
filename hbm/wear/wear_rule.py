"""Wear rules: how long the steps of a wear run are, how one is taken, and how a rule is found by its name.

A rule is a module `hbm/wear/rules/<name>.py`, or a file beside a scene, with `class Rule(WearRule)`. It declares its
numbers in `class Parameters` with their units, see `tribodyn.declarations`; those with the role "accuracy" say how fine
its steps are. What a rule remembers from step to step it returns with each step, as arrays by name: they stand in the
history and in the result file, so that a run resumes to the same bits."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

from tribodyn.hbm.outcome import Outcome, WearEnd
from tribodyn.hbm.wear.history import StepScheme, WearHistory, WearRow
from tribodyn.hbm.wear.step_control import StepError, first_order_error
from tribodyn.hbm.wear.wear_problem import WearProblem, WearState
from tribodyn.hbm.wear.wear_rows import row_of
from tribodyn.plugins import PluginKind


@dataclass(frozen=True)
class RuleSettings:
    """What a rule is built from.

    numbers : its declared numbers by name, in SI units; scale : depth that errors are measured by [m], nan if unknown
    motion : along which it wears, see `workflows.scene.wear`; with_growth : whether rows state the growth of
        perturbations"""

    numbers: Mapping[str, float]
    scale: float = float("nan")
    motion: str = "balance"
    with_growth: bool = True


@dataclass(frozen=True)
class WearStep:
    """A step that was taken.

    following : solves the state after it, when the next step asks for it; failure : why no step can follow
    has_constant_rate : whether a part of the step is a step too, so that the end of a run is located in it"""

    row: WearRow
    following: Callable[[], WearState]
    failure: Outcome[WearEnd] | None = None
    has_constant_rate: bool = True


@dataclass(frozen=True)
class StepCost:
    """What a plan expects of a rule.

    steps : wear steps to loss of contact at an `accuracy`; power : of the accuracy that their number goes with
    at_peak : balance solves of a step at a peak"""

    steps: float
    accuracy: float
    power: float
    at_peak: int


class WearRule(ABC):
    """A rule at work on one problem; `hbm.wear.wear_loop` runs it."""

    SCHEME: ClassVar[StepScheme] = StepScheme.UNKNOWN
    """Of its steps, which `hbm.wear.tangent` differentiates."""
    COST: ClassVar[StepCost | None] = None

    def __init__(self, problem: WearProblem):
        self.problem = problem

    @classmethod
    @abstractmethod
    def build(cls, problem: WearProblem, settings: RuleSettings) -> Self:
        """The rule with the numbers of a scene."""

    @property
    @abstractmethod
    def least_depth(self) -> float:
        """Depth worth wearing [m]: wear has faded out where it takes too many cycles."""

    @abstractmethod
    def step(self, state: WearState, rows: Sequence[WearRow]) -> WearStep:
        """One step from a state; rows : of the steps before it."""

    def observe(self, state: WearState, rows: Sequence[WearRow]) -> WearState:
        """A solved state with what the rule needs to know of it besides; as it is by default."""
        return state

    def restore(self, state: WearState, row: WearRow, rows: Sequence[WearRow]) -> WearState:
        """The state of a stored row as it was when its step was taken; as it is by default."""
        return state

    def last_row(self, state: WearState) -> WearRow:
        """The row of a state from which no step is taken."""
        return row_of(self.problem, state)

    def remarks(self, history: WearHistory) -> str:
        """What the end of the run states besides its reason; nothing by default."""
        return ""

    @classmethod
    def error(cls, history: WearHistory, settings: RuleSettings) -> StepError:
        """Estimated error of a whole run by its steps; of steps at their first rate by default."""
        return first_order_error(history)


KIND = PluginKind("wear rule", "tribodyn.hbm.wear.rules", ("Rule",))
names, file_of, load, declared = KIND.names, KIND.file_of, KIND.load, KIND.declared


def build(name: str, problem: WearProblem, settings: RuleSettings) -> WearRule:
    """The rule of a name, or of a file beside a scene, at work on a problem."""
    rule: WearRule = load(name).Rule.build(problem, settings)
    return rule
