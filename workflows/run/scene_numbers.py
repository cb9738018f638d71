"""The numbers of a scene that its response depends on smoothly, and what each of them touches."""

from collections.abc import Sequence
from typing import Any

from tribodyn.workflows.scene.contact import ContactTable
from tribodyn.workflows.scene.part_tables import Meshed, SolidMaterial
from tribodyn.workflows.scene.scene_values import SceneValue, smooth_numbers
from tribodyn.workflows.scene.schema import MeshScene, Scene


def keys(scene: Scene) -> dict[str, float]:
    """The numbers of a scene that its response depends on smoothly, without lengths and angles of its parts, by key."""
    return {key: number.value for key, number in smooth_numbers(scene).items() if not moves_nodes(number)}


def geometry_keys(scene: Scene) -> dict[str, float]:
    """The lengths and angles of the parts of a scene by their keys, SI units; zeros are left out."""
    return {key: number.value for key, number in smooth_numbers(scene).items() if moves_nodes(number)}


def moves_nodes(number: SceneValue) -> bool:
    """Whether a number is a length or an angle of a part."""
    return isinstance(number.table, Meshed)


def is_seen_by_contact(number: SceneValue) -> bool:
    """Whether the law of a contact may depend on a number."""
    if number.name == "density":
        return False
    return isinstance(number.table, (ContactTable, SolidMaterial, Meshed)) or number.name == "temperature"


def is_loaded_alike(scene: MeshScene) -> bool:
    """Whether no load and no output depends on what the part is made of, and it has no lumped mass or bolt."""
    if scene.masses or scene.bolts or scene.stress_places:
        return False
    loads = {**scene.loads.static, **scene.loads.harmonic}.values()
    return all(load.value is not None or load.pressure is not None for load in loads)


def with_value(table: Any, path: Sequence[str], value: float) -> Any:
    """A table of a scene with another value at the end of a path of keys."""
    name, *inner_path = path
    inside = isinstance(table, dict)
    changed = with_value(table[name] if inside else getattr(table, name), inner_path, value) if inner_path else value
    return {**table, name: changed} if inside else table.model_copy(update={name: changed})
