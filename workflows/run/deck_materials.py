"""Materials of a deck; materials of the scene replace them by name."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from tribodyn.fem.material import Anisotropic, AnyMaterial, Material, Orthotropic
from tribodyn.geometry.sources import deck
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.structure_tables import DeckTable as Table


def material(
    source: deck.Deck,
    name: str,
    mesh: Any,
    table: Table,
    materials: Mapping[str, AnyMaterial],
    form: str,
    deck_name: str = "NAME",
) -> Any:
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
