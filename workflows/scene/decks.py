"""Table of a scene that brings a deck of another FE program whole."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, StrictInt

from tribodyn.workflows.scene.faces import FaceRule
from tribodyn.workflows.scene.fields import Table
from tribodyn.workflows.scene.units import to_si

Use = Literal["ties", "couplings", "equations", "masses", "supports", "forces", "pressures"]
EVERYTHING: tuple[Use, ...] = ("ties", "couplings", "equations", "masses", "supports", "forces", "pressures")


def in_metres(value: object) -> object:
    """A unit of length by its name as a number of metres."""
    return to_si(f"1 {value}", "m") if isinstance(value, str) else value


class DeckFace(FaceRule):
    """A face of a body of a deck that is picked by rule, where the deck puts the body."""

    body: str
    """Body of the deck, as `tribodyn inspect` lists it."""


class Deck(Table):
    """A deck of another FE program with its bodies, materials, constraints, supports and loads.

    Its bodies stand in the scene under their names in the deck, its groups under "body.group". The forces and pressures
    of all its steps act together as one static load. A material of the scene takes the place of one of the same name.
    """

    file: str
    """The deck, relative to the scene file."""
    unit: Annotated[float, BeforeValidator(in_metres), Field(gt=0)] = 1.0
    """Its unit of length, such as "mm"; a deck in mm counts in N, mm, t and s."""
    use: tuple[Use, ...] = EVERYTHING
    """What is taken from it beside bodies and materials; everything by default."""
    material: str | None = None
    """Material of the scene for elements to which the deck gives none."""
    halved: Annotated[StrictInt, Field(ge=0, le=3)] = 0
    """How many times every element of its bodies is cut into eight of half the size, its shape kept."""
    fixed: tuple[str, ...] = ()
    """Groups "body.group" that are clamped besides."""
    fixed_axes: dict[str, str] = Field(default_factory=dict)
    """Groups "body.group" held along some axes besides: group = letters out of "xyz"."""
    faces: dict[str, DeckFace] = Field(default_factory=dict)
    """Faces of its bodies that are picked by rule, by name; they are known as "body.name"."""
