"""How a solve, a curve or a wear run ended: members of enumerations.

Each member carries the beginning of the sentence that a user reads.

What decides asks for the member; the sentence is made from it and is never read back."""

from dataclasses import dataclass
from enum import Enum
from typing import Final, Generic, Self, TypeVar

Kind = TypeVar("Kind", bound="End")


@dataclass(frozen=True)
class Outcome(Generic[Kind]):
    """How something ended. kind : the member; detail : what the sentence says after the member's words."""

    kind: Kind
    detail: str = ""

    def __str__(self) -> str:
        return self.kind.value + self.detail


class End(Enum):
    """An end; its value is how its sentence begins."""

    def say(self, detail: str = "") -> Outcome[Self]:
        """The outcome of this kind, with details after the member's words."""
        return Outcome(self, detail)


class SolveEnd(End):
    """How a solve ended."""

    CONVERGED = "converged"
    BESIDE_PEAK = "converged beside a peak that was not found"
    UNLIMITED = "nothing limits the resonance at"
    STEPS_SPENT = "not converged in"
    NO_DESCENT = "no descent from relative residual"
    NOT_FINITE = "the residual is not a finite number"
    SINGULAR = "singular Jacobian at relative residual"
    NO_DIRECTION = "no direction to correct along:"
    NO_REST = "no state of rest was found under the static loads alone"
    SLIDES_AWAY = "the contact slides away,"
    NOT_HELD = "nothing holds a body from"
    SITE_NOT_FOUND = "the motion sought was not found in"
    AT_FOLD = "the curve turns back at a fold,"
    NOT_PERIODIC = "not periodic after"


CONVERGED: Final = SolveEnd.CONVERGED.say()
"""The outcome of a solve that reached its tolerance."""
SOLVED: Final = (SolveEnd.CONVERGED, SolveEnd.BESIDE_PEAK, SolveEnd.UNLIMITED)  # ends with a solution


class BranchEnd(End):
    """Why a curve of solutions ended."""

    REACHED = "reached"
    JUMPED = "jumped on the way and reached"
    ENDED = "ended at"
    TURNED_BACK = "turned back to"
    CLOSED = "closed curve"
    POINTS_DONE = "stopped after"


class WearEnd(End):
    """Why a wear run ended."""

    LOST = "contact lost at every pair"
    PRELOAD_LOST = "preload fell below"
    LOST_AT_REST = "preload at rest fell below"
    NO_SLIP = "no pair slips any more: wear has stopped"
    NEVER_SLIPS = "no pair ever slips: nothing wears"
    FADED = "wear has faded out"
    NO_LOSS = "the wear law takes nothing off where pairs slip"
    STEPS_DONE = "stopped after"
    SOLVE_FAILED = "solve failed"
    NO_STEP = "no wear step is small enough for the tolerance"
    UNFINISHED = "unfinished"

    @property
    def lost(self) -> bool:
        """Whether the contact is lost."""
        return self in (WearEnd.LOST, WearEnd.PRELOAD_LOST, WearEnd.LOST_AT_REST)

    @property
    def survived(self) -> bool:
        """Whether wear has ended by itself while the contact still holds (shakedown)."""
        return self in (WearEnd.NO_SLIP, WearEnd.NEVER_SLIPS, WearEnd.FADED)

    @property
    def failed(self) -> bool:
        """Whether the run ended where it could not be continued, not where it was to end."""
        return self in (WearEnd.SOLVE_FAILED, WearEnd.NO_STEP)
