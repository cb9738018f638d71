"""Tables of a scene about its part: geometry or mesh, and material."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import (
    Field,
    PrivateAttr,
    StrictInt,
    ValidationInfo,
    model_validator,
)

from tribodyn.declare import read
from tribodyn.geometry import parts
from tribodyn.workflows.scene.fields import (
    Direction,
    Number,
    Table,
    quantity,
    refuse_slips,
)
from tribodyn.workflows.scene.own import beside, folder_of, is_file, numbers, own_file


class Geometry(Table):
    """A part of geometry/ or a mesh file, and the groups that are held fixed.

    All other keys of the table are parameters of the part; those left out have the part's own defaults.
    """

    part: str | None = None
    """Name of a parametric part; its parameters are further keys of this table."""
    mesh: str | None = None
    """Mesh file of second order, relative to the scene file, instead of a part."""
    fixed: tuple[str, ...] = ()
    """Groups of the mesh that are clamped."""
    fixed_axes: dict[str, str] = Field(default_factory=dict)
    """Groups held along some axes only: group = letters out of "xyz"."""
    no_turning: Direction | None = None
    """Axis about which the part as a whole cannot turn."""
    halved: Annotated[StrictInt, Field(ge=0, le=3)] = 0
    """How many times every element is cut into eight of half the size, its shape kept."""
    parameters: dict[str, int | float] = Field(default_factory=dict)
    """Parameters of the part, gathered from the other keys of the table."""

    @model_validator(mode="before")
    @classmethod
    def _gather_parameters(cls, table: Any, info: ValidationInfo) -> Any:
        return gathered(cls, table, folder_of(info))

    _own: Path | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _remember_the_file(self, info: ValidationInfo) -> Self:
        self._own = own_file(folder_of(info), self.part, "geometry.part")
        return self

    @property
    def part_name(self) -> str | None:
        """The part for geometry.parts: its name, or the path of the file beside the scene."""
        return self.part if self._own is None else str(self._own)


def gathered(kind: type[Table], table: Any, folder: Path | None) -> Any:
    """A table with a part or a mesh whose keys that its kind does not have are gathered as parameters of the part."""
    if not isinstance(table, dict) or "parameters" in table:
        return table
    own = {key: value for key, value in table.items() if key in kind.model_fields}
    other = {key: value for key, value in table.items() if key not in kind.model_fields}
    if ("part" in own) == ("mesh" in own):
        refuse_slips(other, ["part", "mesh"], list(kind.model_fields))
        raise ValueError('expected either part = "name" or mesh = "file.msh", and not both')
    if not isinstance(own.get("part"), str):
        return own | other  # a mesh file has no parameters: the other keys are unknown ones
    return own | {"parameters": part_parameters(own["part"], other, folder, kind)}


def part_parameters(
    part: str, given: dict[str, Any], folder: Path | None = None, kind: type[Table] = Geometry
) -> dict[str, int | float]:
    """Parameters of a part in SI units: all of them, or those given to a file of one's own, which is not run here.

    given : key -> number or text with a unit; folder : of the scene; kind : of the table, which has general keys too
    Raises  ValueError: no such part, unknown key, or a value that the part refuses
    """
    general = [name for name in kind.model_fields if name != "parameters"]
    if is_file(part):
        if folder is None:
            raise ValueError(f'geometry.part: "{part}" is a file beside a scene, and this scene has no folder')
        return numbers("geometry", read(beside(folder, part, "geometry.part")), given, general)
    values = numbers("geometry", read(parts.file_of(part)), given, general)
    return asdict(parts.load(part).Parameters(**values))


class MaterialTable(Table):
    """Linear isotropic elasticity and density."""

    young: Annotated[float, quantity("Pa"), Field(gt=0)]
    """Young's modulus."""
    density: Annotated[float, quantity("kg/m3"), Field(gt=0)]
    """Density."""
    poisson: Annotated[Number, Field(gt=-1, lt=0.5)] = 0.3
    """Poisson's ratio."""
    expansion: Annotated[float, quantity("1/K")] = 0.0
    """Coefficient of thermal expansion."""
