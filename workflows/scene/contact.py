"""Tables of a scene about its contact: law and springs, faces, measured surfaces."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StrictBool, StrictInt, model_validator

from tribodyn.workflows.scene.fields import Angle, Direction, Length, Number, Stiffness, Table


class Contact(Table):
    """The contact law of every node pair; stiffness is that of all pairs together, shared by their area."""

    components: tuple[Literal["t1", "t2", "n"], ...] = ("t1", "t2", "n")
    law: str = "jenkins"
    tangential_stiffness: Annotated[Stiffness, Field(gt=0)] | None = None
    normal_stiffness: Annotated[Stiffness, Field(gt=0)] | None = None
    friction: Annotated[Number, Field(ge=0)] | None = None

    @model_validator(mode="after")
    def _only_what_the_components_need(self) -> Contact:
        along, across = any(c != "n" for c in self.components), "n" in self.components
        given = self.stiffness_is_given
        for name, need in (
            ("tangential_stiffness", along and not given),
            ("friction", along),
            ("normal_stiffness", across and not given),
        ):
            if need != (getattr(self, name) is not None):
                verb = "is missing" if need else "has no meaning"
                what = "with a punch" if given and not need else f"for the components {', '.join(self.components)}"
                raise ValueError(f"contact.{name} {verb} {what}")
        return self

    @property
    def stiffness_is_given(self) -> bool:
        """Whether the stiffness follows from something else than its two numbers."""
        return False


class FaceContact(Contact):
    """Faces of the part against the ground or a face against another one.

    punch : sides of a rectangular punch along t1 and t2, whose contact stiffness is taken instead of given numbers
    group : one face, or a list of faces
    t1 is the direction that the first tangential component follows; vertices_only leaves the mid-side nodes out.
    plane : direction towards a ground that is a plane, which each face touches with its nearest node
    inclination : of that plane about t1, by the right hand
    """

    group: str | tuple[str, ...]
    opposite: str | None = None
    t1: Direction
    vertices_only: StrictBool = False
    gap: Length = 0.0
    plane: Direction | None = None
    inclination: Angle = 0.0
    punch: tuple[Annotated[Length, Field(gt=0)], Annotated[Length, Field(gt=0)]] | None = None

    @property
    def stiffness_is_given(self) -> bool:
        """Whether it follows from a punch."""
        return self.punch is not None

    @property
    def groups(self) -> tuple[str, ...]:
        """The faces."""
        return (self.group,) if isinstance(self.group, str) else self.group


class SyntheticPair(Table):
    """A made-up pair of faces, see geometry.surface_pair.synthetic_pair."""

    seed: Annotated[StrictInt, Field(ge=0)]
    size: tuple[Annotated[Length, Field(gt=0)], Annotated[Length, Field(gt=0)]]
    ridge: Annotated[Length, Field(ge=0)]
    waviness: Annotated[Length, Field(ge=0)]
    roughness: Annotated[Length, Field(ge=0)]


class Surfaces(Table):
    """Measured faces of a flat contact, whose waviness becomes the gap before loading.

    first, second : height map of body 1, and of body 2 where it is not taken as flat; or a synthetic pair
    axes : contact components that x and y of the maps follow, "-t1" for against it
    mirror : axis of the second map that is reversed before it faces the first, see geometry.surface_pair
    cutoff : wavelength that parts waviness from roughness
    mating_height : how far the faces are pushed on from their first touch
    lateral_unit, height_unit, spacing : of text files, see geometry.surface_io
    """

    first: str | None = None
    second: str | None = None
    synthetic: SyntheticPair | None = None
    axes: tuple[Literal["t1", "t2", "-t1", "-t2"], Literal["t1", "t2", "-t1", "-t2"]] = ("t1", "t2")
    mirror: Literal["x", "y"] | None = None
    cutoff: Annotated[Length, Field(gt=0)]
    mating_height: Length = 0.0
    lateral_unit: Annotated[Length, Field(gt=0)] = 1.0
    height_unit: Annotated[Length, Field(gt=0)] = 1.0
    spacing: tuple[float, float] | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Surfaces:
        if (self.first is None) == (self.synthetic is None) or (self.first is None and self.second is not None):
            raise ValueError("expected either first, and perhaps second, or synthetic")
        if self.axes[0][-1] == self.axes[1][-1]:
            raise ValueError(f"expected axes along t1 and t2, got {list(self.axes)}")
        return self
