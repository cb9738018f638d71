"""Constraints, springs, masses, loads and supports of a deck of Abaqus or CalculiX."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tribodyn.geometry.sources import abaqus, deck
from tribodyn.geometry.sources.abaqus_materials import MaterialCards
from tribodyn.geometry.sources.abaqus_places import TABLE as TABLE
from tribodyn.geometry.sources.abaqus_sets import raw_of
from tribodyn.geometry.sources.keywords import Card
from tribodyn.geometry.sources.raw_mesh import RawMesh
from tribodyn.refusal import Refusal

# named supports -> axes that they hold
NAMED_SUPPORTS = {
    "ENCASTRE": (0, 1, 2, 3, 4, 5),
    "PINNED": (0, 1, 2),
    "XSYMM": (0, 4, 5),
    "YSYMM": (1, 3, 5),
    "ZSYMM": (2, 3, 4),
    "XASYMM": (1, 2, 3),
    "YASYMM": (0, 2, 4),
    "ZASYMM": (0, 1, 5),
}
# read first, as the points that they name are known by these names then, and tables of materials need temperatures
FIRST = {"COUPLING", "KINEMATIC", "DISTRIBUTING", "KINEMATIC COUPLING", "DISTRIBUTING COUPLING", "RIGID BODY",
         "INITIAL CONDITIONS", "SURFACE INTERACTION", "CHANGE FRICTION", "FRICTION"}  # fmt: skip


def read(path: Path) -> RawMesh:
    """Read a deck. Raises Refusal: one sentence that names the card and the cure."""
    assembly = abaqus.load(path)
    raw, row, number = raw_of(assembly)
    if not raw.cells:
        return raw
    reader = _Cards(assembly, raw, row, number)
    for card in sorted(assembly.cards, key=lambda card: card.name not in FIRST):  # the order is kept beyond that
        reader.take(card)
    return reader.finished()


@dataclass
class _Cards(MaterialCards):
    """Reads cards one after the other; the sets that they name become groups of the mesh."""

    ties: list[deck.DeckTie] = field(default_factory=list)
    contacts: list[deck.DeckTie] = field(default_factory=list)
    couplings: list[deck.Coupling] = field(default_factory=list)
    equations: list[deck.DeckEquation] = field(default_factory=list)
    forces: list[deck.Force] = field(default_factory=list)
    pressures: list[deck.FacePressure] = field(default_factory=list)
    supports: list[deck.Support] = field(default_factory=list)
    unused: list[str] = field(default_factory=list)
    springs: list[deck.DeckSpring] = field(default_factory=list)
    steps: int = 0
    frictions: dict[str, float] = field(default_factory=dict)  # of surface interactions
    interaction: str = ""
    coupling: Card | None = None

    def take(self, card: Card) -> None:
        """Use a card, or count it among those that are not used or refused."""
        if card.name in TABLE.reads:
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
        if "REMOVE" in card.options:
            self._refused(card, "REMOVE")
            return
        lines = iter(card.data)
        for line in lines:
            count, fields = card.integer(line[0]), [text for text in line[1:] if text]
            while len(fields) < 3 * count:
                next_line = next(lines, None)
                if next_line is None:
                    raise Refusal(f"{card.where} ends before its {count} terms: the deck is cut off")
                fields += [text for text in next_line if text]
            terms = [
                (fields[i], card.integer(fields[i + 1]) - 1, card.number(fields[i + 2])) for i in range(0, 3 * count, 3)
            ]
            members = [self._rows(place, card) for place, _, _ in terms]
            for i in range(max(map(len, members))):
                node_rows = [rows[min(i, len(rows) - 1)] for rows in members]
                self.equations.append(
                    deck.DeckEquation(
                        tuple(
                            (self._node(r), axis, value) for r, (_, axis, value) in zip(node_rows, terms, strict=True)
                        )
                    )
                )

    def _coupling(self, card: Card) -> None:
        self.coupling = card

    def _kinematic(self, card: Card) -> None:
        self._couple("kinematic", card)

    def _distributing(self, card: Card) -> None:
        self._couple("distributing", card)

    def _couple(self, kind: str, card: Card) -> None:
        head, self.coupling = self.coupling, None
        if head is None:
            raise Refusal(f"{card.where} needs a *COUPLING before it: add its head")
        axes = sorted({axis for line in card.data for axis in _axes(card, line)})
        self.couplings.append(
            deck.Coupling(
                head.option("CONSTRAINTNAME") or f"coupling{len(self.couplings) + 1}",
                kind,
                self._reference(head.option("REFNODE"), head),
                self._place(head.option("SURFACE"), head, face=True),
                tuple(axes) or (0, 1, 2, 3, 4, 5),
            )
        )

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
            axes = tuple(_axes(card, line[1:])) or (0, 1, 2, 3, 4, 5)
            name = f"coupling{len(self.couplings) + 1}"
            self.couplings.append(deck.Coupling(name, "kinematic", point, self._place(line[0], card), axes))

    def _rigid_body(self, card: Card) -> None:
        face = card.option("NSET", "TIENSET", "PINNSET")
        if not face or card.option("ELSET") or card.option("ROTNODE"):
            self._refused(card, "ROT NODE" if card.option("ROTNODE") else "ELSET")
            return
        point = self._reference(card.option("REFNODE"), card)
        name = f"rigid{len(self.couplings) + 1}"
        self.couplings.append(deck.Coupling(name, "kinematic", point, self._place(face, card)))

    # loads and supports

    def _cload(self, card: Card) -> None:
        for line in card.data:
            if len(line) < 3:
                raise Refusal(f"{card.where} needs node, direction and value: complete the line")
            axis = card.integer(line[1]) - 1
            if 0 <= axis <= 5:
                self.forces.append(deck.Force(self._place(line[0], card), axis, card.number(line[2])))
            else:
                self._refused(card, f"direction {line[1]}")

    def _boundary(self, card: Card) -> None:
        single: dict[tuple[tuple[int, ...], float], list[int]] = {}
        for line in card.data:
            kind = (line[1] if len(line) > 1 else "").upper()
            value = card.number(line[3]) if len(line) > 3 and kind not in NAMED_SUPPORTS else 0.0
            axes = NAMED_SUPPORTS.get(kind) or tuple(_axes(card, line[1:3]))
            rows = self._rows(line[0], card)
            if len(rows) == 1 and self.solid[rows[0]] and line[0].rpartition(".")[2].isdigit():
                single.setdefault((axes, value), []).append(rows[0])
            else:
                self._support(self._place(line[0], card), axes, value)
        for (axes, value), members in single.items():  # together: what lies between them is held too
            name = f"support {len(self.supports) + 1}"
            self.nodes[name] = np.unique(members)
            self._support(name, axes, value)

    def _support(self, place: str, axes: tuple[int, ...], value: float) -> None:
        turns = place in self.references.values()
        self.supports += [deck.Support(place, axis, value) for axis in axes if axis < 3 or turns]

    def _dsload(self, card: Card) -> None:
        for line in card.data:
            if len(line) > 2 and line[1].upper() == "P":
                self.pressures.append(deck.FacePressure(self._place(line[0], card, face=True), card.number(line[2])))
            else:
                self._refused(card, line[1].upper() if len(line) > 1 else "")

    def _dload(self, card: Card) -> None:
        for line in card.data:
            face = line[1].upper() if len(line) > 2 else ""
            if not (face[:1] == "P" and face[1:].isdigit()):
                self._refused(card, face or "without a kind")
                continue
            name = f"pressed {len(self.pressures) + 1}"
            corners = self._faces_of(line[0], int(face[1:]), card)
            if corners:
                self.faces[name] = corners
                self.pressures.append(deck.FacePressure(name, card.number(line[2])))

    def _step(self, card: Card) -> None:
        self.steps += 1

    def _contact_pair(self, card: Card) -> None:
        for line in card.data:
            self.unused.append(f"contact pair {' on '.join(line)}, which the scene gives as [contacts.NAME]")
            with suppress(Refusal):  # of faces of what is no solid
                slave, master = (self._place(name, card, face=True) for name in line)
                friction = self.frictions.get(card.option("INTERACTION").upper())
                self.contacts.append(deck.DeckTie(" on ".join(line), slave, master, friction=friction))

    def _surface_interaction(self, card: Card) -> None:
        self.interaction = card.option("NAME").upper()

    _change_friction = _surface_interaction  # has no name: what a step changes is not taken

    def _friction(self, card: Card) -> None:
        """The coefficient of an interaction where it is one for all; other kinds of friction are not taken."""
        other = {"ANISOTROPIC", "EXPONENTIALDECAY", "DEPENDENCIES", "USER", "ROUGH"} & card.options.keys()
        if self.interaction and len(card.data) == 1 and not other:
            self.frictions[self.interaction] = card.number(card.data[0][0])

    def _initial_conditions(self, card: Card) -> None:
        if card.option("TYPE").upper() == "TEMPERATURE":
            self.skipped.ignored["*INITIAL CONDITIONS, TEMPERATURE"] += 1
            for line in (line for line in card.data if len(line) > 1):
                with suppress(Refusal):  # of nodes that the deck has not: no table is taken at a temperature then
                    self.warm[self._rows(line[0], card)] = card.number(line[1])
        else:
            self._refused(card, card.option("TYPE").upper())

    # the end

    def finished(self) -> RawMesh:
        """The mesh with everything that the cards give."""
        solid = self.solid
        content = deck.Deck(
            tuple(self._with_groups()),
            tuple(self.ties),
            tuple(self.contacts),
            tuple(self.couplings),
            tuple(self.equations),
            tuple(self._springs()),
            tuple(self.forces),
            tuple(self.pressures),
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
        nodes = {name: rows for name, rows in named.items() if name not in points}
        unused = list(self.unused)
        unused += self.skipped.unused()
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

    def _springs(self) -> Iterator[deck.DeckSpring]:
        for instance, scope in {**self.assembly.instances, "": self.assembly.top}.items():
            for card in scope.springs:
                if not card.data or {"NONLINEAR", "ORIENTATION"} & set(card.options):
                    self._refused(card, ", ".join({"NONLINEAR", "ORIENTATION"} & set(card.options)) or "no stiffness")
                    continue
                axes = [card.integer(text) - 1 for line in card.data[:-1] for text in line if text]
                for where, label in self.assembly.elements(card.option("ELSET"), instance):
                    kind, nodes = self.assembly.scope(where).elements[label]
                    rows = [self.row[where, node] for node in nodes]
                    if kind == "SPRINGA":
                        direction = np.subtract(*self.raw.points[rows[::-1]])
                        factors = direction / np.linalg.norm(direction)
                        terms = [
                            (r, k, s * f) for r, s in zip(rows, (-1, 1), strict=True) for k, f in enumerate(factors)
                        ]
                    else:
                        terms = [(r, axis, s) for r, axis, s in zip(rows, axes, (1.0, -1.0), strict=False)]
                    terms_of_nodes = tuple((self._node(r), axis, float(factor)) for r, axis, factor in terms if factor)
                    yield deck.DeckSpring(terms_of_nodes, card.number(card.data[-1][0]))

    def _masses(self) -> Iterator[deck.PointMass]:
        for instance, scope in {**self.assembly.instances, "": self.assembly.top}.items():
            for elset, value in scope.masses:
                for where, label in self.assembly.elements(elset, instance):
                    node = self.assembly.scope(where).elements[label][1][0]
                    yield deck.PointMass(self._node(self.row[where, node]), value)


def _axes(card: Card, fields: list[str]) -> range:
    """Axes 0..5 from a first and a last one, counted from 1 in the deck."""
    numbers = [card.integer(text) for text in fields if text]
    if not numbers:
        return range(0)
    return range(numbers[0] - 1, min(numbers[-1] if len(numbers) > 1 else numbers[0], 6))
