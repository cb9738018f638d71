"""Kinds of values in a scene file: quantities with units, directions, tables, and the sentence on an unknown key.

A field carries the stage of a run that reads it first, and other marks, in its metadata. Cached parts and reductions,
resumption, derivatives and parameter variation follow from these marks."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Annotated, Any, ClassVar, get_args

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic.fields import FieldInfo

from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.units import to_si


class SceneStage(IntEnum):
    """Stages in the order in which they run; a change of a field leaves the outcome of all earlier ones as it is."""

    PART = 1
    REDUCTION = 2
    CONTACT = 3
    LOADS = 4
    SOLVE = 5
    WEAR = 6
    STUDY = 7  # errors of the finished result, and studies of the same model
    DRAW = 8  # pictures, titles, and how a result is reported


class Mark(Enum):
    """What else a field may say of itself.

    RESUMABLE : a run may be resumed with another value
    SMOOTH : the response depends on it smoothly, so that it has derivatives"""

    RESUMABLE = "resumable"
    SMOOTH = "smooth"


PART, REDUCTION, CONTACT, LOADS, SOLVE, WEAR, STUDY, DRAW = SceneStage
RESUMABLE, SMOOTH = Mark


def stage_of(field: FieldInfo) -> SceneStage | None:
    """The stage in the metadata of a field; None for one that holds tables, whose fields have theirs."""
    return next((mark for mark in marks_of(field) if isinstance(mark, SceneStage)), None)


def marks_of(field: FieldInfo) -> list[Any]:
    """All that a field carries in its metadata."""
    return [*field.metadata, *_inner_metadata(field.annotation)]


def _inner_metadata(annotation: Any) -> list[Any]:
    """Metadata inside a type, as in `Annotated[float, SOLVE] | None`."""
    inner = [mark for part in get_args(annotation) for mark in _inner_metadata(part)]
    return [*getattr(annotation, "__metadata__", ()), *inner]


IN_UNIT = "in_unit"  # attribute of the validator of a quantity
PARAMETERS = "parameters"  # field in which a table gathers the keys that its part declares


class Table(BaseModel):
    """A table of the scene file: nothing may be added to it, nothing changed.

    The text below a key is its meaning; the list of keys in the documentation is made from it. The documentation reads
    it from the source: to let pydantic do so costs every command half a second.

    Every field of a scene declares the stage that reads it first: `key: Annotated[Length, CONTACT]`. A class keyword,
    `class Surfaces(Table, stage=CONTACT)`, marks all fields that declare none. Fields that hold tables need none."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    NUMBERS_STAGE: ClassVar[SceneStage] = PART
    """The stage that reads the numbers first which a law or a part declares as its own."""

    def __init_subclass__(cls, *, stage: SceneStage | None = None, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)

    @classmethod
    def __pydantic_init_subclass__(cls, *, stage: SceneStage | None = None, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        for field in cls.model_fields.values() if stage is not None else ():
            if stage_of(field) is None and not holds_tables(field.annotation):
                field.metadata = [*field.metadata, stage]

    @property
    def numbers(self) -> dict[str, Any]:
        """The numbers that a law or a part declares as its own."""
        return {}

    @property
    def usual_ranges(self) -> dict[str, UsualRange]:
        """The usual range of each of these numbers that declares one."""
        return {}

    @model_validator(mode="before")
    @classmethod
    def _only_known_keys(cls, table: Any) -> Any:
        """Runs after those of a table itself, which may take other keys."""
        if isinstance(table, dict) and cls.model_config.get("extra") == "forbid":
            for key in table:
                if key not in cls.model_fields:
                    raise UnknownKey(key, list(cls.model_fields))
        return table


def holds_tables(annotation: Any) -> bool:
    """Whether a type is that of a table, or of a dict, a list or alternatives with one."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return True
    return any(holds_tables(part) for part in get_args(annotation))


class UnknownKey(Refusal):
    """A key that a table does not have; names : those that it has."""

    def __init__(self, key: str, names: list[str]):
        super().__init__(unknown_key(key, names))
        self.key, self.names = key, names


@dataclass(frozen=True)
class Quantity(BeforeValidator):
    """Mark of a key that takes a text with a unit; the documentation reads the unit from it."""

    unit: str = ""


def quantity(unit: str) -> Quantity:
    """Validator that turns a text with a unit, or a bare number, into a float counted in `unit`."""

    def in_unit(value: object) -> float:
        return to_si(value, unit)

    setattr(in_unit, IN_UNIT, unit)  # pydantic keeps the function and no mark, and the JSON schema needs the unit
    return Quantity(in_unit, unit=unit)


@dataclass(frozen=True)
class UsualRange:
    """Mark of a field whose numbers usually lie between low and high, in its unit: one outside is noted.

    What cannot be at all is refused by the limits of the field itself."""

    low: float
    high: float
    unit: str = ""

    def remarks(self, key: str, value: Any) -> list[str]:
        """A sentence where a number, or an entry of a tuple of numbers, lies outside; key : what has the value."""
        entries = value if isinstance(value, list | tuple) else [value]
        outside = [entry for entry in entries if isinstance(entry, float) and not self.low <= entry <= self.high]
        if not outside:
            return []
        unit = f" {self.unit}" if self.unit else ""
        usual = f"{self.low:g} to {self.high:g}{unit}"
        return [f"{key} = {outside[0]:.4g}{unit} is unusual ({usual}): check it and its unit"]


Length = Annotated[float, quantity("m")]
Force = Annotated[float, quantity("N"), UsualRange(-1e9, 1e9, "N")]
Pressure = Annotated[float, quantity("Pa"), UsualRange(-1e10, 1e10, "Pa")]
Stiffness = Annotated[float, quantity("N/m")]
Frequency = Annotated[float, quantity("Hz"), Field(lt=1e8), UsualRange(0.0, 1e6, "Hz")]
TemperatureChange = Annotated[float, quantity("K"), UsualRange(-500.0, 2000.0, "K")]
Acceleration = Annotated[float, quantity("m/s2"), UsualRange(-1e5, 1e5, "m/s2")]
Angle = Annotated[float, quantity("rad")]
Number = Annotated[float, quantity("")]


def parsed_direction(value: object) -> tuple[float, float, float]:
    """An axis by its name, or three numbers, as a unit vector; raises ValueError."""
    named = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    if isinstance(value, str) and value.lstrip("+-") in named and len(value) <= 2:
        x, y, z = named[value[-1]]
        return (-x or 0.0, -y or 0.0, -z or 0.0) if value.startswith("-") else (x, y, z)
    numbers = isinstance(value, (list, tuple)) and all(type(c) in (int, float) for c in value)
    if isinstance(value, (list, tuple)) and numbers and len(value) == 3 and 0 < np.linalg.norm(value) < np.inf:
        x, y, z = (float(component) for component in np.asarray(value) / np.linalg.norm(value))
        return x, y, z
    raise Refusal(f'expected an axis such as "x" or "-z", or three numbers that are not all zero, got {value!r}')


Direction = Annotated[tuple[float, float, float], BeforeValidator(parsed_direction)]


def unknown_key(key: str, all_names: list[str]) -> str:
    """Clause about a key that does not exist, with the one that was probably meant and all that exist."""
    names = [name for name in all_names if name != PARAMETERS]
    close = difflib.get_close_matches(key.rpartition(".")[2], names, n=1)
    hint = f" (did you mean {close[0]}?)" if close else ""
    return f"unknown key {key}{hint}, known here: {', '.join(names)}"


def refuse_slips(keys: Iterable[str], needed: list[str], names: list[str]) -> None:
    """Raise ValueError where one of the given keys is a slip of the pen for one that is needed."""
    for key in keys:
        if key not in names and difflib.get_close_matches(key, needed, n=1):
            raise Refusal(unknown_key(key, [*needed, *(name for name in names if name not in needed)]))
