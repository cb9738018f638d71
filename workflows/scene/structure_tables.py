"""Tables of a scene about its bodies, what they are made from and what joins them.

Groups of a body are named "body.group"."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import BeforeValidator, Field, StrictInt, model_validator

from tribodyn.geometry.sources.face_rules import FacetRule
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.contact import FaceContact
from tribodyn.workflows.scene.fields import (
    LOADS,
    PART,
    SMOOTH,
    Angle,
    Direction,
    Force,
    Length,
    Stiffness,
    Table,
    quantity,
    refuse_slips,
)
from tribodyn.workflows.scene.part_tables import Meshed
from tribodyn.workflows.scene.units import to_si
from tribodyn.workflows.scene.wear import JointWearTable

GROUND = "ground"

Point = tuple[Length, Length, Length]


class FaceRule(Table, stage=PART):
    """A face of a body: the facets of its boundary that satisfy all that is given.

    Places are those of the file or part, before the body is moved, in metres unless a unit is given."""

    box: tuple[Point, Point] | None = None
    """Two corners of a box within which the whole facets lie."""
    nearest: Point | None = None
    """Point whose nearest smooth face is taken: all that continues from there without an edge."""
    normal: Direction | None = None
    """Direction in which the facets look, outwards."""
    within: Annotated[Angle, Field(gt=0, le=math.pi)] = math.radians(5.0)
    """How far a facet may look away from `normal`."""
    cad: tuple[StrictInt, ...] = ()
    """Numbers of faces of a CAD file, as `tribodyn inspect` lists them."""

    @model_validator(mode="after")
    def _something(self) -> FaceRule:
        if self.box is None and self.nearest is None and self.normal is None and not self.cad:
            raise Refusal("expected a rule: box, nearest, normal or cad")
        return self

    @property
    def rule(self) -> FacetRule:
        """The rule for geometry.sources.face_rules."""
        return FacetRule(self.box, self.nearest, self.normal, self.within, self.cad)


Use = Literal["ties", "couplings", "equations", "springs", "masses", "supports", "forces", "pressures"]
EVERYTHING: tuple[Use, ...] = get_args(Use)


def in_metres(value: object) -> object:
    """A unit of length by its name as a number of metres."""
    return to_si(f"1 {value}", "m") if isinstance(value, str) else value


class DeckFace(FaceRule, stage=PART):
    """A face of a body of a deck that is picked by rule, where the deck puts the body."""

    body: str
    """Body of the deck, as `tribodyn inspect` lists it."""


class DeckTable(Table, stage=PART):
    """A deck of another FE program with its bodies, materials, constraints, supports and loads.

    Its bodies stand in the scene under their names in the deck, its groups under "body.group". The forces and pressures
    of all its steps act together as one static load. A material of the scene takes the place of one of the same name.
    """

    file: str
    """The deck, relative to the scene file."""
    unit: Annotated[float, BeforeValidator(in_metres), Field(gt=0)] = 1.0
    """Its unit of length, such as "mm"; a deck in mm counts in N, mm, t and s."""
    use: tuple[Use, ...] = EVERYTHING
    """What is taken from it beside bodies and materials; everything by default."""
    ignore: tuple[str, ...] = ()
    """Cards and elements that are not carried over though they would change the structure, by their names in the
    refusal: what they do is left out, on your own decision."""
    material: str | None = None
    """Material of the scene for elements to which the deck gives none."""
    halved: Annotated[StrictInt, Field(ge=0, le=3)] = 0
    """How many times every element of its bodies is cut into eight of half the size, its shape kept."""
    elements: Literal["deck", "quadratic", "linear_bbar", "linear_reduced"] = "deck"
    """How its hexahedra of first order are computed: in the formulation that the deck names (C3D8, C3D8I, C3D8R ...);
    raised to second order, with about eight times the nodes; with the mean dilatation of each element; or with reduced
    integration and hourglass stiffness."""
    fixed: tuple[str, ...] = ()
    """Groups "body.group" that are clamped besides."""
    fixed_axes: dict[str, str] = Field(default_factory=dict)
    """Groups "body.group" held along some axes besides: group = letters out of "xyz"."""
    faces: dict[str, DeckFace] = Field(default_factory=dict)
    """Faces of its bodies that are picked by rule, by name; they are known as "body.name"."""


class Rotation(Table, stage=PART):
    """A turn about an axis through a point, by the right hand."""

    axis: Direction
    """Axis of the turn."""
    angle: Angle
    """Angle of the turn."""
    point: Point = (0.0, 0.0, 0.0)
    """Point on the axis."""


class BodyTable(Meshed, stage=PART):
    """A body: a part of geometry/ or a mesh file, where it stands, what it is made of and what holds it.

    All other keys of the table are parameters of the part; those left out have the part's own defaults."""

    KEY: ClassVar[str] = ""

    volume: str | None = None
    """Volume group of the part or mesh that is this body; the whole mesh by default."""
    unit: Annotated[float, BeforeValidator(in_metres), Field(gt=0)] = 1.0
    """Length unit of the mesh file, such as "mm"."""
    size: Annotated[Length, Field(gt=0)] | None = None
    """Element size of a CAD file, a tenth of its length by default."""
    face_sizes: dict[str, Annotated[Length, Field(gt=0)]] = Field(default_factory=dict)
    """Element sizes at faces of a CAD file: "face 6" = size."""
    faces: dict[str, FaceRule] = Field(default_factory=dict)
    """Faces that are picked by rule, by name."""
    rotation: Rotation | tuple[Rotation, ...] = ()
    """Turn of the body, or several one after the other, before it is moved."""
    translation: Point = (0.0, 0.0, 0.0)
    """Where the origin of the body is moved to."""
    material: str | dict[str, str]
    """Name of its material, or volume group = material for each of its volumes."""

    @model_validator(mode="after")
    def _sizes(self) -> Self:
        for key in ("size", "face_sizes", "unit") if self.part is not None else ():
            if getattr(self, key) != type(self).model_fields[key].get_default(call_default_factory=True):
                raise Refusal(f"{key} is for a mesh or a CAD file: a part has parameters of its own")
        for name in self.face_sizes:
            if not (name.startswith("face ") and name.removeprefix("face ").isdigit()):
                raise Refusal(f'face_sizes: expected faces by their numbers, such as "face 6", got "{name}"')
        return self

    @property
    def turns(self) -> tuple[Rotation, ...]:
        """Its turns, one after the other."""
        return (self.rotation,) if isinstance(self.rotation, Rotation) else self.rotation

    @property
    def materials(self) -> tuple[str, ...]:
        """Names of its materials."""
        return (self.material,) if isinstance(self.material, str) else tuple(self.material.values())


class NamedContact(FaceContact):
    """A joint: a face against another one, whose mesh need not match, or against the ground."""

    wear: JointWearTable | None = None
    """How this joint wears, instead of [wear], which is for all."""

    @model_validator(mode="before")
    @classmethod
    def _first_and_second(cls, table: Any) -> Any:
        if not isinstance(table, dict) or "group" in table:
            return table
        if "first" not in table or "second" not in table:
            refuse_slips(table, ["first", "second"], ["first", "second", *cls.model_fields])
            missing = "first" if "first" not in table else "second"
            raise Refusal(f'{missing} is missing: give first = "body.face", and second the same or "{GROUND}"')
        remainder = {key: value for key, value in table.items() if key not in ("first", "second")}
        other = {} if table["second"] == GROUND else {"opposite": table["second"]}
        return {**remainder, "group": table["first"], **other}


class TieTable(Table, stage=PART):
    """Two faces that are glued; their meshes need not match."""

    first: str
    """Face whose nodes follow the other one; the finer of the two, and not clamped."""
    second: str
    """Face that it is glued to."""
    reach: Annotated[Length, Field(ge=0)] | None = None
    """Farthest opening that is bridged. By default faces meet up to a tenth of the length of the first, and are refused
    where they are apart by more than 0.5 % of it on average."""


Axis = Literal["x", "y", "z", "rx", "ry", "rz"]
AXES: tuple[Axis, ...] = get_args(Axis)


class CouplingTable(Table, stage=PART):
    """A point that carries a face; loads, springs, masses and outputs may name it."""

    face: str
    """Face or group that is coupled."""
    kind: Literal["rigid", "distributed"] = "distributed"
    """"rigid": the face moves as a rigid body with the point; "distributed": the point moves as the mean of the face,
    which stays soft."""
    point: Point | None = None
    """Where the point is; the middle of the face by default."""
    fixed: tuple[Axis, ...] = ()
    """What of the point is held: out of "x", "y", "z" and the turns "rx", "ry", "rz"; only of a rigid coupling."""

    @model_validator(mode="after")
    def _held_if_rigid(self) -> CouplingTable:
        if self.fixed and self.kind == "distributed":
            raise Refusal('fixed: a point that follows its face cannot be held: give kind = "rigid"')
        return self


class LinkTable(Table, stage=PART):
    """The points of two couplings move alike."""

    first: str
    """Name of a coupling."""
    second: str
    """Name of the other one."""
    free: tuple[Axis, ...] = ()
    """Motions in which they stay free of each other: out of "x", "y", "z" and the turns "rx", "ry", "rz"."""

    @model_validator(mode="after")
    def _links_two_couplings(self) -> LinkTable:
        if len(set(self.free)) == len(AXES):
            raise Refusal(f"free: expected some of {', '.join(AXES)}, but not all, got {list(self.free)}")
        if self.first == self.second:
            raise Refusal(f"second: expected another coupling than {self.first!r}")
        return self


Inertia = Annotated[float, quantity("kg m2"), Field(ge=0)]


class PointMassTable(Table, stage=PART):
    """A lumped mass."""

    at: str
    """Name of a coupling, or of a group over which it is shared."""
    mass: Annotated[float, quantity("kg"), Field(ge=0)]
    """The mass."""
    inertia: tuple[Inertia, Inertia, Inertia] = (0.0, 0.0, 0.0)
    """Moments of inertia about x, y, z at the point of a coupling."""


class BoltTable(Table, stage=PART):
    """A bolt between the faces under its head and under its nut, as an elastic rod with a preload."""

    first: str
    """Face under the head."""
    second: str
    """Face under the nut."""
    preload: Annotated[Force, Field(ge=0), LOADS, SMOOTH]
    """Force in the shank when it is tightened, all other loads away."""
    state: Literal["locked", "constant"] = "locked"
    """"locked": the shank keeps its length after tightening, so that its force follows the structure; "constant": the
    force stays what it is."""
    axis: Direction | None = None
    """Direction of the shank, in either sense, through the middle of the smaller of its faces; by default from the
    middle of one face to the middle of the other."""
    diameter: Annotated[Length, Field(gt=0)] | None = None
    """Diameter of the shank."""
    material: str | None = None
    """Its material, which also says how the shank expands where it is heated, by the mean temperature of its faces."""
    stiffness: Annotated[Stiffness, Field(gt=0)] | None = None
    """Stiffness along the shank instead of its diameter."""

    @model_validator(mode="after")
    def _stiff(self) -> BoltTable:
        if self.state != "locked":
            return self
        if (self.diameter is None) == (self.stiffness is None) or (self.diameter and self.material is None):
            raise Refusal("a locked bolt needs either diameter and material of its shank, or its stiffness")
        return self
