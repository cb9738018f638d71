"""Numbers of a contact that follow from the measured faces that a scene names."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tribodyn import declare
from tribodyn.hbm.contact import law as contact_law
from tribodyn.workflows.scene.contact import Surfaces
from tribodyn.workflows.scene.own import is_file

if TYPE_CHECKING:  # most scenes name no faces and start sooner without
    from tribodyn.geometry.surface import HeightMap


def faces(surfaces: Surfaces, folder: Path) -> list[HeightMap]:
    """The face of body 1, and that of body 2 unless it is flat, in the same coordinates."""
    from tribodyn.geometry import surface_io
    from tribodyn.geometry.surface_pair import mirrored, synthetic_pair

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
        return declare.constant(contact_law.file_of(name), "TABLE") is not None
    except ValueError:  # no such law, which is reported where the contact is read
        return False


def with_asperities(contact: Mapping[str, Any], surfaces: Surfaces, folder: Path) -> dict[str, Any]:
    """A contact as it stands in the file with the table and, where it has none, the radius of the measured faces.

    Raises  ValueError where the faces have no asperities to count
    """
    try:
        radius, table = _asperities(surfaces, folder)
    except (ValueError, OSError) as error:
        raise ValueError(f"surfaces: no asperities for the law '{contact['law']}': {error}") from None
    return {"radius": radius, **contact, "table": table}


@lru_cache(maxsize=8)  # a scene is read again for every change of a study
def _asperities(surfaces: Surfaces, folder: Path) -> tuple[float, list[list[float]]]:
    from tribodyn.geometry.asperities import identify

    given = faces(surfaces, folder)
    second = given[1] if len(given) > 1 else None
    found = identify(given[0], second, surfaces.cutoff, surfaces.shortest)
    return found.radius, found.table().tolist()
