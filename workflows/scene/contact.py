"""Tables of a scene about its contact: law and springs, faces, measured surfaces."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, StrictBool, StrictInt, ValidationInfo, field_validator, model_validator

from tribodyn import declarations
from tribodyn.declarations import Number
from tribodyn.hbm.contact import contact_law
from tribodyn.refusal import Refusal
from tribodyn.text_file import text_of
from tribodyn.workflows.scene.fields import (
    CONTACT,
    PART,
    SMOOTH,
    STUDY,
    Angle,
    Direction,
    Length,
    SceneStage,
    Stiffness,
    Table,
    TemperatureChange,
)
from tribodyn.workflows.scene.user_files import LawTable, folder_of, is_user_file, user_file


def rows_of(path: Path) -> list[list[float]]:
    """The rows of a file of comma-separated numbers."""
    try:
        rows: list[list[float]] = np.loadtxt(text_of(path).splitlines(), delimiter=",", ndmin=2).tolist()
    except ValueError as error:
        raise Refusal(f"'{path.name}' is no table of comma-separated numbers ({error})") from None
    return rows


class ContactTable(LawTable):
    """The contact law of every node pair; stiffness is that of all pairs together, shared by their area."""

    TABLE: ClassVar[str] = "contact"
    NUMBERS_STAGE: ClassVar[SceneStage] = CONTACT
    LAWS: ClassVar[ModuleType] = contact_law
    OTHERS: ClassVar[tuple[Number, ...]] = tuple(
        Number(name, "N/m", above=0.0) for name in ("tangential_stiffness", "normal_stiffness")
    )

    components: Annotated[tuple[Literal["t1", "t2", "n"], ...], PART] = ("t1", "t2", "n")
    """Contact components that are modelled."""
    law: Annotated[str, CONTACT] = "jenkins"
    """Name of a contact law, or a file my_law.py beside the scene; its own numbers, such as friction, are further keys
    of this table."""
    tangential_stiffness: Annotated[Stiffness, Field(gt=0, le=1e16), CONTACT, SMOOTH] | None = None
    """Tangential stiffness of all pairs together."""
    normal_stiffness: Annotated[Stiffness, Field(gt=0, le=1e16), CONTACT, SMOOTH] | None = None
    """Normal stiffness of all pairs together."""
    springs: Annotated[Literal["compliance", "closed"], STUDY] = "compliance"
    """What the springs stand for: a "compliance" that the joint has, or a "closed" contact without any; then the errors
    have a row for what the springs do, by the limit of stiffer ones."""
    table: Annotated[tuple[tuple[float, ...], ...] | None, CONTACT] = None
    """File of the law's own table beside the scene, comma-separated numbers, or its rows; where the law takes one. Left
    out, it is that of the measured faces in [surfaces], and so is the law's radius."""

    @field_validator("table", mode="before")
    @classmethod
    def _read_the_table(cls, table: Any, info: ValidationInfo) -> Any:
        folder = folder_of(info)
        return rows_of(user_file(folder, table, f"{cls.TABLE}.table")) if isinstance(table, str) and folder else table

    @model_validator(mode="after")
    def _table_that_the_law_takes(self, info: ValidationInfo) -> Self:
        if folder_of(info) is not None:
            columns = declarations.constant(self.law_file, "TABLE")
            if (columns is None) != (self.table is None):
                verb = "has no meaning" if columns is None else f"is missing ({' and '.join(columns)})"
                raise Refusal(f"{self.TABLE}.table {verb} for the law '{self.law}'")
        return self

    @property
    def law_file(self) -> Path:
        """File of the law."""
        return Path(self.law_name) if self._user_file is not None else contact_law.file_of(self.law)

    @model_validator(mode="after")
    def _only_what_the_components_need(self) -> ContactTable:
        has_tangential, has_normal = any(c != "n" for c in self.components), "n" in self.components
        is_derived = self.has_derived_stiffness
        for name, is_needed in (
            ("tangential_stiffness", has_tangential and not is_derived),
            ("normal_stiffness", has_normal and not is_derived),
        ):
            if is_needed != (getattr(self, name) is not None):
                verb = "is missing" if is_needed else "has no meaning"
                reason = f"for the components {', '.join(self.components)}"
                reason = "where it follows from a punch or the law" if is_derived and not is_needed else reason
                raise Refusal(f"contact.{name} {verb} {reason}")
        return self

    @property
    def has_derived_stiffness(self) -> bool:
        """Whether the stiffness follows from the numbers of the law, not from the two of this table."""
        if is_user_file(self.law) and self._user_file is None:  # of a result: it was checked when the scene was read
            return self.tangential_stiffness is None and self.normal_stiffness is None
        return bool(declarations.constant(self.law_file, "STIFFNESS_FROM_NUMBERS"))


class FaceContact(ContactTable, stage=PART):
    """Faces of the part against the ground, or a face against another one."""

    group: str | Annotated[tuple[str, ...], Field(min_length=1)]
    """One face, or a list of faces."""
    opposite: str | None = None
    """Face that the group touches; the ground by default."""
    t1: Direction | None = None
    """Direction that the first tangential component follows; by default the first of x, y, z that lies most along the
    face."""
    vertices_only: StrictBool = False
    """Leave the mid-side nodes of the mesh out; without, faces of tetrahedra have their pairs at these alone."""
    gap: Length | None = None
    """Initial gap of all pairs; by default that of the geometry, interference negative, and 0 against the ground."""
    gap_map: Annotated[str | None, CONTACT] = None
    """File beside the scene with rows x, y, z, opening in metres, which adds to the gap; its least at a pair is taken
    off."""
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
    punch: Annotated[tuple[Annotated[Length, Field(gt=0)], Annotated[Length, Field(gt=0)]] | None, CONTACT] = None
    """Sides of a rectangular punch along t1 and t2, from which the contact stiffness is calculated instead of given
    numbers."""

    temperature: Annotated[TemperatureChange | None, CONTACT, SMOOTH] = None
    """Change of temperature of the contact, for numbers over it; by default the mean over its two bodies of what
    static loads heat them by."""

    @model_validator(mode="after")
    def _temperature_is_for_a_table(self) -> Self:
        if self.temperature is not None and all(table.over != "temperature" for table in self.by_state.values()):
            raise Refusal(f'{self.TABLE}.temperature is for numbers over = "temperature": leave it out')
        return self

    @model_validator(mode="after")
    def _map_is_there(self, info: ValidationInfo) -> Self:
        folder = folder_of(info)
        if folder is not None and self.gap_map is not None:
            user_file(folder, self.gap_map, f"{self.TABLE}.gap_map")
        return self

    def opening(self, folder: Path) -> np.ndarray | None:
        """Rows x, y, z, opening (k, 4) [m] of its gap map in `folder`, None without a map."""
        if self.gap_map is None:
            return None
        rows = np.array(rows_of(user_file(folder, self.gap_map, f"{self.TABLE}.gap_map")))
        rows = rows[np.isfinite(rows).all(axis=1)]
        if rows.shape[1:] != (4,) or len(rows) < 4:
            raise Refusal(f"{self.TABLE}.gap_map: expected four rows or more of x, y, z, opening in '{self.gap_map}'")
        return rows

    @property
    def has_derived_stiffness(self) -> bool:
        """Whether the stiffness follows from a punch, or from the numbers of the law."""
        return self.punch is not None or super().has_derived_stiffness

    @property
    def groups(self) -> tuple[str, ...]:
        """The faces."""
        return (self.group,) if isinstance(self.group, str) else self.group

    @property
    def meets_next(self) -> bool:
        """Whether it is a contact of neighbouring sectors of a wheel."""
        if self.sector is not None or self.opposite is None:
            return self.sector == "next"
        first, second = (name.rpartition(".")[0].split(".")[0] for name in (self.groups[0], self.opposite))
        return first == second


class SyntheticPair(Table, stage=CONTACT):
    """A made-up pair of faces, see geometry.height_map.synthetic_pair."""

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


class Surfaces(Table, stage=CONTACT):
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
    shortest: Annotated[Length, Field(gt=0)] | None = None
    """Wavelength below which waves are noise of the instrument, where a law takes its asperities from the faces."""
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
            raise Refusal("expected either first, and perhaps second, or synthetic")
        if self.axes[0][-1] == self.axes[1][-1]:
            raise Refusal(f"expected axes along t1 and t2, got {list(self.axes)}")
        return self
