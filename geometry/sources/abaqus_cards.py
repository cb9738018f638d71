"""Constraints, springs, masses, loads and supports of a deck of Abaqus or CalculiX."""

from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.geometry.sources import abaqus, deck
from tribodyn.geometry.sources.abaqus_grammar import DIRECTED, FIRST, NAMED_SUPPORTS, TABLE as TABLE
from tribodyn.geometry.sources.abaqus_materials import MaterialCards
from tribodyn.geometry.sources.abaqus_sets import raw_of
from tribodyn.geometry.sources.keywords import Card
from tribodyn.geometry.sources.raw_mesh import RawMesh
from tribodyn.refusal import Refusal


def read(path: Path) -> RawMesh:
    """Read a deck. Raises Refusal: one sentence that names the card and the cure."""
    assembly = abaqus.load(path)
    raw, row, number = raw_of(assembly)
    if not raw.cells:
        return raw
    reader = _Cards(assembly, raw, row, number)
    for card, instance in sorted(assembly.cards, key=lambda item: item[0].name not in FIRST):  # order kept beyond that
        reader.take(card, instance)
    return reader.finished()


@dataclass
class _Cards(MaterialCards):
    """Reads cards one after the other; the sets that they name become groups of the mesh."""

    ties: list[deck.DeckTie] = field(default_factory=list)
    contacts: list[deck.DeckTie] = field(default_factory=list)
    couplings: list[deck.Coupling] = field(default_factory=list)
    equations: list[deck.DeckEquation] = field(default_factory=list)
    forces: list[deck.Force] = field(default_factory=list)
    pressures: dict[str, list[deck.FacePressure]] = field(default_factory=dict)
    step_of: dict[Any, int] = field(default_factory=dict)  # of a load, or of the last card of a name with OP=NEW
    supports: list[deck.Support] = field(default_factory=list)
    unused: list[str] = field(default_factory=list)
    springs: list[deck.DeckSpring] = field(default_factory=list)
    steps: int = 0
    coupling: Card | None = None

    def take(self, card: Card, instance: str) -> None:
        """Use a card, or count it among those that are not used or refused."""
        self.instance = instance
        self.is_turned = bool(instance) and not np.allclose(self.assembly.moves[instance][0], np.eye(3))
        if self.is_turned and card.name in DIRECTED:
            self._refused(card, "in an instance that is turned")
        elif card.name in TABLE.reads:
            getattr(self, "_" + card.name.lower().replace(" ", "_"))(card)
        else:
            self.skipped.skip(card.name)

    # constraints

    def _tie(self, card: Card) -> None:
        for line in card.data:
            if len(line) < 2:
                raise Refusal(f"{card.where} needs a slave and a master surface: complete the line")
            tolerance = card.option("POSITIONTOLERANCE")
            self.ties.append(
                deck.DeckTie(
                    card.option("NAME") or f"tie{len(self.ties) + 1}",
                    self._place(line[0], card, face=True),
                    self._place(line[1], card, face=True),
                    card.number(tolerance) if tolerance else None,
                )
            )

    def _equation(self, card: Card) -> None:
        lines = iter(card.data)
        for line in lines:
            count, fields = card.integer(line[0]), [text for text in line[1:] if text]
            while len(fields) < 3 * count:
                next_line = next(lines, None)
                if next_line is None:
                    raise Refusal(f"{card.where} ends before its {count} terms: the deck is cut off")
                fields += [text for text in next_line if text]
            if count < 1 or len(fields) > 3 * count:
                raise Refusal(f"{card.where} has {len(fields)} fields for its {count} terms: correct their number")
            terms = [(fields[i], card.axis(fields[i + 1]), card.number(fields[i + 2])) for i in range(0, 3 * count, 3)]
            members = [self._rows(place, card) for place, _, _ in terms]
            counts = sorted({len(rows) for rows in members} | {len(members[0])})
            if len(set(counts) - {1}) > 1 or (counts != [1] and len(members[0]) == 1):
                raise Refusal(
                    f"{card.where} pairs sets of {' and '.join(map(str, counts))} nodes: give them equally many"
                )
            for i in range(len(members[0])):
                node_rows = [rows[i % len(rows)] for rows in members]
                self.equations.append(
                    deck.DeckEquation(
                        tuple(
                            (*self._dof(r, axis), value) for r, (_, axis, value) in zip(node_rows, terms, strict=True)
                        )
                    )
                )

    def _coupling(self, card: Card | None) -> None:
        if self.coupling is not None:
            self._refused(self.coupling, "without *KINEMATIC or *DISTRIBUTING")
        self.coupling = card

    def _kinematic(self, card: Card) -> None:
        head, self.coupling = self.coupling, None
        if head is None:
            raise Refusal(f"{card.where} needs a *COUPLING before it: add its head")
        axes = sorted({axis for line in card.data for axis in self._axes(card, line)})
        self.couplings.append(
            deck.Coupling(
                head.option("CONSTRAINTNAME") or f"coupling{len(self.couplings) + 1}",
                card.name.lower(),
                self._reference(head.option("REFNODE"), head),
                self._place(head.option("SURFACE"), head, face=True),
                tuple(axes) or (0, 1, 2, 3, 4, 5),
            )
        )

    _distributing = _kinematic

    def _distributing_coupling(self, card: Card) -> None:
        nodes = [self._node(row) for line in card.data for row in self._rows(line[0], card)]
        if len({line[1] for line in card.data if len(line) > 1} - {""}) > 1:
            self._refused(card, "unequal weights")
            return
        name = f"coupling{len(self.couplings) + 1}"
        self.nodes[name] = np.unique(np.concatenate([self.nodes[node] for node in nodes]))
        point = self._reference(card.option("REFNODE") or self._element_node(card), card)
        self.couplings.append(deck.Coupling(name, "distributing", point, name))

    def _element_node(self, card: Card) -> str:
        """The node of the element, such as DCOUP3D, to which CalculiX gives a distributing coupling."""
        for where, label in self.assembly.elements(card.option("ELSET")):
            kind, nodes = self.assembly.scope(where).elements[label]
            self.skipped.refused.pop(kind, None)
            return f"{where}.{nodes[0]}" if where else str(nodes[0])
        return ""

    def _kinematic_coupling(self, card: Card) -> None:
        point = self._reference(card.option("REFNODE"), card)
        for line in card.data:
            axes = tuple(self._axes(card, line[1:])) or (0, 1, 2, 3, 4, 5)
            name = f"coupling{len(self.couplings) + 1}"
            self.couplings.append(deck.Coupling(name, "kinematic", point, self._place(line[0], card), axes))

    def _rigid_body(self, card: Card) -> None:
        point = self._reference(card.option("REFNODE"), card)
        of_point = self._rows(card.option("REFNODE"), card)[0]
        if card.option("ROTNODE"):
            self.rotations[self._rows(card.option("ROTNODE"), card)[0]] = of_point
        sets = [card.options[key] for key in ("NSET", "TIENSET", "PINNSET") if key in card.options]
        rows = {row for text in sets for row in self._rows(text, card)} - {of_point}
        if not (rows or "ELSET" in card.options) or not self.solid[list(rows)].all():
            self._refused(card, "of nodes that belong to no solid")
        elif rows:
            name = f"rigid{len(self.couplings) + 1}"
            self.nodes[name] = np.array(sorted(rows))
            face = self._place(sets[0], card) if len(sets) == 1 else name
            self.couplings.append(deck.Coupling(name, "kinematic", point, face))

    # loads and supports

    def _act(self, card: Card, entries: list[Any], item: Any) -> None:
        """Add a load or support; with OP=NEW the first of a step ends those of earlier steps, else its like there."""
        key = (card.name, item) if isinstance(item, deck.Support) else (card.name, replace(item, value=0.0))
        if card.option("OP").upper() == "NEW" and self.step_of.get(card.name, 0) < self.steps:
            entries.clear()
            self.step_of[card.name] = self.steps
        elif self.step_of.get(key, self.steps) < self.steps:
            entries[:] = [other for other in entries if (card.name, replace(other, value=0.0)) != key]
        self.step_of[key] = self.steps
        entries.append(item)

    def _cload(self, card: Card) -> None:
        for line in card.data:
            if len(line) < 3:
                raise Refusal(f"{card.where} needs node, direction and value: complete the line")
            places, first = self._places(line[0], card)
            axis = card.integer(line[1]) - 1 + first
            if 0 <= axis <= 5:
                for place in places:
                    self._act(card, self.forces, deck.Force(place, axis, card.number(line[2])))
            else:
                self._refused(card, f"direction {line[1]}")

    def _boundary(self, card: Card) -> None:
        single: dict[tuple[tuple[int, ...], float], list[int]] = {}
        for line in card.data:
            kind = (line[1] if len(line) > 1 else "").upper()
            value = card.number(line[3]) if len(line) > 3 else 0.0
            axes = NAMED_SUPPORTS.get(kind) or tuple(self._axes(card, line[1:3]))
            if not kind:
                raise Refusal(f"{card.where} names no direction of '{line[0]}': complete the line")
            if self.is_turned and not {0, 1, 2} <= set(axes):
                self._refused(card, "in an instance that is turned")
            rows = self._rows(line[0], card)
            if len(rows) == 1 and self.solid[rows[0]] and line[0].rpartition(".")[2].isdigit():
                single.setdefault((axes, value), []).append(rows[0])
            else:
                places, first = self._places(line[0], card)
                for place in places:
                    self._support(card, place, tuple(axis + first for axis in axes), value)
        for (axes, value), members in single.items():  # together: what lies between them is held too
            name = f"support {len(self.supports) + 1}"
            self.nodes[name] = np.unique(members)
            self._support(card, name, axes, value)

    def _support(self, card: Card, place: str, axes: tuple[int, ...], value: float) -> None:
        turns = place in self.references.values()
        for axis in (axis for axis in axes if axis < 3 or turns):
            self._act(card, self.supports, deck.Support(place, axis, value))

    def _dsload(self, card: Card) -> None:
        for line in card.data:
            if len(line) > 2 and line[1].upper() == "P":
                pressure = deck.FacePressure(self._place(line[0], card, face=True), card.number(line[2]))
                self._act(card, self.pressures.setdefault(card.name, []), pressure)
            else:
                self._refused(card, line[1].upper() if len(line) > 1 else "")

    def _dload(self, card: Card) -> None:
        for line in card.data:
            face = line[1].upper() if len(line) > 2 else ""
            if not (face[:1] == "P" and face[1:].isdigit()):
                self._refused(card, face or "without a kind")
                continue
            name = f"pressed {len(self.faces) + 1}"
            corners = self._faces_of(line[0], int(face[1:]), card)
            if corners:
                self.faces[name] = corners
                pressure = deck.FacePressure(name, card.number(line[2]))
                self._act(card, self.pressures.setdefault(card.name, []), pressure)

    def _step(self, card: Card) -> None:
        self.steps += 1

    def _contact_pair(self, card: Card) -> None:
        for line in card.data:
            self.unused.append(f"contact pair {' on '.join(line)}, which the scene gives as [contacts.NAME]")
            with suppress(Refusal):  # of faces of what is no solid; one name is a surface that touches itself
                slave, master = (self._place(name, card, face=True) for name in (line * 2)[:2])
                friction = self.frictions.get(card.option("INTERACTION").upper())
                self.contacts.append(deck.DeckTie(" on ".join(line), slave, master, friction=friction))

    def _axes(self, card: Card, fields: list[str]) -> range:
        """Axes 0..5 from a first and a last one, counted from 1 in the deck."""
        numbers = [card.integer(text) for text in fields if text]
        if not numbers:
            return range(0)
        if not 1 <= numbers[0] <= numbers[-1]:
            raise Refusal(f"{card.where} names the directions {numbers[0]} to {numbers[-1]}: count up from 1")
        if numbers[0] > 6:
            self._refused(card, f"direction {numbers[0]}")
        return range(numbers[0] - 1, min(numbers[-1], 6))

    # the end

    def finished(self) -> RawMesh:
        """The mesh with everything that the cards give."""
        self._coupling(None)
        solid = self.solid
        content = deck.Deck(
            tuple(self._with_groups()),
            tuple(self.ties),
            tuple(self.contacts),
            tuple(self.couplings),
            tuple(self.equations),
            tuple(self._springs()),
            tuple(self.forces),
            tuple(pressure for pressures in self.pressures.values() for pressure in pressures),
            tuple(self.supports),
            tuple(self._masses()),
        )
        for row in [row for row in self.references if solid[row]]:
            self.nodes[self.references[row]] = np.array([row])
        points = {name: self.raw.points[row] for row, name in self.references.items() if not solid[row]}
        named = {**self.raw.nodes, **self.nodes}
        for name, rows in named.items():
            if len(rows) == 1 and not solid[rows[0]]:
                points.setdefault(name, self.raw.points[rows[0]])
        used = np.array(list(self.references), dtype=int)  # points, which have no part in a group of solids
        nodes = {name: rows[~np.isin(rows, used) | solid[rows]] for name, rows in named.items() if name not in points}
        nodes = {name: rows for name, rows in nodes.items() if len(rows)}
        unused = [*self.unused, *self.skipped.unused()]
        notes = [f"the loads and supports of {self.steps} steps are taken together"] if self.steps > 1 else []
        return replace(
            self.raw,
            nodes=nodes,
            faces={**self.raw.faces, **self.faces},
            points_of_reference=points,
            deck=content,
            unused=[*self.raw.unused, *unused],
            refused={**self.raw.refused, **self.skipped.refused},
            notes=[*self.raw.notes, *notes],
        )
