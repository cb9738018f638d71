"""Python files of a user beside his scene, and the numbers that laws, parts and continuations declare.

A part, a contact law, a wear law, a wear rule and a continuation may each be a .py file in the folder of the scene.
Reading, planning and showing a scene read the text of such a file and never run it; running the scene does."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar, Self

from pydantic import ConfigDict, PrivateAttr, ValidationInfo, model_validator

from tribodyn.declarations import Number, Role, name_of, read
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.fields import Table, UsualRange, unknown_key
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

    table : its key with a dot, such as "contact."; given : what the table has besides `others`, its general keys
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


class LawTable(Table):
    """A table that names a law; the numbers of the law are further keys of it."""

    model_config = ConfigDict(extra="allow")
    TABLE: ClassVar[str]
    """Its key in a scene."""
    LAWS: ClassVar[ModuleType]
    """Module that finds the file of a law of the package by `file_of(name)`."""

    law: str
    _user_file: Path | None = PrivateAttr(None)

    @model_validator(mode="before")
    @classmethod
    def _own_numbers(cls, table: Any, info: ValidationInfo) -> Any:
        folder, fields = folder_of(info), cls.model_fields
        if folder is None or not isinstance(table, dict):
            return table
        general = {name: value for name, value in table.items() if name in fields}
        values = {name: value for name, value in table.items() if name not in fields}
        if not isinstance(general.get("law", ""), str):
            return general  # refused by the field itself
        return general | numbers(f"{cls.TABLE}.", cls.declared_numbers(general, folder), values, fields)

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
