"""Materials of a deck, or those of the scene that replace them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from tribodyn.fem.material import Anisotropic, AnyMaterial, Material, Orthotropic
from tribodyn.geometry.sources import deck
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.structure import DeckTable as Table


def material(
    of: deck.Deck, name: str, mesh: Any, table: Table, materials: Mapping[str, AnyMaterial], deck_name: str = "NAME"
) -> Any:
    """Material of a body of a deck, or volume group -> material where it has several.

    Raises  ValueError where an element has none or two
    """
    given: dict[str, AnyMaterial] = {}
    count = np.zeros(mesh.nelements, dtype=int)
    for one in of.materials:
        for group in one.groups:
            if group in (mesh.subdomains or {}):
                given[group] = _solid(one, group, materials)
                count[mesh.subdomains[group]] += 1
    if (count > 1).any():
        many = int((count > 1).sum())
        raise Refusal(f"the sections of body '{name}' overlap in {many} elements: correct them")
    if table.elements == "linear_reduced":
        given = {group: _reduced(one, name) for group, one in given.items()}
    if (count == 1).all():
        return given if len(given) > 1 else next(iter(given.values()))
    if table.material is None:
        raise Refusal(
            f"the deck gives {int((count == 0).sum())} of {mesh.nelements} elements of body '{name}' no material: "
            f'name one of the scene with decks.{deck_name}.material = "name"'
        )
    if not given:
        own = materials[table.material]
        return _reduced(own, name) if table.elements == "linear_reduced" else own
    raise Refusal(f"the deck gives a part of body '{name}' no material: give all its elements a section")


def _reduced(one: AnyMaterial, body: str) -> Material:
    """A material whose elements are linear with reduced integration."""
    if not isinstance(one, Material):
        raise Refusal(f"elements = \"linear_reduced\" is for isotropic materials, and body '{body}' has another")
    return replace(one, linear_reduced=True)


def _solid(one: deck.DeckMaterial, group: str, materials: Mapping[str, AnyMaterial]) -> AnyMaterial:
    """A material of the deck along the axes of a group, or the one of the scene that takes its place."""
    axes: Any = one.directions.get(group, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    if one.name in materials:
        other = materials[one.name]
        return replace(other, axes=axes) if group in one.directions and not isinstance(other, Material) else other
    instead = f"give [materials.{one.name}] in the scene, which takes its place"
    if one.density is None:
        raise Refusal(f"material '{one.name}' of the deck has no density: {instead}")
    along = one.expansion or 0.0
    if one.stiffness is not None:
        return Anisotropic(np.array(one.stiffness), one.density, axes, (along,) * 3)
    if one.engineering is not None:
        e = one.engineering
        return Orthotropic(e[:3], e[3:6], e[6:], one.density, axes, (along,) * 3)
    if one.young is None or one.poisson is None:
        raise Refusal(f"material '{one.name}' of the deck has no elastic constants that are known: {instead}")
    return Material(one.young, one.poisson, one.density, along)
