"""What is kept of one configuration of the leaf seal's study: its row of the table and its curve."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from proof.cases.leaf_seal.cases import Case
from proof.cases.leaf_seal.response import LINER_NODE, LeafResponse
from tribodyn.hbm.contact.contact_law import SEPARATES, STICKS
from tribodyn.hbm.outcome import BranchEnd

COLUMNS = (
    "group", "value", "points", "folds", "fold_hz", "unstable_points", "peak_hz", "peak_um",
    "stick", "stick_separation", "separation", "impact_velocity_mm_s", "least_touching",
    "impact_work_mJ", "pin_work_mJ", "patch_wear_um", "pin_wear_um", "newton_steps", "seconds", "ended", "end",
)  # fmt: skip
WEAR_CYCLES = 1e9  # that the depths in the table stand for: some 2000 hours
STRUCK_POINT = 2  # of the chosen five, where the leaf moves most


@dataclass(frozen=True)
class Record:
    """One configuration: its row of the table and its response curve at the lower corner.

    numbers : of COLUMNS; only group, value and end where nothing was solved
    frequency : (n_point,) [Hz]; amplitude : (n_point,) [m]; stable : (n_point,) bool
    response : None where it is not drawn: a model is some megabytes"""

    case: Case
    numbers: dict[str, Any]
    frequency: np.ndarray
    amplitude: np.ndarray
    stable: np.ndarray
    response: LeafResponse | None = None

    @property
    def complete(self) -> bool:
        """Whether the curve came to its end."""
        return "points" in self.numbers and self.numbers.get("ended") != BranchEnd.ENDED.name


def of_response(case: Case, response: LeafResponse) -> Record:
    """The record of a solved configuration."""
    branch, stable = response.branch, response.stability.stable
    return Record(case, row(case, response), branch.frequency, branch.amplitude(LINER_NODE), stable, response)


def of_failure(case: Case, sentence: str) -> Record:
    """The record of a configuration that has no curve."""
    numbers = {"group": case.group, "value": case.label, "end": sentence}
    return Record(case, numbers, np.empty(0), np.empty(0), np.empty(0, bool))


def row(case: Case, response: LeafResponse) -> dict[str, Any]:
    """The numbers of one configuration; contact is that of the point where the leaf moves most."""
    branch, point = response.branch, response.chosen()[STRUCK_POINT]
    chattering, status = response.chatter(point), response.state(point).cycle.status
    height = branch.amplitude(LINER_NODE)
    folds = [f"{branch.frequency[i]:.2f}" for i in branch.folds]
    patches, pins = (1e6 * WEAR_CYCLES * rates.max() for rates in response.wear_rates(point))
    count = {kind: int(np.sum(status == kind)) for kind in (STICKS, STICKS | SEPARATES, SEPARATES)}
    values = (
        case.group, case.label, len(branch.omega), len(folds), " ".join(folds),
        int(np.sum(~response.stability.stable)), round(float(branch.frequency[height.argmax()]), 2),
        round(1e6 * float(height.max()), 1), *count.values(),
        round(1e3 * float(chattering.impact_velocity.max()), 1), round(float(chattering.touching.min()), 3),
        round(1e3 * float(response.impact_work(point).sum()), 4),
        round(1e3 * sum(response.pin_work(point).values()), 4), round(float(patches), 3), round(float(pins), 3),
        int(branch.newton_steps.sum()), round(response.seconds, 2), branch.ended.name, str(branch.end),
    )  # fmt: skip
    return dict(zip(COLUMNS, values, strict=True))
