"""The bodies of a deck: its file, read once, the elements that they are computed in, and their materials.

Materials of the scene replace those of the deck by name."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.fem.material import Anisotropic, AnyMaterial, Material, Orthotropic
from tribodyn.geometry import subdivision
from tribodyn.geometry.sources import deck, foreign_file
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.structure_tables import DeckTable


def source(path: Path, unit: str) -> foreign_file.Source:
    """What a file holds, read once as long as it does not change; raises Refusal as `read.read` does."""
    return _read(path, unit, path.stat().st_mtime_ns if path.is_file() else 0)


@lru_cache(maxsize=4)
def _read(path: Path, unit: str, stamp: int) -> foreign_file.Source:
    return foreign_file.read(path, unit)


def notes_of(source: foreign_file.Source, table: DeckTable) -> tuple[str, ...]:
    """Sentences on the conversion of a deck."""
    notes = []
    names_of: dict[str, list[str]] = {}
    for name in source.bodies:
        names_of.setdefault(elements_of(source, table, name), []).append(name)
    for form, names in names_of.items():
        if form:
            meshes = [source.bodies[name].mesh for name in names]
            linear, raised = (
                sum(counts) for counts in zip(*((m.nvertices, m.doflocs.shape[1]) for m in meshes), strict=True)
            )
            notes.append(
                f"the hexahedra of {', '.join(names)} are computed on their eight corners ({form}): {linear} nodes; "
                f'elements = "quadratic" raises them to second order, with {raised} nodes'
            )
    return (*notes, *(source.order_notes if "" in names_of else ()), *source.notes)


def elements_of(source: foreign_file.Source, table: DeckTable, body: str) -> str:
    """Formulation of the 8-node hexahedra of a body, "" for elements of second order."""
    forms = {"deck": source.formulations.get(body, ""), "quadratic": ""}
    return forms.get(table.elements, table.elements)


def with_elements(mesh: Any, node_sets: dict[str, np.ndarray], form: str, body: str) -> tuple[Any, Any]:
    """Mesh and node sets of a body in elements of a formulation.

    Raises  Refusal, which names the body, where it has others than those can stand for"""
    return subdivision.first_order(mesh, node_sets, body) if form else (mesh, node_sets)


def material(
    source: deck.Deck, name: str, mesh: Any, table: DeckTable, materials: Mapping[str, AnyMaterial], form: str,
    deck_name: str = "NAME",
) -> Any:  # fmt: skip
    """Material of a body of a deck, or volume group -> material where it has several. form : of its elements

    Raises  Refusal where an element has none or two"""
    material_of_group: dict[str, AnyMaterial] = {}
    count = np.zeros(mesh.nelements, dtype=int)
    for deck_material in source.materials:
        for group in deck_material.groups:
            if group in (mesh.subdomains or {}):
                material_of_group[group] = _solid(deck_material, group, materials)
                count[mesh.subdomains[group]] += 1
    if (count > 1).any():
        n_overlap = int((count > 1).sum())
        raise Refusal(f"the sections of body '{name}' overlap in {n_overlap} elements: correct them")
    material_of_group = {
        group: replace(of_group, elements=form or of_group.elements) for group, of_group in material_of_group.items()
    }
    if (count == 1).all():
        return material_of_group if len(material_of_group) > 1 else next(iter(material_of_group.values()))
    if table.material is None:
        raise Refusal(
            f"the deck gives {int((count == 0).sum())} of {mesh.nelements} elements of body '{name}' no material: "
            f'name one of the scene with decks.{deck_name}.material = "name"'
        )
    if not material_of_group:
        return replace(materials[table.material], elements=form or materials[table.material].elements)
    raise Refusal(f"the deck gives a part of body '{name}' no material: give all its elements a section")


def _solid(deck_material: deck.DeckMaterial, group: str, materials: Mapping[str, AnyMaterial]) -> AnyMaterial:
    """A material of the deck along the axes of a group, or the one of the scene that takes its place."""
    axes: Any = deck_material.directions.get(group, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    if deck_material.name in materials:
        scene_material = materials[deck_material.name]
        return (
            replace(scene_material, axes=axes)
            if group in deck_material.directions and not isinstance(scene_material, Material)
            else scene_material
        )
    instead = f"give [materials.{deck_material.name}] in the scene, which takes its place"
    if deck_material.density is None:
        raise Refusal(f"material '{deck_material.name}' of the deck has no density: {instead}")
    coefficient = deck_material.expansion or 0.0
    if deck_material.stiffness is not None:
        return Anisotropic(np.array(deck_material.stiffness), deck_material.density, axes, (coefficient,) * 3)
    if deck_material.engineering is not None:
        e = deck_material.engineering
        return Orthotropic(e[:3], e[3:6], e[6:], deck_material.density, axes, (coefficient,) * 3)
    if deck_material.young is None or deck_material.poisson is None:
        raise Refusal(f"material '{deck_material.name}' of the deck has no elastic constants that are known: {instead}")
    return Material(deck_material.young, deck_material.poisson, deck_material.density, coefficient)
