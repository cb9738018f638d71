"""Tables of a scene about its wear: law, step, where the cycles are taken."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, PrivateAttr, StrictInt, ValidationError, ValidationInfo, model_validator

from tribodyn.declarations import Role, read
from tribodyn.hbm.wear import law as wear_law, wear_rule
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.fields import (
    DRAW,
    RESUMABLE,
    STUDY,
    WEAR,
    Force,
    Frequency,
    Length,
    Number,
    SceneStage,
    Table,
)
from tribodyn.workflows.scene.units import to_si
from tribodyn.workflows.scene.user_files import (
    LawTable,
    folder_of,
    is_user_file,
    numbers,
    optional_user_file,
    user_file,
)


class WearStepLimit(Table, stage=WEAR):
    """Largest depth that one wear step may add: a share of delta_max, or a depth [m]."""

    share: Annotated[float, Field(gt=0)] | None = None
    """Share of delta_max, the largest static deflection of the contact without its counterpart."""
    depth: Annotated[float, Field(gt=0)] | None = None
    """Depth."""


def _step(value: object) -> object:
    if isinstance(value, (WearStepLimit, dict)):
        return value
    for unit, name in (("", "share"), ("m", "depth")):
        try:
            return WearStepLimit(**{name: to_si(value, unit)})
        except (Refusal, ValidationError):
            continue
    raise Refusal(f'expected a share of delta_max such as "5 %" or a depth such as "50 um", above 0, got {value!r}')


class Place(Table, stage=WEAR):
    """Where the cycle that wears is taken: a frequency [Hz], or a ratio to the frequency of the resonance peak."""

    frequency: Annotated[Frequency, Field(gt=0)] | None = None
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
    share, of, remainder = value.partition("of peak") if isinstance(value, str) else ("", "", "")
    if value == "peak":
        return {"peak": 1.0}
    try:
        return {"peak": to_si(share, "")} if of and not remainder else {"frequency": to_si(value, "Hz")}
    except Refusal:
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


class Debris(Table, stage=WEAR):
    """Worn material that stays in the gap as a bed, until it is ejected."""

    retained: Annotated[Number, Field(ge=0, le=1)]
    """Share of what is worn that stays in an empty gap."""
    thickness: Annotated[Length, Field(gt=0)] | None = None
    """Thickness of the bed that is ejected as fast as it is fed; without, nothing of it is ejected."""


class JointWearTable(LawTable, stage=WEAR):
    """How one joint wears."""

    TABLE: ClassVar[str] = "wear"
    NUMBERS_STAGE: ClassVar[SceneStage] = WEAR
    LAWS: ClassVar[ModuleType] = wear_law

    law: str = "energy"
    """Name of a wear law, or a file my_law.py beside the scene; its own numbers, such as coefficient, are further keys
    of this table."""
    debris: Debris | None = None
    """Bed of worn material in the gap."""


class Wear(JointWearTable, stage=WEAR):
    """Wear of the contact until it is lost or max_steps are done."""

    split: Annotated[Number, Field(ge=0, le=1), DRAW] = 0.5
    """Share of the depth that the scene's own part loses, or the first of two faces; the rest wears the other one."""
    rule: str = "thesis"
    """How the steps are chosen: "thesis" takes `step`, "error_controlled" takes `tolerance`; or a file my_rule.py
    beside the scene, whose own numbers are further keys of this table."""
    parameters: dict[str, float] = Field(default_factory=dict)
    """Numbers that the rule alone declares."""
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
    step: Annotated[WearStepLimit, BeforeValidator(_step)] | None = None
    """Largest depth that one step of the thesis's rule may add: a share of delta_max such as "5 %", or a depth."""
    at: Annotated[Place | Sweep, BeforeValidator(_place_or_sweep)] = Place(peak=1.0)
    """Where the cycles are taken: "peak", a share of its frequency such as "98 % of peak", a frequency, or a slow sweep
    such as "420 Hz to 880 Hz" or "420 Hz to 880 Hz in 41" parts."""
    mission: tuple[MissionDuty, ...] = ()
    """List of duties that share the cycles, instead of `at`."""
    max_steps: Annotated[StrictInt, Field(ge=0), RESUMABLE] = 10_000
    """Largest number of wear steps."""
    _rule_file: Path | None = PrivateAttr(None)

    @property
    def duties(self) -> tuple[MissionDuty, ...]:
        """The parts of the mission; of one place or a sweep, what these stand for."""
        if self.mission:
            return self.mission
        return self.at.duties() if isinstance(self.at, Sweep) else (MissionDuty(at=self.at, share=1.0),)

    @property
    def rule_name(self) -> str:
        """Name of the rule for hbm: that of the package, or the path of the file beside the scene."""
        return self.rule if self._rule_file is None else str(self._rule_file)

    @property
    def accuracy_keys(self) -> tuple[str, ...]:
        """Keys that say how fine the steps of its rule are."""
        return tuple(n.name for n in wear_rule.declared(self.rule_name) if n.role == Role.ACCURACY)

    @property
    def accuracy_share(self) -> float | None:
        """Tolerance of its steps, or their share of delta_max; None where its rule counts in another way."""
        if "tolerance" in self.accuracy_keys:
            return self.tolerance
        return self.step.share if "step" in self.accuracy_keys and self.step is not None else None

    def rule_numbers(self, scale: float) -> dict[str, float]:
        """Numbers of its rule by name, in SI units; scale : delta_max [m], for a step that is a share of it."""
        names = {number.name for number in wear_rule.declared(self.rule_name)}
        values = dict(self.parameters)
        if "tolerance" in names:
            values["tolerance"] = self.tolerance
        if "step" in names and self.step is not None:
            values["step"] = self.step.depth if self.step.depth is not None else (self.step.share or 0.0) * scale
        return values

    @model_validator(mode="before")
    @classmethod
    def _gather_numbers_of_rule(cls, table: Any, info: ValidationInfo) -> Any:
        """Move the keys that the rule alone declares into `parameters`."""
        folder = folder_of(info)
        rule = table.get("rule", cls.model_fields["rule"].default) if isinstance(table, dict) else None
        if folder is None or not isinstance(rule, str):
            return table
        if not is_user_file(rule) and rule not in wear_rule.names():
            known = ", ".join(repr(name) for name in wear_rule.names())
            raise Refusal(f"wear.rule: expected {known} or a file my_rule.py, got {rule!r}")
        path = user_file(folder, rule, "wear.rule") if is_user_file(rule) else wear_rule.file_of(rule)
        if table.get("step") is None and any(number.name == "step" for number in read(path)):
            raise Refusal(f'expected step, such as "5 %" of delta_max, for rule = "{rule}"')
        declared = [number for number in read(path) if number.name not in cls.model_fields]
        inputs = {number.name: table[number.name] for number in declared if number.name in table}
        others = {name: value for name, value in table.items() if name not in inputs}
        values = numbers("wear.", declared, inputs, cls.model_fields)
        return {**others, "parameters": values} if values else others

    @model_validator(mode="after")
    def _find_rule_file(self, info: ValidationInfo) -> Self:
        self._rule_file = optional_user_file(folder_of(info), self.rule, "wear.rule")
        return self

    @model_validator(mode="after")
    def _check(self) -> Wear:
        total = sum(duty.share for duty in self.mission)
        if self.mission and abs(total - 1) > 1e-9:
            raise Refusal(f"expected shares of the mission that sum to 1, got {total:g}")
        if self.lost_of == "any" and self.end_at == "at_rest":
            raise Refusal('expected lost_of = "any" only with end_at = "vibrating"')
        if self.mission and self.at != type(self).model_fields["at"].default:  # which a result holds beside a mission
            raise Refusal("expected either at or mission, and not both")
        return self


class WearTestTable(Table, stage=STUDY):
    """A wear test at the operating point of [wear], which pauses at marks for sweeps and scans."""

    marks: Annotated[StrictInt, Field(ge=2, le=500)] | tuple[Annotated[Number, Field(ge=0)], ...]
    """Cycles of the pauses; one whole number is how many of these are spread evenly from the start to the loss of
    contact."""
    sweeps: tuple[Annotated[Force, Field(gt=0)], ...] = ()
    """Forces of the harmonic load, for each a response curve over response.frequency at every mark."""
    scans: Annotated[StrictInt, Field(ge=0)] = 0
    """Every which mark has scans of the worn faces and loops, besides the first and the last; 0 for these alone."""

    @model_validator(mode="after")
    def _rising(self) -> Self:
        if isinstance(self.marks, tuple) and not (len(self.marks) and (np.diff(self.marks) > 0).all()):
            raise Refusal(f"expected marks in rising order, such as [0, 500000, 1000000], got {list(self.marks)}")
        return self

    def cycles(self, life: float) -> np.ndarray:
        """Cycles of the marks that a contact of this life reaches."""
        if isinstance(self.marks, int):
            return np.linspace(0.0, life, self.marks)
        return np.array([mark for mark in self.marks if mark <= life])

    def is_scanned(self, count: int) -> np.ndarray:
        """Which of so many marks have scans."""
        number = np.arange(count)
        return (number % (self.scans or count) == 0) | (number == count - 1)
