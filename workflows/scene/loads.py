"""Tables of a scene about what holds and loads the part: springs, prescribed displacements, loads, moving grounds."""

from __future__ import annotations

import math
from typing import Annotated, Generic, Literal, TypeVar

from pydantic import (
    Field,
    StrictInt,
    model_validator,
)

from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.fields import (
    Angle,
    Direction,
    Force,
    Frequency,
    Length,
    Pressure,
    Stiffness,
    Table,
    quantity,
)

KINDS = ("value", "pressure", "moment", "acceleration", "base_acceleration", "speed", "temperature")


class SpringTable(Table):
    """A spring from a group to the ground, or to the matching nodes of another group, that acts in one direction."""

    group: str
    """Group of nodes that the spring holds; on a face each node has a share by its tributary area."""
    direction: Direction
    """Direction in which it acts."""
    stiffness: Annotated[Stiffness, Field(ge=0)]
    """Stiffness of all nodes together."""
    opposite: str | None = None
    """Group whose matching nodes it connects to, instead of the ground."""


class Prescribed(Table):
    """Nodes whose static displacement along an axis is given; its force is a result, vibration is free."""

    group: str
    """Group of nodes."""
    axis: Literal["x", "y", "z"]
    """Axis of the displacement."""
    displacement: Length
    """The static displacement."""
    springs: tuple[str, ...] = ()
    """Names of springs between these nodes and the ground that act about the prescribed position."""


class StaticLoad(Table):
    """A load that does not change: a force on a group, a pressure into a face, a moment on the point of a coupling, an
    acceleration, a rotation, or a change of temperature."""

    group: str = ""
    """Group that is loaded by a force, a pressure or a moment; a force on a face is shared by area."""
    direction: Direction | None = None
    """Direction of the force."""
    value: Force | None = None
    """The whole force on the group."""
    pressure: Pressure | None = None
    """Pressure into the face, instead of a force."""
    opposite: str | None = None
    """Group on which the same force acts the other way: a couple."""
    shared: Literal["area", "nodes"] = "area"
    """How a force is shared on a face: "area" by tributary area, "nodes" equally by its nodes."""
    moment: Annotated[float, quantity("N m")] | None = None
    """Moment about the direction, on the point of a coupling."""
    acceleration: Annotated[float, quantity("m/s2")] | None = None
    """Gravity or another acceleration field along the direction, on all mass."""
    base_acceleration: Annotated[float, quantity("m/s2")] | None = None
    """Acceleration of the ground along the direction; displacements are then those relative to the ground."""
    speed: Frequency | None = None
    """Speed of rotation about an axis along the direction through `point`, whose centrifugal force acts."""
    point: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)
    """Point on the axis of rotation."""
    temperature: Annotated[float, quantity("K")] | None = None
    """Change of temperature."""
    bodies: tuple[str, ...] = ()
    """Bodies that are heated; all by default."""
    field: str | None = None
    """File with columns x, y, z and change of temperature, comma-separated, in metres and kelvin; its values times
    `temperature`, which is 1 K by default."""

    @model_validator(mode="after")
    def _one_kind(self) -> StaticLoad:
        given = [kind for kind in KINDS if getattr(self, kind) is not None]
        if self.field is not None and "temperature" not in given:
            given.append("temperature")
        if len(given) != 1:
            raise Refusal(f"expected one out of {', '.join(KINDS)}, got {', '.join(given) or 'none'}")
        directed = given[0] not in ("pressure", "temperature")
        if directed != (self.direction is not None):
            raise Refusal(f"expected {'a' if directed else 'no'} direction with {given[0]}")
        if bool(self.group) != (given[0] in ("value", "pressure", "moment")):
            raise Refusal(f"expected {'no ' if self.group else ''}group with {given[0]}")
        if self.opposite is not None and given[0] != "value":
            raise Refusal("expected opposite only with value and direction, for a couple of forces")
        if self.bodies and given[0] != "temperature":
            raise Refusal("expected bodies only with temperature")
        return self

    @property
    def amplitude(self) -> float:
        """Its size [N], [Pa], [N m], [m/s2], [rad2/s2] or [K]."""
        if self.speed is not None:
            return (2 * math.pi * self.speed) ** 2
        if self.field is not None and self.temperature is None:
            return 1.0
        return next((size for kind in KINDS if (size := getattr(self, kind)) is not None), 0.0)


class Vibrates(Table):
    """A load that goes as cos(harmonic * w t + phase)."""

    phase: Angle = 0.0
    """Phase of the load."""
    harmonic: Annotated[StrictInt, Field(ge=1)] = 1
    """Multiple of the excitation frequency."""


class HarmonicLoad(Vibrates, StaticLoad):
    """A load that goes as cos(harmonic * w t + phase)."""


class Motion(Table):
    """The ground of a contact face moves: static + harmonic * cos(w t + phase), along a direction."""

    direction: Direction
    """Direction of the motion."""
    static: Length = 0.0
    """Its static part."""
    harmonic: Length = 0.0
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
        both = sorted(set(self.static) & set(self.harmonic))
        if both:
            raise Refusal(f'expected one load named "{both[0]}", found it under static and under harmonic')
        if not self.harmonic:
            raise Refusal("expected at least one harmonic load, for example [loads.harmonic.drive]")
        return self
