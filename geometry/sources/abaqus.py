"""Decks of Abaqus and CalculiX: nodes, elements, parts and instances, sets and surfaces.

Elements of every formulation (reduced, hybrid, incompatible modes) are read as geometry and computed here as second
order. The cards on materials, constraints and loads are read in `abaqus_cards`. Whatever is not used is named."""

import math
import re
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.geometry.placement import rotation
from tribodyn.geometry.sources.abaqus_grammar import ANY, PLACED, TABLE
from tribodyn.geometry.sources.card_table import SkippedCards
from tribodyn.geometry.sources.directions import System, orthogonal
from tribodyn.geometry.sources.keywords import WITH_INPUT, Card, cards
from tribodyn.refusal import Refusal

# first letters and number of nodes of a solid -> meshio's kind
SOLIDS = {
    4: "tetra",
    5: "pyramid",
    6: "wedge",
    8: "hexahedron",
    10: "tetra10",
    13: "pyramid13",
    15: "wedge15",
    20: "hexahedron20",
    27: "hexahedron27",
}
_SOLID = re.compile(r"^(?:D?C3D|F3D|AC3D|DCC3D|Q3D)(\d+)")
# Abaqus numbers the nodes of a hexahedron beyond 20: middle, then faces S1 to S6
HEXAHEDRON_27 = [*range(20), 26, 24, 23, 25, 21, 22, 20]
# corners of the faces S1, S2, ... of a solid with so many corners
FACES: dict[int, tuple[tuple[int, ...], ...]] = {
    4: ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    5: ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    6: ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    8: ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}
CARRIED = ("MASS", "SPRING", "SFM3D")  # elements that are no solids: read by their cards, or mere surfaces
GENERATORS = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY")

Node = tuple[str, int]  # instance, label


@dataclass
class Scope:
    """What a part, an instance or the assembly holds. Sets and surfaces are kept by their names in capitals.

    nsets, elsets : name -> its items as written: labels, or names of other sets, perhaps with "instance." before them
    surfaces : name -> (kind, items); names : capitals -> as written; unsorted : sets in the order of the deck
    lumped : cards of masses and springs; cards : that name nodes or faces of this scope"""

    nodes: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    elements: dict[int, tuple[str, tuple[int, ...]]] = field(default_factory=dict)
    nsets: dict[str, list[str]] = field(default_factory=dict)
    elsets: dict[str, list[str]] = field(default_factory=dict)
    surfaces: dict[str, tuple[str, list[tuple[str, str]]]] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    sections: list[Card] = field(default_factory=list)
    lumped: list[Card] = field(default_factory=list)
    orientations: dict[str, Card] = field(default_factory=dict)
    distributions: dict[str, Card] = field(default_factory=dict)
    unsorted: set[str] = field(default_factory=set)
    cards: list[Card] = field(default_factory=list)
    system: System | None = None

    def name(self, text: str) -> str:
        """The key of a name, which is remembered as it was first written."""
        key = text.upper()
        self.names.setdefault(key, text)
        return key


@dataclass
class DeckAssembly:
    """All scopes of a deck: instances by name (one "" for a deck without parts), and the assembly above them.

    cards : others than those of the mesh, and the instance in which each stands"""

    instances: dict[str, Scope]
    moves: dict[str, tuple[np.ndarray, np.ndarray]]
    top: Scope
    cards: list[tuple[Card, str]]
    skipped: SkippedCards

    def scope(self, instance: str) -> Scope:
        """The scope of an instance, "" for the assembly."""
        return self.instances[instance] if instance else self.top

    def split(self, item: str, instance: str) -> tuple[str, str]:
        """Instance and rest of an item such as "BLADE-1.17", whose case does not matter."""
        head, dot, tail = item.partition(".")
        if dot:
            for name in self.instances:
                if name.upper() == head.upper():
                    return name, tail
        return instance, item

    def nodes(self, item: str, instance: str = "", depth: int = 0) -> list[Node]:
        """Nodes of an item: a label, a node set, or one of an instance; raises KeyError where there is none."""
        instance, item = self.split(item, instance)
        scope = self.scope(instance)
        if item.lstrip("-").isdigit():
            return [(instance, int(item))]
        key = item.upper()
        if key in scope.nsets and depth < 50:
            return [node for inner in scope.nsets[key] for node in self.nodes(inner, instance, depth + 1)]
        if key in scope.elsets:
            return [
                (where, node)
                for where, label in self.elements(item, instance)
                for node in self.scope(where).elements[label][1]
            ]
        raise KeyError(item)

    def ordered_nodes(self, item: str) -> list[Node]:
        """Nodes of an item, each once: of an unsorted set in the order of the deck, else by instance and label."""
        members = list(dict.fromkeys(self.nodes(item)))
        instance, name = self.split(item, "")
        rank = {name: k for k, name in enumerate(self.instances)}
        is_unsorted = name.upper() in self.scope(instance).unsorted
        return members if is_unsorted else sorted(members, key=lambda node: (rank.get(node[0], -1), node[1]))

    def elements(self, item: str, instance: str = "", depth: int = 0) -> list[Node]:
        """Elements of an item likewise."""
        instance, item = self.split(item, instance)
        scope = self.scope(instance)
        if item.isdigit():
            return [(instance, int(item))]
        key = item.upper()
        if key in scope.elsets and depth < 50:
            return [element for inner in scope.elsets[key] for element in self.elements(inner, instance, depth + 1)]
        raise KeyError(item)


def load(path: Path) -> DeckAssembly:
    """Sort the cards of a deck into parts, instances and the rest. Raises Refusal on what cannot be read."""
    parts: dict[str, Scope] = {}
    assembly = DeckAssembly({}, {}, Scope(), [], SkippedCards(TABLE, "*"))
    scope = assembly.top
    for card in cards(path):
        assembly.skipped.check_parameters(card.name, card.options)
        if "INPUT" in card.options and card.name in TABLE.reads - {*WITH_INPUT}:
            raise Refusal(f"{card.where} has its data in another file by INPUT, not read here: write them in the deck")
        if not (names := TABLE.fields.get(card.name, ANY)).endswith(ANY):
            for k, line in enumerate(card.data):
                if ";" in names or len(line) > names.count(",") + 1:
                    assembly.skipped.check_fields(card.name, line, k)
        if card.name == "PART":
            if parts.setdefault(card.option("NAME").upper(), scope := Scope()) is not scope:
                raise Refusal(f"{card.where} has the name '{card.option('NAME')}' of another part: give each its own")
        elif card.name == "INSTANCE":
            scope = _instance(card, parts, assembly)
        elif card.name in ("END PART", "END INSTANCE", "ASSEMBLY", "END ASSEMBLY"):
            scope = assembly.top
        elif card.name in MESH_CARDS:
            MESH_CARDS[card.name](card, scope)
        elif card.name in PLACED and scope is not assembly.top:
            scope.cards.append(card)
        else:
            assembly.cards.append((card, ""))
    assembly.cards[:0] = [(card, name) for name, scope in assembly.instances.items() for card in scope.cards]
    if parts and not assembly.instances:
        raise Refusal(f"deck '{path}' has parts but no *INSTANCE: write the deck with its assembly")
    return assembly


def _instance(card: Card, parts: dict[str, Scope], assembly: DeckAssembly) -> Scope:
    part, name = card.option("PART"), card.option("NAME")
    if part.upper() not in parts:
        part_names = ", ".join(parts) or "there is none"
        raise Refusal(f"{card.where} names the part '{part}', which the deck has not ({part_names}): correct the name")
    if any(name.upper() == other.upper() for other in assembly.instances):
        raise Refusal(f"{card.where} has the name '{name}' of another instance: give each its own")
    source = parts[part.upper()]
    content: dict[str, Any] = {
        key: {k: list(items) for k, items in getattr(source, key).items()} for key in ("nsets", "elsets")
    }
    content |= {item.name: copy(getattr(source, item.name)) for item in fields(source) if item.name not in content}
    scope = Scope(**{**content, "system": None})
    turn, shift = np.eye(3), np.zeros(3)
    if card.data:
        shift = np.array(card.floats(card.data[0], 3))
    if len(card.data) > 1:
        *axis, angle = card.floats(card.data[1], 7)
        start, direction = np.array(axis[:3]), np.array(axis[3:]) - np.array(axis[:3])
        if not direction.any():
            raise Refusal(f"{card.where} turns about two points at one place: give two points of the axis")
        turn = rotation(direction, math.radians(angle))
        shift = start + turn @ (shift - start)
    assembly.instances[name] = scope
    assembly.moves[name] = (turn, shift)
    return scope


def _surface(card: Card, scope: Scope) -> None:
    kind = card.option("COMBINE", "TYPE").upper() or "ELEMENT"
    items = [(line[0], line[1].upper() if len(line) > 1 else "") for line in card.data]
    scope.surfaces[scope.name(card.option("NAME"))] = (kind, items)


def _system(card: Card, scope: Scope) -> None:
    """Where the nodes that follow are placed: a translation, or three points."""
    if not card.data:
        scope.system = None
        return
    origin, on_x = (np.array(card.floats(card.data[0][k : k + 3], 3)) for k in (0, 3))
    axes = np.eye(3)
    if len(card.data[0]) > 3:
        on_plane = np.array(card.floats(card.data[1], 3)) if len(card.data) > 1 else origin + [0.0, 0.0, 1.0]
        x, second, third = orthogonal(on_x - origin, on_plane - origin)
        axes = np.stack([x, second, third] if len(card.data) > 1 else [x, -third, second])
    scope.system = System("rectangular", origin, axes)


def _nodes(card: Card, scope: Scope) -> None:
    labels = [card.integer(line[0]) for line in card.data]
    if not labels:
        raise Refusal(f"{card.where} has no nodes: write them in the deck, or take an *INCLUDE")
    places = np.array([card.floats(line[1:], 3) for line in card.data])
    if kind := {"C": "cylindrical", "S": "spherical"}.get(card.option("SYSTEM").upper()[:1]):
        places = System(kind, np.zeros(3), np.eye(3)).places(places)
    if scope.system is not None:
        places = scope.system.places(places)
    for label, (x, y, z) in zip(labels, places.tolist(), strict=True):
        if scope.nodes.setdefault(label, (x, y, z)) != (x, y, z):
            raise Refusal(f"{card.where} has node {label} again, at another place: take one of the two out")
    if card.option("NSET"):
        scope.nsets.setdefault(scope.name(card.option("NSET")), []).extend(map(str, labels))


def _elements(card: Card, scope: Scope) -> None:
    kind = card.option("TYPE").upper()
    count = solid_node_count(kind)
    labels = []
    numbers: list[int] = []
    for line in card.data:
        numbers += [card.integer(text) for text in line if text]
        if count is None or len(numbers) > count:
            element = (kind, tuple(numbers[1:]))
            if count is not None and len(numbers) > count + 1:
                raise Refusal(
                    f"{card.where} has element {numbers[0]} with more nodes than {kind} has: correct the type"
                )
            if scope.elements.setdefault(numbers[0], element) != element:
                raise Refusal(f"{card.where} has element {numbers[0]} again, with other nodes: take one of the two out")
            labels.append(str(numbers[0]))
            numbers = []
    if numbers:
        raise Refusal(f"{card.where} ends inside element {numbers[0]}: the deck is cut off or a line is missing")
    if card.option("ELSET"):
        scope.elsets.setdefault(scope.name(card.option("ELSET")), []).extend(labels)


def solid_node_count(kind: str) -> int | None:
    """Nodes of a solid element by its type; None for elements that are none."""
    number = _SOLID.match(kind)
    return int(number[1]) if number and int(number[1]) in SOLIDS else None


def formulation(kind: str) -> str:
    """How a type of 8-node hexahedron is computed: reduced (C3D8R), with incompatible modes (C3D8I), or in full."""
    letters = _SOLID.sub("", kind)
    return "linear_reduced" if "R" in letters else "linear_incompatible" if "I" in letters else "linear_full"


def _set(card: Card, scope: Scope) -> None:
    key = scope.name(card.option(card.name))
    target = (scope.nsets if card.name == "NSET" else scope.elsets).setdefault(key, [])
    prefix = f"{card.option('INSTANCE')}." if card.option("INSTANCE") else ""
    if card.name == "NSET" and card.option("ELSET"):
        target.append(prefix + card.option("ELSET"))
    if "UNSORTED" in card.options:
        scope.unsorted.add(key)
    for line in card.data:
        if "GENERATE" in card.options:
            numbers = [card.integer(text) for text in line if text] or [0]
            first, last, step = numbers if len(numbers) == 3 else (numbers[0], numbers[-1], 1)
            if len(numbers) > 3 or last < first or step < 1 or (last - first) // step > 1e7:
                raise Refusal(
                    f"{card.where} generates labels from {first} to {last} by {step}: count up, to 1e7 labels"
                )
            target += [f"{prefix}{label}" for label in range(first, last + 1, step)]
        else:
            target += [prefix + text for text in line if text]


def _generator(card: Card, scope: Scope) -> None:
    raise Refusal(f"{card.where} generates a mesh: write the deck with its nodes and elements listed")


MESH_CARDS: dict[str, Callable[[Card, Scope], None]] = {
    "NODE": _nodes,
    "ELEMENT": _elements,
    "NSET": _set,
    "ELSET": _set,
    "SURFACE": _surface,
    "SYSTEM": _system,
    "SOLID SECTION": lambda card, scope: scope.sections.append(card),
    **dict.fromkeys(("MASS", "SPRING"), lambda card, scope: scope.lumped.append(card)),
    "ORIENTATION": lambda card, scope: scope.orientations.update({card.option("NAME").upper(): card}),
    "DISTRIBUTION": lambda card, scope: scope.distributions.update({card.option("NAME").upper(): card}),
    **dict.fromkeys(GENERATORS, _generator),
}
