"""Numbers of a contact that follow from its temperature, or from the measured faces that a scene names."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from tribodyn import declarations
from tribodyn.declarations import Role
from tribodyn.hbm.contact import contact_law
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.contact import ByTemperature, ContactTable, Surfaces
from tribodyn.workflows.scene.fields import Table, TemperatureChange, unknown_key
from tribodyn.workflows.scene.user_files import in_si, is_user_file

if TYPE_CHECKING:  # most scenes name no faces and start sooner without
    from tribodyn.geometry.height_map import HeightMap


class _TemperatureKeys(Table):
    temperature: TemperatureChange | None = None
    by_temperature: ByTemperature


class _HeatedLoad(Table):
    temperature: TemperatureChange


def with_numbers_by_temperature(
    key: str, contact: Mapping[str, Any], static: Any, folder: Path | None
) -> dict[str, Any]:
    """The table of a contact as it stands in the file, with the numbers of its temperature.

    key : of the contact; static : the table of the static loads
    folder : of the scene, None for the scene of a result, whose numbers are in SI units
    Raises  Refusal where its temperature is not known or a number is given twice"""
    table = {name: contact[name] for name in ("temperature", "by_temperature") if name in contact}
    if folder is not None and isinstance(table["by_temperature"], Mapping):
        table["by_temperature"] = _in_si(f"{key}.by_temperature", table["by_temperature"], contact, folder)
    try:
        read = _TemperatureKeys.model_validate(table)
    except ValidationError as error:  # before the numbers that it should have given are missed
        first = error.errors()[0]
        where = ".".join(str(part) for part in (key, *first["loc"]))
        raise Refusal(f"{where}: {first['msg'].removeprefix('Value error, ')}") from None
    try:
        values = read.by_temperature.at(_mean_change(contact, static) if read.temperature is None else read.temperature)
    except Refusal as error:
        raise Refusal(f"{key}: {error}") from None
    # a scene that was written out has the numbers beside the table
    repeated = [name for name, value in values.items() if contact.get(name, value) not in (None, value)]
    if repeated:
        raise Refusal(f"{key}.{repeated[0]}: by_temperature gives it too: leave one of them out")
    return {**contact, **table, **values}


def _in_si(key: str, table: Mapping[str, Any], contact: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """A table by temperature whose numbers of the law are in SI units."""
    general, law = ByTemperature.model_fields, contact.get("law", "")
    if not isinstance(law, str):
        return dict(table)  # refused where the contact is read
    declared = {number.name: number for number in ContactTable.declared_numbers(contact, folder)}
    result = dict(table)
    for name, values in table.items():
        if name in general:
            continue
        if name not in declared:
            raise Refusal(unknown_key(f"{key}.{name}", [*general, *declared]))
        if not isinstance(values, list | tuple):
            raise Refusal(f"{key}.{name}: expected a list with one value for each temperature, got {values!r}")
        result[name] = [in_si(f"{key}.{name}", declared[name], value) for value in values]
    return result


def _mean_change(contact: Mapping[str, Any], static: Any) -> float:
    """Mean change of temperature of its two bodies by the static loads [K]."""
    faces = [contact.get(name) for name in ("first", "second", "group", "opposite")]
    bodies = {str(face).partition(".")[0] for face in faces if isinstance(face, str) and face != "ground"}
    changes = dict.fromkeys(bodies, 0.0)
    for load in static.values() if isinstance(static, Mapping) else ():
        if not isinstance(load, Mapping) or not {"temperature", "field"} & set(load):
            continue
        if "field" in load:
            raise Refusal("a field of temperatures heats its bodies: give the contact's own temperature")
        try:
            change = _HeatedLoad.model_validate({"temperature": load["temperature"]}).temperature
        except ValidationError:  # reported where the load is read
            continue
        for body in bodies & set(load.get("bodies", bodies)):
            changes[body] += change
    return sum(changes.values()) / len(changes)


def faces(surfaces: Surfaces, folder: Path) -> list[HeightMap]:
    """The face of body 1, and that of body 2 unless it is flat, in the same coordinates."""
    from tribodyn.geometry import height_map_files
    from tribodyn.geometry.height_map import mirrored, synthetic_pair

    if surfaces.synthetic is not None:
        s = surfaces.synthetic
        pair = synthetic_pair(s.seed, s.size, ridge=s.ridge, waviness=s.waviness, roughness=s.roughness)
        return list(pair)
    maps = [
        height_map_files.read(
            folder / name,
            spacing=surfaces.spacing,
            lateral_unit=surfaces.lateral_unit,
            height_unit=surfaces.height_unit,
        )
        for name in (surfaces.first, surfaces.second)
        if name is not None
    ]
    return [*maps[:1], *(mirrored(face, surfaces.mirror) if surfaces.mirror else face for face in maps[1:])]


def needs_asperities(contact: Any) -> bool:
    """Whether a contact, as it stands in the file, has its table of asperities from the measured faces."""
    name = contact.get("law") if isinstance(contact, Mapping) else None
    if not isinstance(name, str) or is_user_file(name) or "table" in contact:
        return False
    try:
        return declarations.constant(contact_law.file_of(name), "TABLE") is not None
    except Refusal:  # no such law: reported where the contact is read
        return False


def with_asperities(contact: Mapping[str, Any], surfaces: Surfaces, folder: Path) -> dict[str, Any]:
    """A contact as it stands in the file with the table and, where it has none, the radius of the measured faces.

    Raises  Refusal where the faces have no asperities to count"""
    try:
        radius, table = _asperities(surfaces, folder)
    except (Refusal, OSError) as error:
        raise Refusal(f"surfaces: no asperities for the law '{contact['law']}': {error}") from None
    name = declarations.name_of(Role.ASPERITY_RADIUS, contact_law.declared(contact["law"]))
    return {**({} if name is None else {name: radius}), **contact, "table": table}


@lru_cache(maxsize=8)  # a scene is read again for every change of a study
def _asperities(surfaces: Surfaces, folder: Path) -> tuple[float, list[list[float]]]:
    from tribodyn.geometry.asperities import identify

    maps = faces(surfaces, folder)
    second = maps[1] if len(maps) > 1 else None
    result = identify(maps[0], second, surfaces.cutoff, surfaces.shortest)
    return result.radius, result.table().tolist()
