"""Tables of a scene about its wear: law, step, where the cycles are taken."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, StrictInt, model_validator

from tribodyn.workflows.scene.fields import Number, Table, WearCoefficient
from tribodyn.workflows.scene.units import to_si


class WearStep(Table):
    """Largest depth that one wear step may add: a share of delta_max, or a depth [m]."""

    share: Annotated[float, Field(gt=0)] | None = None
    depth: Annotated[float, Field(gt=0)] | None = None


def _step(value: object) -> object:
    if isinstance(value, (WearStep, dict)):
        return value
    for unit, name in (("", "share"), ("m", "depth")):
        try:
            return WearStep(**{name: to_si(value, unit)})
        except ValueError:
            continue
    raise ValueError(f'expected a share of delta_max such as "5 %" or a depth such as "50 um", above 0, got {value!r}')


class Place(Table):
    """Where the cycle that wears is taken: a frequency [Hz], or a ratio to the frequency of the resonance peak."""

    frequency: Annotated[float, Field(gt=0)] | None = None
    peak: Annotated[float, Field(gt=0)] | None = None


def _place(value: object) -> object:
    if isinstance(value, (Place, dict)):
        return value
    share, of, peak = value.partition("of peak") if isinstance(value, str) else ("", "", "")
    try:
        if value == "peak":
            return Place(peak=1.0)
        return Place(peak=to_si(share, "")) if of and not peak else Place(frequency=to_si(value, "Hz"))
    except ValueError:
        raise ValueError(
            f'expected "peak", a share of its frequency such as "98 % of peak", or a frequency such as "410 Hz", '
            f"got {value!r}"
        ) from None


At = Annotated[Place, BeforeValidator(_place)]


class MissionDuty(Table):
    """A part of the mission: a share of all cycles at one place, with the harmonic loads times `load`."""

    at: At
    share: Annotated[Number, Field(ge=0, le=1)]
    load: Annotated[Number, Field(ge=0)] = 1.0


class Wear(Table):
    """Wear of the patch until contact is lost or max_steps are done.

    rule : "thesis" takes `step`, "error_controlled" takes `tolerance`, its local error as a share
    lost_below : share of the first preload at which the run ends; 0 waits until the last touch ends
    at, mission : one place where all cycles are taken, or a list of duties that share them
    law : name of a wear law, or a file my_law.py beside the scene
    split : share of the depth that the scene's own part loses, or the first of two faces; the rest wears the other one
    responses : curves of the worn contact, evenly spread over what is worn
    """

    law: str = "energy"
    split: Annotated[Number, Field(ge=0, le=1)] = 0.5
    responses: Annotated[StrictInt, Field(ge=0, le=100)] = 0
    coefficient: Annotated[WearCoefficient, Field(ge=0)]
    rule: Literal["thesis", "error_controlled"] = "thesis"
    tolerance: Annotated[Number, Field(gt=0, lt=1)] = 0.01
    lost_below: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    step: Annotated[WearStep, BeforeValidator(_step)] | None = None
    at: At = Place(peak=1.0)
    mission: tuple[MissionDuty, ...] = ()
    max_steps: Annotated[StrictInt, Field(ge=0)] = 10_000

    @model_validator(mode="after")
    def _whole(self) -> Wear:
        if self.rule == "thesis" and self.step is None:
            raise ValueError('expected step, such as "5 %" of delta_max, for rule = "thesis"')
        total = sum(duty.share for duty in self.mission)
        if self.mission and abs(total - 1) > 1e-9:
            raise ValueError(f"expected shares of the mission that sum to 1, got {total:g}")
        if self.mission and "at" in self.model_fields_set:
            raise ValueError("expected either at or mission, and not both")
        return self
