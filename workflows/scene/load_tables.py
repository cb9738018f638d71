"""Tables of a scene about what holds and loads the part: springs, prescribed displacements, loads, moving grounds."""

from __future__ import annotations

import math
from typing import Annotated, Generic, Literal, TypeVar

import numpy as np
from pydantic import Field, StrictInt, model_validator

from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.fields import (
    LOADS,
    PART,
    REDUCTION,
    SMOOTH,
    Acceleration,
    Angle,
    Direction,
    Force,
    Frequency,
    Length,
    Pressure,
    Stiffness,
    Table,
    TemperatureChange,
    quantity,
)

KINDS = ("value", "pressure", "moment", "acceleration", "base_acceleration", "speed", "temperature")


class SpringTable(Table, stage=PART):
    """A spring from a group to the ground, or to the matching nodes of another group, that acts in one direction."""

    group: str
    """Group of nodes that the spring holds; on a face each node has a share by its tributary area."""
    direction: Direction
    """Direction in which it acts."""
    stiffness: Annotated[Stiffness, Field(ge=0), SMOOTH]
    """Stiffness of all nodes together."""
    opposite: str | None = None
    """Group whose matching nodes it connects to, instead of the ground."""


class Prescribed(Table, stage=REDUCTION):
    """Nodes whose static displacement along an axis is given; its force is a result, vibration is free."""

    group: str
    """Group of nodes."""
    axis: Literal["x", "y", "z"]
    """Axis of the displacement."""
    displacement: Annotated[Length, LOADS, SMOOTH]
    """The static displacement."""
    springs: Annotated[tuple[str, ...], LOADS] = ()
    """Names of springs between these nodes and the ground that act about the prescribed position."""


class StaticLoad(Table, stage=PART):
    """A load that does not change: a force on a group, a pressure into a face, a moment on the point of a coupling, an
    acceleration, a rotation, or a change of temperature."""

    group: str = ""
    """Group that is loaded by a force, a pressure or a moment; a force on a face is shared by area."""
    direction: Direction | None = None
    """Direction of the force."""
    value: Annotated[Force | None, LOADS, SMOOTH] = None
    """The whole force on the group."""
    pressure: Annotated[Pressure | None, LOADS, SMOOTH] = None
    """Pressure into the face, instead of a force."""
    opposite: str | None = None
    """Group on which the same force acts the other way: a couple."""
    shared: Literal["area", "nodes"] = "area"
    """How a force is shared on a face: "area" by tributary area, "nodes" equally by its nodes."""
    moment: Annotated[float, quantity("N m"), LOADS, SMOOTH] | None = None
    """Moment about the direction, on the point of a coupling."""
    acceleration: Annotated[Acceleration, LOADS, SMOOTH] | None = None
    """Gravity or another acceleration field along the direction, on all mass."""
    base_acceleration: Annotated[Acceleration, LOADS, SMOOTH] | None = None
    """Acceleration of the ground along the direction; displacements are then those relative to the ground."""
    speed: Annotated[Frequency | None, LOADS, SMOOTH] = None
    """Speed of rotation about an axis along the direction through `point`, of which the centrifugal force acts alone: a
    [wheel] with its speed is stiffened by its stress too."""
    point: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)
    """Point on the axis of rotation."""
    temperature: Annotated[TemperatureChange, LOADS, SMOOTH] | None = None
    """Change of temperature."""
    bodies: tuple[str, ...] = ()
    """Bodies that are heated; all by default."""
    field: str | None = None
    """File with columns x, y, z and change of temperature, comma-separated, in metres and kelvin; its values times
    `temperature`, which is 1 K by default."""

    @model_validator(mode="after")
    def _one_kind(self) -> StaticLoad:
        kinds = [kind for kind in KINDS if getattr(self, kind) is not None]
        if self.field is not None and "temperature" not in kinds:
            kinds.append("temperature")
        if len(kinds) != 1:
            raise Refusal(f"expected one out of {', '.join(KINDS)}, got {', '.join(kinds) or 'none'}")
        kind = kinds[0]
        if (kind in ("pressure", "temperature")) != (self.direction is None):
            raise Refusal(f"expected {'a' if self.direction is None else 'no'} direction with {kind}")
        if bool(self.group) != (kind in ("value", "pressure", "moment")):
            raise Refusal(f"expected {'no ' if self.group else ''}group with {kind}")
        if self.opposite is not None and kind != "value":
            raise Refusal("expected opposite only with value and direction, for a couple of forces")
        if self.bodies and kind != "temperature":
            raise Refusal("expected bodies only with temperature")
        return self

    @property
    def kind(self) -> str:
        """What it is: one out of KINDS."""
        return next((kind for kind in KINDS if getattr(self, kind) is not None), "temperature")

    @property
    def amplitude(self) -> float:
        """Its size [N], [Pa], [N m], [m/s2], [rad2/s2] or [K]."""
        if self.speed is not None:
            return (2 * math.pi * self.speed) ** 2
        size: float | None = getattr(self, self.kind)
        return 1.0 if size is None else size

    def fault_in_wheel(self, axis: tuple[float, float, float]) -> str:
        """Why it cannot act on every sector of a wheel about an axis alike, with the cure; empty where it can."""
        if self.speed is not None:
            return "a wheel turns at wheel.speed, with stress stiffening, spin softening and Coriolis forces: give that"
        is_field = self.acceleration is not None or self.base_acceleration is not None
        if is_field and self.direction is not None and abs(np.dot(self.direction, axis)) < 1 - 1e-9:
            return "an acceleration across wheel.axis would turn from sector to sector: give one along the axis"
        return ""


class Vibrates(Table, stage=LOADS):
    """A load that goes as cos(harmonic * w t + phase)."""

    phase: Angle = 0.0
    """Phase of the load."""
    harmonic: Annotated[StrictInt, Field(ge=1)] = 1
    """Multiple of the excitation frequency."""


class HarmonicLoad(Vibrates, StaticLoad):
    """A load that goes as cos(harmonic * w t + phase)."""


class Motion(Table, stage=LOADS):
    """The ground of a contact face moves: static + harmonic * cos(w t + phase), along a direction."""

    direction: Direction
    """Direction of the motion."""
    static: Annotated[Length, SMOOTH] = 0.0
    """Its static part."""
    harmonic: Annotated[Length, SMOOTH] = 0.0
    """Its amplitude."""
    phase: Angle = 0.0
    """Its phase."""


Static = TypeVar("Static")

Harmonic = TypeVar("Harmonic")


class Loads(Table, Generic[Static, Harmonic]):
    """Named loads."""

    static: dict[str, Static] = Field(default_factory=dict)
    """Static loads by name."""
    harmonic: dict[str, Harmonic] = Field(default_factory=dict)
    """Harmonic loads by name; at least one."""

    @model_validator(mode="after")
    def _distinct(self) -> Loads[Static, Harmonic]:
        shared = sorted(set(self.static) & set(self.harmonic))
        if shared:
            raise Refusal(f'expected one load named "{shared[0]}", found it under static and under harmonic')
        if not self.harmonic:
            raise Refusal("expected at least one harmonic load, for example [loads.harmonic.drive]")
        return self
