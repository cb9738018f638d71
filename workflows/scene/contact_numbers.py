"""Numbers of a contact that follow from its temperature, or from the measured faces that a scene names."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tribodyn import declarations
from tribodyn.declarations import Role
from tribodyn.hbm.contact import contact_law
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.contact import Surfaces
from tribodyn.workflows.scene.units import to_si
from tribodyn.workflows.scene.user_files import is_user_file

if TYPE_CHECKING:  # most scenes name no faces and start sooner without
    from tribodyn.geometry.height_map import HeightMap


def is_by_temperature(contact: Any) -> bool:
    """Whether a contact, as it stands in the file, has a number over its temperature, which it does not give."""
    if not isinstance(contact, Mapping) or "temperature" in contact:
        return False
    return any(isinstance(value, Mapping) and value.get("over") == "temperature" for value in contact.values())


def with_temperature(key: str, contact: Mapping[str, Any], static: Any) -> dict[str, Any]:
    """The table of a contact as it stands in the file, with its temperature.

    key : of the contact; static : the table of the static loads; raises Refusal where its temperature is not known"""
    try:
        return {**contact, "temperature": _mean_change(contact, static)}
    except Refusal as error:
        raise Refusal(f"{key}: {error}") from None


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
            change = to_si(load["temperature"], "K")
        except Refusal:  # reported where the load is read
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
