"""Numbers of a contact that follow from its temperature, or from the measured faces that a scene names."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from tribodyn import declarations
from tribodyn.hbm.contact import contact_law
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.contact import ByTemperature, Change, Surfaces
from tribodyn.workflows.scene.fields import Table
from tribodyn.workflows.scene.own import is_file

if TYPE_CHECKING:  # most scenes name no faces and start sooner without
    from tribodyn.geometry.surface import HeightMap


class _OfContact(Table):
    temperature: Change | None = None
    by_temperature: ByTemperature


class _Heat(Table):
    temperature: Change


def with_numbers_when_hot(key: str, contact: Mapping[str, Any], static: Any) -> dict[str, Any]:
    """The table of a contact as it stands in the file, with the numbers of its temperature.

    key : of the contact; static : the table of the static loads
    Raises  ValueError where its temperature is not known or a number is given twice
    """
    own = {name: contact[name] for name in ("temperature", "by_temperature") if name in contact}
    try:
        read = _OfContact.model_validate(own)
    except ValidationError as error:  # before the numbers that it should have given are missed
        first = error.errors()[0]
        where = ".".join(str(part) for part in (key, *first["loc"]))
        raise Refusal(f"{where}: {first['msg'].removeprefix('Value error, ')}") from None
    try:
        found = read.by_temperature.at(_warmed(contact, static) if read.temperature is None else read.temperature)
    except ValueError as error:
        raise Refusal(f"{key}: {error}") from None
    # a scene that was written out has the numbers beside the table
    twice = [name for name, value in found.items() if contact.get(name, value) not in (None, value)]
    if twice:
        raise Refusal(f"{key}.{twice[0]}: by_temperature gives it too: leave one of them out")
    return {**contact, **found}


def _warmed(contact: Mapping[str, Any], static: Any) -> float:
    """Mean over its two bodies of what the static loads heat them by [K]."""
    faces = [contact.get(one) for one in ("first", "second", "group", "opposite")]
    bodies = {str(face).partition(".")[0] for face in faces if isinstance(face, str) and face != "ground"}
    warmed = dict.fromkeys(bodies, 0.0)
    for load in static.values() if isinstance(static, Mapping) else ():
        if not isinstance(load, Mapping) or not {"temperature", "field"} & set(load):
            continue
        if "field" in load:
            raise Refusal("a field of temperatures heats its bodies: give the contact's own temperature")
        try:
            change = _Heat.model_validate({"temperature": load["temperature"]}).temperature
        except ValidationError:  # reported where the load is read
            continue
        for body in bodies & set(load.get("bodies", bodies)):
            warmed[body] += change
    return sum(warmed.values()) / len(warmed)


def faces(surfaces: Surfaces, folder: Path) -> list[HeightMap]:
    """The face of body 1, and that of body 2 unless it is flat, in the same coordinates."""
    from tribodyn.geometry import surface_io
    from tribodyn.geometry.surface import mirrored, synthetic_pair

    if surfaces.synthetic is not None:
        made = surfaces.synthetic
        pair = synthetic_pair(made.seed, made.size, ridge=made.ridge, waviness=made.waviness, roughness=made.roughness)
        return list(pair)
    read = [
        surface_io.read(
            folder / name,
            spacing=surfaces.spacing,
            lateral_unit=surfaces.lateral_unit,
            height_unit=surfaces.height_unit,
        )
        for name in (surfaces.first, surfaces.second)
        if name is not None
    ]
    return [*read[:1], *(mirrored(face, surfaces.mirror) if surfaces.mirror else face for face in read[1:])]


def takes_asperities(contact: Any) -> bool:
    """Whether the table of a contact, as it stands in the file, leaves the law's own table to the measured faces."""
    name = contact.get("law") if isinstance(contact, Mapping) else None
    if not isinstance(name, str) or is_file(name) or "table" in contact:
        return False
    try:
        return declarations.constant(contact_law.file_of(name), "TABLE") is not None
    except ValueError:  # no such law, which is reported where the contact is read
        return False


def with_asperities(contact: Mapping[str, Any], surfaces: Surfaces, folder: Path) -> dict[str, Any]:
    """A contact as it stands in the file with the table and, where it has none, the radius of the measured faces.

    Raises  ValueError where the faces have no asperities to count
    """
    try:
        radius, table = _asperities(surfaces, folder)
    except (ValueError, OSError) as error:
        raise Refusal(f"surfaces: no asperities for the law '{contact['law']}': {error}") from None
    return {"radius": radius, **contact, "table": table}


@lru_cache(maxsize=8)  # a scene is read again for every change of a study
def _asperities(surfaces: Surfaces, folder: Path) -> tuple[float, list[list[float]]]:
    from tribodyn.geometry.asperities import identify

    given = faces(surfaces, folder)
    second = given[1] if len(given) > 1 else None
    found = identify(given[0], second, surfaces.cutoff, surfaces.shortest)
    return found.radius, found.table().tolist()
