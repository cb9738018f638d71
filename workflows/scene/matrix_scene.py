"""A scene whose model is matrices from a file: no geometry, no mesh; contacts, loads and responses are DOF lists.

A DOF is a number from 0, or [node, component] where the file carries labels. What is long may stand in the file with
the matrices (.npz, .mat): {variable = "name"} in place of a list."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, StrictInt, model_validator

from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.contact import ContactTable
from tribodyn.workflows.scene.fields import LOADS, PART, SMOOTH, Direction, Force, Number, Quantity, Table
from tribodyn.workflows.scene.load_tables import Loads, Vibrates
from tribodyn.workflows.scene.schema import Scene
from tribodyn.workflows.scene.solution_tables import Reduction, Response
from tribodyn.workflows.scene.units import to_si

Dof = int | tuple[int, int | str]


class Variable(Table, stage=PART):
    """A named array of the file that holds the matrices."""

    variable: str
    """Its name in the file."""


def _dof(value: object) -> Dof:
    if type(value) is int:
        return value
    if isinstance(value, (list, tuple)) and len(value) == 2 and type(value[0]) is int and type(value[1]) in (int, str):
        return value[0], value[1]
    raise Refusal(f'expected a DOF, such as 17 or [node, "z"], got {value!r}')


def _listed(value: object, item: Any, example: str) -> Any:
    if not isinstance(value, (list, tuple)) or not value:
        raise Refusal(f"expected a list such as {example}, got {value!r}")
    return tuple(item(entry) for entry in value)


def _dofs(value: object) -> tuple[Dof, ...]:
    return tuple(_listed(value, _dof, '[17] or [[12, "z"], [13, "z"]]'))


def _rows(value: object) -> Any:
    if isinstance(value, (dict, Variable)):
        return value
    return _listed(value, _dofs, "[[3, 4, 5], [6, 7, 8]], one row for each pair")


def per_pair(unit: str) -> Quantity:
    """Validator of a quantity that is one for all pairs, a list with one for each, or a variable of the file."""

    def convert(value: object) -> Any:
        if isinstance(value, (dict, Variable)):
            return value
        if isinstance(value, (list, tuple)):
            return tuple(to_si(entry, unit) for entry in value)
        return to_si(value, unit)

    return Quantity(convert, unit=unit)


class MatrixFiles(Table, stage=PART):
    """The files with the matrices, as reduction.foreign.read_matrices takes them."""

    file: str | None = None
    """One file that holds all, as M, K and, if present, C."""
    mass: str | None = None
    """File of the mass matrix."""
    stiffness: str | None = None
    """File of the stiffness matrix."""
    damping: str | None = None
    """File of the damping matrix."""
    mapping: str | None = None
    """ANSYS .mapping file that labels the rows."""
    names: dict[str, str] = Field(default_factory=dict)
    """Other names of the variables, such as {mass = "Mred"}."""
    scale: Annotated[Number, Field(gt=0)] = 1.0
    """Factor on all matrices to reach SI."""

    @model_validator(mode="after")
    def _complete(self) -> MatrixFiles:
        if self.file is None and (self.mass is None or self.stiffness is None):
            raise Refusal('expected file = "part.npz", or mass and stiffness with one file each')
        return self


class DofContact(ContactTable, stage=PART):
    """DOFs that touch, pair by pair, each other or the ground."""

    dofs: Annotated[tuple[tuple[Dof, ...], ...] | Variable, BeforeValidator(_rows), PART]
    """A row for each pair: its DOFs t1, t2, n as `components` says, or x, y, z where `normal` is given."""
    opposite: Annotated[tuple[tuple[Dof, ...], ...] | Variable, BeforeValidator(_rows), PART] | None = None
    """DOFs that they touch, in the same form; the ground by default."""
    area: Annotated[float | tuple[float, ...] | Variable, per_pair("m2"), PART]
    """Area of the patch, shared equally, or of each pair."""
    gap: Annotated[float | tuple[float, ...] | Variable, per_pair("m"), PART] = 0.0
    """Initial gap, one for all pairs or one for each."""
    normal: Direction | None = None
    """Direction in which the pairs close, for DOFs along x, y, z."""
    t1: Direction | None = None
    """Direction of the first tangential component."""
    signs: tuple[StrictInt, ...] | None = None
    """Signs of the components."""
    points: Variable | None = None
    """Position of each pair, for maps."""


class DofOutput(Table, stage=PART):
    """A displacement that is observed: the mean of DOFs, or a row of factors."""

    dofs: Annotated[tuple[Dof, ...], BeforeValidator(_dofs)] | None = None
    """DOFs whose mean is observed, or that share a force."""
    vector: Variable | None = None
    """A row of factors of the file instead."""

    @model_validator(mode="after")
    def _one_kind(self) -> DofOutput:
        if (self.dofs is None) == (self.vector is None):
            raise Refusal('expected either dofs = [17] or vector = {variable = "name"}')
        return self


class DofLoad(DofOutput):
    """A force that does not change: shared equally by DOFs, or times a vector of factors."""

    value: Annotated[Force, LOADS, SMOOTH]
    """The force."""

    @property
    def amplitude(self) -> float:
        """Its size [N]."""
        return self.value


class HarmonicDofLoad(Vibrates, DofLoad):
    """A load that goes as cos(harmonic * w t + phase)."""


class DofResponse(Response, DofOutput):
    """The displacement whose response is computed."""

    others: dict[str, DofOutput] = Field(default_factory=dict)
    """Displacements observed besides, by name."""


class MatrixScene(Scene):
    """Which matrices, contact, loads, response and wear are modelled; without reduction they stay as they are."""

    model: MatrixFiles
    """The matrix files."""
    contact: DofContact
    """The contact and its law."""
    loads: Loads[DofLoad, HarmonicDofLoad]
    """The loads."""
    response: DofResponse
    """The response that is computed."""
    reduction: Reduction | None = None
    """Craig-Bampton reduction; left out, the matrices stay as they are."""

    @property
    def joints(self) -> dict[str, DofContact]:
        return {"contact": self.contact}
