"""Tables of a scene about its contact: law and springs, faces, measured surfaces."""

from __future__ import annotations

from types import ModuleType
from typing import Annotated, ClassVar, Literal

from pydantic import Field, StrictBool, StrictInt, model_validator

from tribodyn.hbm.contact import law as contact_law
from tribodyn.workflows.scene.fields import Angle, Direction, Length, Stiffness, Table
from tribodyn.workflows.scene.own import LawTable


class Contact(LawTable):
    """The contact law of every node pair; stiffness is that of all pairs together, shared by their area."""

    TABLE: ClassVar[str] = "contact"
    LAWS: ClassVar[ModuleType] = contact_law

    components: tuple[Literal["t1", "t2", "n"], ...] = ("t1", "t2", "n")
    """Contact components that are modelled."""
    law: str = "jenkins"
    """Name of a contact law, or a file my_law.py beside the scene; its own numbers, such as friction, are further keys
    of this table."""
    tangential_stiffness: Annotated[Stiffness, Field(gt=0, le=1e16)] | None = None
    """Tangential stiffness of all pairs together."""
    normal_stiffness: Annotated[Stiffness, Field(gt=0, le=1e16)] | None = None
    """Normal stiffness of all pairs together."""

    @model_validator(mode="after")
    def _only_what_the_components_need(self) -> Contact:
        along, across = any(c != "n" for c in self.components), "n" in self.components
        given = self.stiffness_is_given
        for name, need in (
            ("tangential_stiffness", along and not given),
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
    """Faces of the part against the ground, or a face against another one."""

    group: str | tuple[str, ...]
    """One face, or a list of faces."""
    opposite: str | None = None
    """Face that the group touches; the ground by default."""
    t1: Direction
    """Direction that the first tangential component follows."""
    vertices_only: StrictBool = False
    """Leave the mid-side nodes of the mesh out."""
    gap: Length | None = None
    """Initial gap of all pairs; by default that of the geometry, interference negative, and 0 against the ground."""
    pairing: Literal["auto", "nodes", "mortar"] = "auto"
    """"nodes" pairs matching nodes, "mortar" weighs both faces over the surface they share, "auto" pairs nodes where
    every facet of the first face has its like on the second."""
    reach: Annotated[Length, Field(ge=0)] | None = None
    """Farthest opening at which two faces still meet; a tenth of the length of the first face by default."""
    sector: Literal["same", "next"] | None = None
    """In a wheel, where the second face is: in the same sector, or in the next one, which the first face meets on its
    right side; by default in the next one for two faces of one body, in the same one otherwise."""
    plane: Direction | None = None
    """Direction towards a ground that is a plane, which each face touches with its nearest node."""
    inclination: Angle = 0.0
    """Inclination of that plane about t1, by the right hand."""
    punch: tuple[Annotated[Length, Field(gt=0)], Annotated[Length, Field(gt=0)]] | None = None
    """Sides of a rectangular punch along t1 and t2, from which the contact stiffness is calculated instead of given
    numbers."""

    @property
    def stiffness_is_given(self) -> bool:
        """Whether it follows from a punch."""
        return self.punch is not None

    @property
    def groups(self) -> tuple[str, ...]:
        """The faces."""
        return (self.group,) if isinstance(self.group, str) else self.group

    @property
    def meets_next(self) -> bool:
        """Whether it is, in a wheel, a contact of neighbouring sectors."""
        if self.sector is not None or self.opposite is None:
            return self.sector == "next"
        first, second = (name.rpartition(".")[0].split(".")[0] for name in (self.groups[0], self.opposite))
        return first == second


class SyntheticPair(Table):
    """A made-up pair of faces, see geometry.surface_pair.synthetic_pair."""

    seed: Annotated[StrictInt, Field(ge=0)]
    """Seed of the random numbers."""
    size: tuple[Annotated[Length, Field(gt=0)], Annotated[Length, Field(gt=0)]]
    """Sides of the faces."""
    ridge: Annotated[Length, Field(ge=0)]
    """Height of two ridges along the long edges of the first face."""
    waviness: Annotated[Length, Field(ge=0)]
    """Root mean square of waves about 1 mm long."""
    roughness: Annotated[Length, Field(ge=0)]
    """Root mean square of waves about 50 um long."""


class Surfaces(Table):
    """Measured faces of a flat contact, whose waviness becomes the gap before loading."""

    first: str | None = None
    """Height map of body 1."""
    second: str | None = None
    """Height map of body 2; flat by default."""
    synthetic: SyntheticPair | None = None
    """A synthetic pair of faces instead of files."""
    axes: tuple[Literal["t1", "t2", "-t1", "-t2"], Literal["t1", "t2", "-t1", "-t2"]] = ("t1", "t2")
    """Contact components that x and y of the maps follow, "-t1" for against it."""
    mirror: Literal["x", "y"] | None = None
    """Axis of the second map that is reversed before it faces the first."""
    cutoff: Annotated[Length, Field(gt=0)]
    """Wavelength that separates waviness from roughness."""
    mating_height: Length = 0.0
    """How far the faces are pushed on from their first touch."""
    lateral_unit: Annotated[Length, Field(gt=0)] = 1.0
    """Unit of lateral coordinates in text files."""
    height_unit: Annotated[Length, Field(gt=0)] = 1.0
    """Unit of heights in text files."""
    spacing: tuple[float, float] | None = None
    """Lateral spacing of text files that hold a matrix of heights."""

    @model_validator(mode="after")
    def _one_source(self) -> Surfaces:
        if (self.first is None) == (self.synthetic is None) or (self.first is None and self.second is not None):
            raise ValueError("expected either first, and perhaps second, or synthetic")
        if self.axes[0][-1] == self.axes[1][-1]:
            raise ValueError(f"expected axes along t1 and t2, got {list(self.axes)}")
        return self
