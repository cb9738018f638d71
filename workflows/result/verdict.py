"""How far the numbers of a result may be off: what refinements of its scene changed, and the total error that follows.

Data and its words alone; `tribodyn.workflows.errors` measures them."""

from dataclasses import dataclass
from enum import StrEnum


class Refinement(StrEnum):
    """What is refined in a scene to see what it changes."""

    MODES = "modes"
    MESH = "mesh and contact grid"
    HARMONICS = "harmonics"
    SAMPLES = "samples"
    SPRINGS = "contact springs"
    PLACE = "place of the peak"
    WEAR_STEPS = "wear steps"
    MOTION = "statistics of the motion"
    OTHER_MOTION = "another motion"
    COMBINED = "combined"


class Status(StrEnum):
    """What may be said of a value."""

    REPORTED = "reported"
    NOT_KNOWN = "error not known"
    TOO_LARGE = "not reported (error above 50 %)"
    UNSTABLE = "not reported (the steady state is unstable)"
    CONTRADICTED = "not reported (time integration contradicts it)"
    UNBOUNDED = "not reported (it grows without bound on finer meshes)"
    UNSETTLED = "not reported (the motion in time is not stationary)"
    ABSENT = "none"


@dataclass(frozen=True)
class MeasuredChange:
    """One row of the table of measured changes.

    value, refined : of the quantity, in its unit, before and after the refinement; None where there is none
    relative : change over the refined value, or an estimate of it; None where it was not measured
    description : what was refined, or why it was not measured"""

    refinement: str
    quantity: str
    value: float | None
    refined: float | None
    relative: float | None
    description: str


@dataclass(frozen=True)
class Statement:
    """One quantity of a verdict.

    value : in the unit of the quantity, None where there is none
    error : total and relative, None where it is not known
    dominated_by : the refinement that changed most; status : a Status; reason : in words"""

    value: float | None
    error: float | None
    dominated_by: str | None
    status: str
    reason: str

    @property
    def stated(self) -> bool:
        """Whether the value has an error that is known and small enough, of a motion that is stable."""
        return self.status == Status.REPORTED


@dataclass(frozen=True)
class Verdict:
    """The table of changes and what follows for every quantity.

    statements : by name of the quantity; changes : rows of the table
    ratio : elements along every edge of the refined mesh over those of the scene, None where that was not solved
    worn_ratio : the same of the mesh that was worn beside it
    seconds : of one processor, for information alone"""

    statements: dict[str, Statement]
    changes: tuple[MeasuredChange, ...]
    ratio: float | None
    seconds: float
    worn_ratio: float | None = None
