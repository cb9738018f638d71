"""Python files of a user beside his scene, and the numbers that laws, parts and continuations declare.

A part, a contact law, a wear law, a wear rule and a continuation may each be a .py file in the folder of the scene.
Reading, planning and showing a scene read the text of such a file and never run it; running the scene does."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import ConfigDict, Field, PrivateAttr, ValidationError, ValidationInfo, model_validator

from tribodyn.declarations import Number, Role, name_of, read
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.fields import WEAR, Table, UnknownKey, UsualRange, unknown_key
from tribodyn.workflows.scene.units import to_si

ANY_UNIT = ("m", "rad", "")  # units that a number without a declared unit may have


def is_user_file(name: str) -> bool:
    """Whether a name is that of a user's file."""
    return name.endswith(".py")


def user_file(folder: Path, name: str, key: str) -> Path:
    """The user's file that a scene names; refuses one that is not in the folder of the scene.

    folder : of the scene; key : of the scene, such as "contact.law", for the sentence"""
    path = Path(name)
    resolved = (folder / path).resolve()
    if path.is_absolute() or len(path.parts) != 1 or resolved.parent != folder.resolve():
        raise Refusal(f'{key}: "{name}" is not in the scene\'s folder: put the file beside the scene, name it alone')
    if not resolved.is_file():
        raise Refusal(f'{key}: there is no file "{name}" beside the scene')
    return resolved


def numbers(
    table: str, declared: Iterable[Number], values: Mapping[str, Any], general: Iterable[str]
) -> dict[str, int | float]:
    """The numbers of a law, a part or a continuation from a table of a scene, in SI units.

    table : its key with a dot, such as "contact."; values : what the table has besides its `general` keys
    Raises  Refusal: one is unknown, missing, not in its unit or out of its limits; lists those that there are"""
    by_name = {number.name: number for number in declared}
    result: dict[str, int | float] = {}
    for name, value in values.items():
        if name not in by_name:
            raise Refusal(unknown_key(f"{table}{name}", [*general, *by_name]))
        result[name] = in_si(f"{table}{name}", by_name[name], value)
    for name, number in by_name.items():
        if number.required and name not in result:
            raise Refusal(f"{table}{name} is missing: its numbers here are {', '.join(by_name)}")
    return result


def in_si(key: str, number: Number, value: Any) -> int | float:
    """A value of a declared number in SI units; key : of the scene, for sentences."""
    if number.integer and type(value) is not int:
        raise Refusal(f"{key}: expected a whole number, got {value!r}")
    converted = value if number.integer else _converted(key, number, value)
    if fault := number.fault(converted):
        raise Refusal(f"{key}: {fault}")
    return converted


def _converted(key: str, number: Number, value: Any) -> float:
    """A value in the declared unit; without one, a length, an angle or a dimensionless number."""
    if number.unit is not None:
        try:
            return to_si(value, number.unit)
        except Refusal as error:
            raise Refusal(f"{key}: {error}") from None
    for unit in ANY_UNIT:
        try:
            return to_si(value, unit)
        except Refusal:
            continue
    raise Refusal(f"{key}: expected a length, an angle or a number, got {value!r}")


def folder_of(info: ValidationInfo) -> Path | None:
    """The folder of the scene that is read; None for the scene of a result, which was checked before."""
    folder: Path | None = (info.context or {}).get("folder")
    return folder


def optional_user_file(folder: Path | None, name: str | None, key: str) -> Path | None:
    """The user's file that a key names; None where it names none, or the scene is that of a result."""
    return None if folder is None or name is None or not is_user_file(name) else user_file(folder, name, key)


STATES = {"depth": "m", "energy_density": "J/m2", "temperature": "K"}  # of a contact, with their units


class StateTable(Table, stage=WEAR):
    """A number over the state of a contact, in the place of the number: linear between rows."""

    over: Literal["depth", "energy_density", "temperature"]
    """Wear depth of a pair, friction work per area that it has done, or temperature change of the contact."""
    at: tuple[float, ...] = Field(min_length=1)
    """States, ascending."""
    values: tuple[float, ...]
    """The number at each."""

    @classmethod
    def read(cls, key: str, number: Number, table: Mapping[str, Any]) -> Self:
        """A table as it stands in the file, in SI units; key : of the scene, for sentences."""
        unit = STATES.get(str(table.get("over")))
        at, values = table.get("at"), table.get("values")
        if unit is not None and isinstance(at, list | tuple) and isinstance(values, list | tuple):
            at = [in_si(f"{key}.at", Number("at", unit), value) for value in at]
            table = {**table, "at": at, "values": [in_si(f"{key}.values", number, value) for value in values]}
        try:
            return cls.model_validate(table)
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(str(part) for part in (key, *first["loc"]))
            raise Refusal(f"{place}: {first['msg'].removeprefix('Value error, ')}") from None

    @model_validator(mode="after")
    def _rows(self) -> Self:
        if any(np.diff(self.at) <= 0) or len(self.values) != len(self.at):
            raise Refusal("expected states `at` in ascending order, and one of `values` for each")
        if self.over != "temperature" and (self.at[0] < 0 or min(self.values) <= 0):
            raise Refusal("expected states of at least 0 and values above 0")
        return self

    def start(self, temperature: float) -> float:
        """The number before any wear, at a change of temperature [K]; refuses one beyond the rows."""
        at = temperature if self.over == "temperature" else 0.0
        if self.over == "temperature" and not self.at[0] <= at <= self.at[-1]:
            ends = f"{self.at[0]:g} to {self.at[-1]:g} K"
            raise Refusal(f"the contact is at {at:g} K, but its table goes from {ends}: extend it")
        return float(np.interp(at, self.at, self.values))


class LawTable(Table):
    """A table that names a law; the numbers of the law are further keys of it."""

    model_config = ConfigDict(extra="allow")
    TABLE: ClassVar[str]
    """Its key in a scene."""
    LAWS: ClassVar[ModuleType]
    """Module that finds the file of a law of the package by `file_of(name)`."""
    OTHERS: ClassVar[tuple[Number, ...]] = ()
    """Numbers of the table itself that may be tables over a state, too."""

    law: str
    by_state: dict[str, StateTable] = Field(default_factory=dict)
    """Tables over a state that stand in the file in the place of numbers."""
    _user_file: Path | None = PrivateAttr(None)

    @model_validator(mode="before")
    @classmethod
    def _own_numbers(cls, table: Any, info: ValidationInfo) -> Any:
        folder, fields = folder_of(info), cls.model_fields
        if folder is None or not isinstance(table, dict):
            return table
        if "by_state" in table:
            raise UnknownKey("by_state", [name for name in fields if name != "by_state"])
        if isinstance(table.get("law", ""), str):
            table = cls._with_starts(table, folder)
        general = {name: value for name, value in table.items() if name in fields}
        values = {name: value for name, value in table.items() if name not in fields}
        if not isinstance(general.get("law", ""), str):
            return general  # refused by the field itself
        return general | numbers(f"{cls.TABLE}.", cls.declared_numbers(general, folder), values, fields)

    @classmethod
    def _with_starts(cls, table: dict[str, Any], folder: Path) -> dict[str, Any]:
        """A table as it stands in the file with its tables over a state apart, and the numbers before any wear."""
        declared = {number.name: number for number in (*cls.declared_numbers(table, folder), *cls.OTHERS)}
        tables = {
            name: StateTable.read(f"{cls.TABLE}.{name}", declared[name], value)
            for name, value in table.items()
            if name in declared and isinstance(value, Mapping) and "over" in value
        }
        temperature = to_si(table.get("temperature", 0.0), "K") if tables else 0.0
        for name, state in tables.items():
            if state.over == "temperature" and "temperature" not in cls.model_fields:
                raise Refusal(f'{cls.TABLE}.{name}.over: expected "depth" or "energy_density"')
            try:
                table = {**table, name: state.start(temperature)}
            except Refusal as error:
                raise Refusal(f"{cls.TABLE}.{name}: {error}") from None
        return {**table, "by_state": tables} if tables else table

    @classmethod
    def declared_numbers(cls, table: Mapping[str, Any], folder: Path) -> tuple[Number, ...]:
        """The numbers that the law of a table, as it stands in the scene's file, declares."""
        law = table.get("law", cls.model_fields["law"].default)
        return read(user_file(folder, law, f"{cls.TABLE}.law") if is_user_file(law) else cls.LAWS.file_of(law))

    @model_validator(mode="after")
    def _remember_the_file(self, info: ValidationInfo) -> Self:
        self._user_file = optional_user_file(folder_of(info), self.law, f"{self.TABLE}.law")
        return self

    @property
    def law_name(self) -> str:
        """Name of the law for hbm: that of a shipped law, or the path of the user's file."""
        return self.law if self._user_file is None else str(self._user_file)

    @property
    def _declared(self) -> tuple[Number, ...]:
        """What the law declares; nothing where it is a user's file that is not beside this result."""
        is_absent = is_user_file(self.law) and self._user_file is None
        return () if is_absent else read(self.LAWS.file_of(self.law_name))

    def number(self, role: Role) -> float | None:
        """The law's number with a role, None where it has none."""
        return self.numbers.get(name_of(role, self._declared) or "")

    @property
    def usual_ranges(self) -> dict[str, UsualRange]:
        return {number.name: UsualRange(*number.usual, number.unit or "") for number in self._declared if number.usual}

    @property
    def numbers(self) -> dict[str, float]:
        return dict(self.model_extra or {})
