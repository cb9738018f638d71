"""Files beside a scene, and the numbers that laws, parts and continuations declare as their own.

A part, a contact law, a wear law and a continuation may each be a .py file in the scene's folder. Reading, planning and
showing a scene read the text of such a file and never run it; running the scene does.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationInfo

from tribodyn.declare import Number, read
from tribodyn.workflows.scene.units import to_si
from tribodyn.workflows.scene.words import unknown_key

ANY_UNIT = ("m", "rad", "")  # what a number without a declared unit may be given in


def is_file(name: str) -> bool:
    """Whether a name is that of a file of one's own."""
    return name.endswith(".py")


def beside(folder: Path, name: str, key: str) -> Path:
    """The file of one's own that a scene names; raises ValueError where it is not in the scene's own folder.

    folder : of the scene; key : of the scene, such as "contact.law", for the sentence
    """
    path = Path(name)
    resolved = (folder / path).resolve()
    if path.is_absolute() or len(path.parts) != 1 or resolved.parent != folder.resolve():
        raise ValueError(f'{key}: "{name}" is not in the scene\'s folder: put the file beside the scene, name it alone')
    if not resolved.is_file():
        raise ValueError(f'{key}: there is no file "{name}" beside the scene')
    return resolved


def numbers(
    table: str, declared: Iterable[Number], given: Mapping[str, Any], others: Iterable[str]
) -> dict[str, int | float]:
    """The own numbers of a law, a part or a continuation out of a table of a scene, in SI units.

    table : its key, such as "contact"; given : what the table has besides `others`, its general keys
    Raises  ValueError: one is unknown, missing, not in its unit or out of its limits; says which there are
    """
    known = {number.name: number for number in declared}
    found: dict[str, int | float] = {}
    for name, value in given.items():
        if name not in known:
            raise ValueError(unknown_key(f"{table}.{name}", [*others, *known]))
        found[name] = _in_si(f"{table}.{name}", known[name], value)
    for name, number in known.items():
        if number.needed and name not in found:
            raise ValueError(f"{table}.{name} is missing: its numbers here are {', '.join(known)}")
    return found


def _in_si(key: str, number: Number, value: Any) -> int | float:
    if number.whole:
        if type(value) is not int:
            raise ValueError(f"{key}: expected a whole number, got {value!r}")
        return value
    if number.unit is None:
        for unit in ANY_UNIT:
            try:
                return to_si(value, unit)
            except ValueError:
                continue
        raise ValueError(f"{key}: expected a length, an angle or a number, got {value!r}")
    try:
        converted = to_si(value, number.unit)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None
    fault = number.fault(converted)
    if fault:
        raise ValueError(f"{key}: {fault}")
    return converted




def with_own_numbers(
    table: Any, key: str, fields: Iterable[str], default: str, laws: Any, folder: Path | None
) -> Any:
    """A raw table of a scene with the own numbers of its law checked and in SI units.

    key : of the table; fields : its general keys; default : law where it names none
    laws : module with `file_of(name)`, such as hbm.law; folder : of the scene; None for a table that was checked before
    """
    if folder is None or not isinstance(table, dict):
        return table
    general = {name: value for name, value in table.items() if name in fields}
    given = {name: value for name, value in table.items() if name not in fields}
    law = general.get("law", default)
    if not isinstance(law, str):
        return general  # the table itself says what a law is
    path = beside(folder, law, f"{key}.law") if is_file(law) else laws.file_of(law)
    return general | numbers(key, read(path), given, fields)


def folder_of(info: ValidationInfo) -> Path | None:
    """The folder of the scene that is being read; None where a result's scene is read back, which was checked before."""
    folder: Path | None = (info.context or {}).get("folder")
    return folder
