"""Tables of a scene about its wear: law, step, where the cycles are taken."""

from __future__ import annotations

from types import ModuleType
from typing import Annotated, ClassVar, Literal, Self

from pydantic import BeforeValidator, Field, StrictInt, model_validator

from tribodyn.hbm.wear import law as wear_law
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.fields import Frequency, Number, Table
from tribodyn.workflows.scene.own import LawTable
from tribodyn.workflows.scene.stages import DRAW, RESUMABLE, WEAR, SceneStage
from tribodyn.workflows.scene.units import to_si


class WearStep(Table, stage=WEAR):
    """Largest depth that one wear step may add: a share of delta_max, or a depth [m]."""

    share: Annotated[float, Field(gt=0)] | None = None
    """Share of delta_max, the largest static deflection of the contact without its counterpart."""
    depth: Annotated[float, Field(gt=0)] | None = None
    """Depth."""


def _step(value: object) -> object:
    if isinstance(value, (WearStep, dict)):
        return value
    for unit, name in (("", "share"), ("m", "depth")):
        try:
            return WearStep(**{name: to_si(value, unit)})
        except ValueError:
            continue
    raise Refusal(f'expected a share of delta_max such as "5 %" or a depth such as "50 um", above 0, got {value!r}')


class Place(Table, stage=WEAR):
    """Where the cycle that wears is taken: a frequency [Hz], or a ratio to the frequency of the resonance peak."""

    frequency: Annotated[float, Field(gt=0)] | None = None
    """Frequency."""
    peak: Annotated[float, Field(gt=0)] | None = None
    """Ratio to the frequency of the resonance peak."""

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        if (self.frequency is None) == (self.peak is None):
            raise Refusal("expected either frequency or peak, and not both")
        return self


def _place(value: object) -> object:
    if isinstance(value, (Place, dict)):
        return value
    share, of, peak = value.partition("of peak") if isinstance(value, str) else ("", "", "")
    try:
        if value == "peak":
            return Place(peak=1.0)
        return Place(peak=to_si(share, "")) if of and not peak else Place(frequency=to_si(value, "Hz"))
    except ValueError:
        raise Refusal(
            f'expected "peak", a share of its frequency such as "98 % of peak", or a frequency such as "410 Hz", '
            f"got {value!r}"
        ) from None


At = Annotated[Place, BeforeValidator(_place)]


class Sweep(Table, stage=WEAR):
    """A slow sweep of the frequency over a band, again and again: cycles in proportion to the frequency."""

    start: Annotated[Frequency, Field(gt=0)]
    """Lowest frequency."""
    stop: Annotated[Frequency, Field(gt=0)]
    """Highest frequency."""
    points: Annotated[StrictInt, Field(ge=2, le=500)] = 21
    """Equal parts of the band, each worn at its middle."""

    @model_validator(mode="after")
    def _rises(self) -> Self:
        if self.stop <= self.start:
            raise Refusal(f"expected a sweep that rises, got {self.start:g} Hz to {self.stop:g} Hz")
        return self

    def duties(self) -> tuple[MissionDuty, ...]:
        """The middles of the parts; a sweep at a constant rate spends the same time in each."""
        width = (self.stop - self.start) / self.points
        middles = [self.start + (i + 0.5) * width for i in range(self.points)]
        return tuple(MissionDuty(at=Place(frequency=f), share=f / sum(middles)) for f in middles)


def _place_or_sweep(value: object) -> object:
    if isinstance(value, dict) and "start" in value:
        return Sweep.model_validate(value)
    if isinstance(value, str) and " to " in value:
        band, _, points = value.partition(" in ")
        start, _, stop = band.partition(" to ")
        given = {"points": int(points)} if points.strip().isdigit() else {}
        if not points or given:
            return Sweep.model_validate({"start": start, "stop": stop, **given})
    if isinstance(value, Sweep):
        return value
    return _place(value)


class MissionDuty(Table, stage=WEAR):
    """A part of the mission: a share of all cycles at one place, with the harmonic loads times `load`."""

    at: At
    """Where the cycles are taken."""
    share: Annotated[Number, Field(ge=0, le=1)]
    """Share of all cycles."""
    load: Annotated[Number, Field(ge=0)] = 1.0
    """Factor on the harmonic loads."""
    speed: Annotated[Frequency, Field(gt=0)] | None = None
    """Speed of the wheel meanwhile; `wheel.speed` by default."""


class JointWearTable(LawTable, stage=WEAR):
    """How one joint wears."""

    TABLE: ClassVar[str] = "wear"
    NUMBERS_STAGE: ClassVar[SceneStage] = WEAR
    LAWS: ClassVar[ModuleType] = wear_law

    law: str = "energy"
    """Name of a wear law, or a file my_law.py beside the scene; its own numbers, such as coefficient, are further keys
    of this table."""


class Wear(JointWearTable, stage=WEAR):
    """Wear of the contact until it is lost or max_steps are done."""

    split: Annotated[Number, Field(ge=0, le=1), DRAW] = 0.5
    """Share of the depth that the scene's own part loses, or the first of two faces; the rest wears the other one."""
    responses: Annotated[StrictInt, Field(ge=0, le=100), RESUMABLE] = 0
    """Number of response curves of the worn contact, evenly spread over the worn depth."""
    rule: Literal["thesis", "error_controlled"] = "thesis"
    """How the steps are chosen: "thesis" takes `step`, "error_controlled" takes `tolerance`."""
    tolerance: Annotated[Number, Field(gt=0, lt=1)] = 0.01
    """Error that one wear step of the error-controlled rule may make, relative."""
    motion: Literal["balance", "machine", "time"] = "balance"
    """Along which motion the error-controlled rule wears: "balance" takes the periodic one of the balance, "machine"
    follows in time what a machine does where it leaves that one, "time" takes the motion in time everywhere."""
    lost_below: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """Share of the first preload at which life and run end; 0: the life at 0.1 %, the run at the last touch."""
    lost_of: Literal["all", "any"] = "all"
    """Whose preload `lost_below` counts: of all joints that wear together, or of whichever joint falls first."""
    end_at: Literal["vibrating", "at_rest"] = "vibrating"
    """Whose preload that is: of the vibrating contact, its mean force, or of the contact without harmonic loads."""
    step: Annotated[WearStep, BeforeValidator(_step)] | None = None
    """Largest depth that one step of the thesis's rule may add: a share of delta_max such as "5 %", or a depth."""
    at: Annotated[Place | Sweep, BeforeValidator(_place_or_sweep)] = Place(peak=1.0)
    """Where the cycles are taken: "peak", a share of its frequency such as "98 % of peak", a frequency, or a slow sweep
    such as "420 Hz to 880 Hz" or "420 Hz to 880 Hz in 41" parts."""
    mission: tuple[MissionDuty, ...] = ()
    """List of duties that share the cycles, instead of `at`."""
    max_steps: Annotated[StrictInt, Field(ge=0), RESUMABLE] = 10_000
    """Largest number of wear steps."""

    @property
    def duties(self) -> tuple[MissionDuty, ...]:
        """The parts of the mission; of one place or a sweep, what these stand for."""
        if self.mission:
            return self.mission
        return self.at.duties() if isinstance(self.at, Sweep) else (MissionDuty(at=self.at, share=1.0),)

    @model_validator(mode="after")
    def _whole(self) -> Wear:
        if self.rule == "thesis" and self.step is None:
            raise Refusal('expected step, such as "5 %" of delta_max, for rule = "thesis"')
        total = sum(duty.share for duty in self.mission)
        if self.mission and abs(total - 1) > 1e-9:
            raise Refusal(f"expected shares of the mission that sum to 1, got {total:g}")
        if self.lost_of == "any" and self.end_at == "at_rest":
            raise Refusal('expected lost_of = "any" only with end_at = "vibrating"')
        if self.mission and "at" in self.model_fields_set:
            raise Refusal("expected either at or mission, and not both")
        return self
