"""Why a curve or a wear run ended: members of an enumeration that carry the beginning of the sentence a user reads.

A result keeps the sentence; what decides asks for the member, which is read back from it here and nowhere else.
"""

from __future__ import annotations

from enum import Enum
from typing import Self

CONVERGED = "converged"
"""The outcome of a solve that reached its tolerance; any other outcome is a sentence on what went wrong."""


class End(Enum):
    """An end; its value is how its sentence begins, and no value begins like another one of its kind."""

    def say(self, detail: str = "") -> str:
        """The sentence, with details after the member's words."""
        return self.value + detail

    @classmethod
    def of(cls, sentence: str) -> Self:
        """The member that a sentence tells; raises ValueError for one that none tells."""
        for member in cls:
            if sentence.startswith(member.value):
                return member
        raise ValueError(f'"{sentence}" is no {cls.__name__}')


class BranchEnd(End):
    """Why a response curve ended."""

    REACHED = "reached"
    ENDED = "ended at"
    TURNED_BACK = "turned back to"
    CLOSED = "closed curve"


class WearEnd(End):
    """Why a wear run ended."""

    LOST = "contact lost at every pair"
    PRELOAD_LOST = "preload fell below"
    LOST_AT_REST = "preload at rest fell below"
    NO_SLIP = "no pair slips any more: wear has stopped"
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
        return self in (WearEnd.NO_SLIP, WearEnd.FADED)

    @property
    def failed(self) -> bool:
        """Whether the run ended where it could not be continued, not where it was to end."""
        return self in (WearEnd.SOLVE_FAILED, WearEnd.NO_STEP)
