"""Tables of a scene about its part: geometry or mesh, and material."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, PrivateAttr, StrictInt, ValidationInfo, model_validator

from tribodyn.declarations import read
from tribodyn.geometry import parts
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.fields import PART, SMOOTH, Direction, Number, Table, UsualRange, quantity, refuse_slips
from tribodyn.workflows.scene.user_files import folder_of, is_user_file, numbers, optional_user_file, user_file


class Meshed(Table, stage=PART):
    """A part of geometry/ or a mesh file, and the groups that are held fixed.

    All other keys of the table are parameters of the part; those left out have the part's own defaults."""

    KEY: ClassVar[str] = "geometry."
    """What stands before its keys in a sentence."""

    part: str | None = None
    """Name of a parametric part; its parameters are further keys of this table."""
    mesh: str | None = None
    """Mesh file, relative to the scene file, instead of a part."""
    fixed: tuple[str, ...] = ()
    """Groups of the mesh that are clamped, by their own names."""
    fixed_axes: dict[str, str] = Field(default_factory=dict)
    """Groups held along some axes only: group = letters out of "xyz"."""
    halved: Annotated[StrictInt, Field(ge=0, le=3)] = 0
    """How many times every element is cut into eight of half the size, its shape kept."""
    parameters: dict[str, int | float] = Field(default_factory=dict)
    """Parameters of the part, gathered from the other keys of the table."""

    _user_file: Path | None = PrivateAttr(None)

    @model_validator(mode="before")
    @classmethod
    def _gather_parameters(cls, table: Any, info: ValidationInfo) -> Any:
        """Keys that the table does not have are gathered as parameters of the part."""
        if not isinstance(table, dict) or "parameters" in table:
            return table
        general = {key: value for key, value in table.items() if key in cls.model_fields}
        other = {key: value for key, value in table.items() if key not in cls.model_fields}
        if ("part" in general) == ("mesh" in general):
            refuse_slips(other, ["part", "mesh"], list(cls.model_fields))
            raise Refusal('expected either part = "name" or mesh = "file.msh", and not both')
        if not isinstance(general.get("part"), str):
            return general | other  # a mesh file has no parameters: the other keys are unknown ones
        return general | {"parameters": part_parameters(general["part"], other, folder_of(info), cls)}

    @model_validator(mode="after")
    def _remember_the_file(self, info: ValidationInfo) -> Self:
        self._user_file = optional_user_file(folder_of(info), self.part, f"{self.KEY}part")
        return self

    @property
    def numbers(self) -> dict[str, int | float]:
        return self.parameters

    @property
    def part_name(self) -> str | None:
        """The part for geometry.parts: its name, or the path of the file beside the scene."""
        return self.part if self._user_file is None else str(self._user_file)


class Geometry(Meshed, stage=PART):
    """A part of geometry/ or a mesh file, and the groups that are held fixed.

    All other keys of the table are parameters of the part; those left out have the part's own defaults."""

    no_turning: Direction | None = None
    """Axis about which the part as a whole cannot turn."""


def part_parameters(
    part: str, values_given: dict[str, Any], folder: Path | None = None, kind: type[Meshed] = Geometry
) -> dict[str, int | float]:
    """Parameters of a part in SI units: all of them, or those given to a file of one's own, which is not run here.

    values_given : key -> number or text with a unit; folder : of the scene
    kind : of the table, which has general keys too
    Raises  ValueError: no such part, unknown key, or a value that the part refuses"""
    general = [name for name in kind.model_fields if name != "parameters"]
    if is_user_file(part):
        if folder is None:
            raise Refusal(f'{kind.KEY}part: "{part}" is a file beside a scene, and this scene has no folder')
        return numbers(kind.KEY, read(user_file(folder, part, f"{kind.KEY}part")), values_given, general)
    values = numbers(kind.KEY, read(parts.file_of(part)), values_given, general)
    return asdict(parts.load(part).Parameters(**values))


Modulus = Annotated[float, quantity("Pa"), Field(gt=0), UsualRange(1e9, 1.3e12, "Pa")]
Expansion = Annotated[float, quantity("1/K"), UsualRange(-1e-5, 3e-4, "1/K")]
Poisson = Annotated[Number, UsualRange(0.0, 0.5)]
Density = Annotated[float, quantity("kg/m3"), Field(gt=0), UsualRange(100.0, 23_000.0, "kg/m3")]


class SolidMaterial(Table, stage=PART):
    """An isotropic material by single numbers, or an orthotropic one by three along its own axes."""

    young: Annotated[Modulus | tuple[Modulus, Modulus, Modulus], SMOOTH]
    """Young's modulus; three along the axes of an orthotropic material."""
    poisson: Annotated[Poisson, Field(gt=-1, lt=0.5)] | tuple[Poisson, Poisson, Poisson] = 0.3
    """Poisson's ratio; nu12, nu13, nu23 of an orthotropic material, the strain along the second axis when it is pulled
    along the first."""
    shear: tuple[Modulus, Modulus, Modulus] | None = None
    """Shear moduli G12, G13, G23 of an orthotropic material."""
    density: Annotated[Density, SMOOTH]
    """Density."""
    axes: tuple[Direction, Direction] | None = None
    """First and second axis of an orthotropic material; x and y by default."""
    expansion: Expansion | tuple[Expansion, Expansion, Expansion] = 0.0
    """Coefficient of thermal expansion; three along the axes of an orthotropic material."""
    elements: Literal["quadratic", "linear_reduced"] = "quadratic"
    """Elements of bodies of this material: the mesh's own, or eight linear hexahedra with reduced integration and
    hourglass stiffness on the nodes of each 27-node one, for comparison with models of such elements."""

    @model_validator(mode="after")
    def _one_kind(self) -> SolidMaterial:
        three = isinstance(self.young, tuple)
        if three != isinstance(self.poisson, tuple) or three != (self.shear is not None):
            raise Refusal("expected three values each of young, poisson and shear for an orthotropic material")
        if not three and (self.axes is not None or isinstance(self.expansion, tuple)):
            raise Refusal("expected axes and three expansions only with three values of young, poisson and shear")
        if three and self.elements != "quadratic":
            raise Refusal(f'expected no elements = "{self.elements}" with an orthotropic material')
        return self
