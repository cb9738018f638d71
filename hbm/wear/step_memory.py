"""What the error-controlled rule remembers from step to step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from tribodyn.hbm.wear.history import WearRow


@dataclass(frozen=True)
class StepMemory:
    """What a step leaves for the next one.

    next_cycles : length of the next step; 0 behind a step that predicts none, as one over the end of a branch
    frequency_slopes : (n_duty,) d (distance to the operating point) / d omega
    search_share : share of the first preload at which higher peaks are searched next"""

    next_cycles: float
    frequency_slopes: np.ndarray
    search_share: float

    @classmethod
    def empty(cls, n_duty: int, search_share: float = 1.0) -> StepMemory:
        """Behind a step after which all but the search for higher peaks starts afresh."""
        return cls(0.0, np.zeros(n_duty), search_share)

    @classmethod
    def of_row(cls, row: WearRow) -> StepMemory:
        """As it stands in a row of the history."""
        return cls(float(row.memory["next_cycles"]), row.memory["frequency_slopes"], float(row.memory["search_share"]))

    def arrays(self) -> dict[str, np.ndarray]:
        """As a row of the history has it."""
        return {name: np.asarray(value) for name, value in asdict(self).items()}


def predicted_cycles(rows: Sequence[WearRow]) -> float:
    """Length of the next step that the last one predicts, 0 where there is none."""
    return StepMemory.of_row(rows[-1]).next_cycles if rows else 0.0
