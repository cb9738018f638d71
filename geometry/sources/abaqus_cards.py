"""What a deck of Abaqus or CalculiX holds beside its mesh: materials, constraints, loads, supports."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tribodyn.geometry.sources import abaqus, deck
from tribodyn.geometry.sources.abaqus import Assembly, Node
from tribodyn.geometry.sources.cells import VOLUMES
from tribodyn.geometry.sources.keywords import Card
from tribodyn.geometry.sources.raw import RawMesh, listed

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
# that order results or steer the solver of the other program, and have no effect on the structure
SILENT = {
    "HEADING", "PREPRINT", "RESTART", "OUTPUT", "NODE OUTPUT", "ELEMENT OUTPUT", "CONTACT OUTPUT", "ENERGY OUTPUT",
    "NODE PRINT", "NODE FILE", "EL PRINT", "EL FILE", "CONTACT PRINT", "CONTACT FILE", "END STEP", "MONITOR", "PRINT",
    "ENERGY PRINT", "SECTION PRINT", "FILE FORMAT",
}  # fmt: skip


def read(path: Path) -> RawMesh:
    """Read a deck. Raises ValueError: one sentence that names the card and the cure."""
    assembly = abaqus.load(path)
    raw, row = abaqus.raw_of(assembly)
    if not raw.cells:
        return raw
    reader = _Cards(assembly, raw, row)
    for card in assembly.cards:
        reader.take(card)
    return reader.finished()


@dataclass
class _Cards:
    """Cards taken one after the other; what they name is turned into groups of the mesh."""

    assembly: Assembly
    raw: RawMesh
    row: dict[Node, int]
    materials: dict[str, deck.DeckMaterial] = field(default_factory=dict)
    ties: list[deck.Tie] = field(default_factory=list)
    couplings: list[deck.Coupling] = field(default_factory=list)
    equations: list[deck.Equation] = field(default_factory=list)
    forces: list[deck.Force] = field(default_factory=list)
    pressures: list[deck.FacePressure] = field(default_factory=list)
    supports: list[deck.Support] = field(default_factory=list)
    nodes: dict[str, np.ndarray] = field(default_factory=dict)
    faces: dict[str, list[np.ndarray]] = field(default_factory=dict)
    references: dict[int, str] = field(default_factory=dict)
    unused: list[str] = field(default_factory=list)
    ignored: Counter[str] = field(default_factory=Counter)
    steps: int = 0
    material: str = ""
    coupling: Card | None = None
    solid: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=bool))

    def __post_init__(self) -> None:
        self.solid = np.zeros(len(self.raw.points), dtype=bool)
        for block in self.raw.cells:
            self.solid[block.nodes] = True
        self.keys = list(self.row)

    def take(self, card: Card) -> None:
        """Use a card, or count it among those that are not used."""
        use = getattr(self, "_" + card.name.lower().replace(" ", "_"), None)
        if use is not None:
            use(card)
        elif card.name not in SILENT:
            self.ignored[card.name] += 1

    # materials

    def _material(self, card: Card) -> None:
        self.material = card.option("NAME").upper()
        if self.material in self.materials:
            raise ValueError(f"{card.where} defines the material '{card.option('NAME')}' again: give each its own name")
        self.materials[self.material] = deck.DeckMaterial(card.option("NAME"))

    def _elastic(self, card: Card) -> None:
        kind = card.option("TYPE").upper() or "ISO"
        values = [card.number(text) for line in card.data for text in line]
        if kind.startswith("ISO") and len(values) >= 2:
            self._give(card, young=values[0], poisson=values[1])
            rows = len(card.data)
        elif kind.startswith("ENGINEERING") and len(values) >= 9:
            self._give(card, engineering=tuple(values[:9]))
            rows = len(card.data) // 2
        elif kind.startswith("ORTHO") and len(values) >= 9 and _regular(values):
            self._give(card, engineering=engineering_constants(values[:9]))
            rows = len(card.data) // 2
        else:
            self.unused.append(f"{card.where} of type {kind}")
            return
        if rows > 1:
            self.unused.append(f"{rows - 1} rows at other temperatures of {card.where}")

    def _density(self, card: Card) -> None:
        if card.data:
            self._give(card, density=card.number(card.data[0][0]))

    def _expansion(self, card: Card) -> None:
        if card.option("TYPE").upper() in ("", "ISO") and card.data:
            self._give(card, expansion=card.number(card.data[0][0]))
        else:
            self.unused.append(card.where)

    def _give(self, card: Card, **values: object) -> None:
        if self.material not in self.materials:
            raise ValueError(f"{card.where} stands before any *MATERIAL: move it below its material")
        self.materials[self.material] = replace(self.materials[self.material], **values)  # type: ignore[arg-type]

    # constraints

    def _tie(self, card: Card) -> None:
        for line in card.data:
            if len(line) < 2:
                raise ValueError(f"{card.where} needs a slave and a master surface: complete the line")
            tolerance = card.option("POSITIONTOLERANCE")
            self.ties.append(
                deck.Tie(
                    card.option("NAME") or f"tie{len(self.ties) + 1}",
                    self._place(line[0], card, face=True),
                    self._place(line[1], card, face=True),
                    card.number(tolerance) if tolerance else None,
                )
            )

    def _equation(self, card: Card) -> None:
        if "REMOVE" in card.options:
            self.ignored[card.name + ", REMOVE"] += 1
            return
        lines = iter(card.data)
        for line in lines:
            count, fields = card.whole(line[0]), [text for text in line[1:] if text]
            while len(fields) < 3 * count:
                more = next(lines, None)
                if more is None:
                    raise ValueError(f"{card.where} ends before its {count} terms: the deck is cut off")
                fields += [text for text in more if text]
            terms = [
                (fields[i], card.whole(fields[i + 1]) - 1, card.number(fields[i + 2])) for i in range(0, 3 * count, 3)
            ]
            members = [self._rows(place, card) for place, _, _ in terms]
            for i in range(max(map(len, members))):
                picked = [rows[min(i, len(rows) - 1)] for rows in members]
                self.equations.append(
                    deck.Equation(
                        tuple((self._node(r), axis, value) for r, (_, axis, value) in zip(picked, terms, strict=True))
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
            raise ValueError(f"{card.where} needs a *COUPLING before it: add its head")
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

    def _kinematic_coupling(self, card: Card) -> None:
        point = self._reference(card.option("REFNODE"), card)
        for line in card.data:
            axes = tuple(_axes(card, line[1:])) or (0, 1, 2, 3, 4, 5)
            name = f"coupling{len(self.couplings) + 1}"
            self.couplings.append(deck.Coupling(name, "kinematic", point, self._place(line[0], card), axes))

    def _rigid_body(self, card: Card) -> None:
        face = card.option("NSET", "TIENSET", "PINNSET")
        if not face:
            self.unused.append(card.where)
            return
        point = self._reference(card.option("REFNODE"), card)
        name = f"rigid{len(self.couplings) + 1}"
        self.couplings.append(deck.Coupling(name, "kinematic", point, self._place(face, card)))

    # loads and supports

    def _cload(self, card: Card) -> None:
        for line in card.data:
            if len(line) < 3:
                raise ValueError(f"{card.where} needs node, direction and value: complete the line")
            axis = card.whole(line[1]) - 1
            if 0 <= axis <= 5:
                self.forces.append(deck.Force(self._place(line[0], card), axis, card.number(line[2])))
            else:
                self.unused.append(f"direction {line[1]} of {card.where}")

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
                self.unused.append(f"load {','.join(line)} of {card.where}")

    def _dload(self, card: Card) -> None:
        for line in card.data:
            face = line[1].upper() if len(line) > 2 else ""
            if not (face[:1] == "P" and face[1:].isdigit()):
                self.unused.append(f"load {','.join(line)} of {card.where}")
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
            self.unused.append(f"contact pair {' on '.join(line)}: give it as [contacts.NAME] in the scene")

    # places

    def _rows(self, text: str, card: Card) -> list[int]:
        try:
            members = self.assembly.nodes(text)
            return sorted(self.row[node] for node in members)
        except KeyError:
            raise ValueError(
                f"{card.where} names '{text}', which is no node and no set of the deck: correct the name or add the set"
            ) from None

    def _node(self, row: int) -> str:
        """Group of one node."""
        if row not in self.references:
            name = self._label(row)
            self.nodes[name] = np.array([row])
            return name
        return self.references[row]

    def _label(self, row: int) -> str:
        instance, label = self.keys[row]
        return f"node {f'{instance}.' if instance else ''}{label}"

    def _place(self, text: str, card: Card, face: bool = False) -> str:
        """Name of the group that a card means: a face, a node set, or a group of one node that is made for it."""
        known = [*self.raw.faces, *self.raw.nodes] if face else [*self.raw.nodes, *self.raw.faces]
        for name in known:
            if name.upper() == text.upper():
                rows = self.raw.nodes.get(name)
                return self.references.get(int(rows[0]), name) if rows is not None and len(rows) == 1 else name
        if face and not self._has(text):
            raise ValueError(
                f"{card.where} names the surface '{text}', which the deck has not: correct the name or add the surface"
            )
        rows_of = self._rows(text, card)
        if len(rows_of) == 1:
            return self._node(rows_of[0])
        self.nodes[text] = np.array(rows_of)
        return text

    def _has(self, text: str) -> bool:
        try:
            return bool(self.assembly.nodes(text))
        except KeyError:
            return False

    def _reference(self, text: str, card: Card) -> str:
        rows = self._rows(text, card)
        if len(rows) != 1:
            raise ValueError(f"{card.where} needs one reference node, '{text}' has {len(rows)}: name one node")
        name = self.references.get(rows[0]) or (f"node {text}" if text.replace(".", "").isdigit() else text)
        self.references[rows[0]] = name
        return name

    def _faces_of(self, text: str, face: int, card: Card) -> list[np.ndarray]:
        numbers: list[np.ndarray] = []
        for name, members in self.raw.volumes.items():
            if name.upper() == text.upper():
                numbers.append(members)
        wanted = numbers[0] if numbers else np.empty(0, dtype=int)
        found, start = [], 0
        for block in self.raw.cells:
            if not numbers and text.isdigit():
                inside = np.flatnonzero(block.labels == int(text))
            else:
                inside = wanted[(wanted >= start) & (wanted < start + len(block.nodes))] - start
            start += len(block.nodes)
            faces = abaqus.FACES[VOLUMES[block.kind][0].corners]
            if len(inside) and face <= len(faces):
                found.append(block.nodes[inside][:, list(faces[face - 1])])
        if not found:
            self.unused.append(f"load on '{text}' of {card.where}, which names no solid element")
        return found

    # the end

    def finished(self) -> RawMesh:
        """The mesh with everything that the cards give."""
        solid = self.solid
        for row in [row for row in self.references if solid[row]]:
            self.nodes[self.references[row]] = np.array([row])
        points = {name: self.raw.points[row] for row, name in self.references.items() if not solid[row]}
        named = {**self.raw.nodes, **self.nodes}
        for name, rows in named.items():
            if len(rows) == 1 and not solid[rows[0]]:
                points.setdefault(name, self.raw.points[rows[0]])
        nodes = {name: rows for name, rows in named.items() if name not in points}
        unused = list(self.unused)
        if self.ignored:
            unused.append(f"cards {listed({f'*{name}': count for name, count in self.ignored.items()})}")
        notes = [f"the loads and supports of {self.steps} steps are taken together"] if self.steps > 1 else []
        made = deck.Deck(
            tuple(self._with_groups()),
            tuple(self.ties),
            tuple(self.couplings),
            tuple(self.equations),
            tuple(self.forces),
            tuple(self.pressures),
            tuple(self.supports),
            tuple(self._masses()),
        )
        return replace(
            self.raw,
            nodes=nodes,
            faces={**self.raw.faces, **self.faces},
            points_of_reference=points,
            deck=made,
            unused=[*self.raw.unused, *unused],
            notes=[*self.raw.notes, *notes],
        )

    def _with_groups(self) -> Iterator[deck.DeckMaterial]:
        groups: dict[str, list[str]] = {}
        for instance, scope in {**self.assembly.instances, "": self.assembly.top}.items():
            for elset, material in scope.sections:
                if material.upper() not in self.materials:
                    raise ValueError(
                        f"*SOLID SECTION of '{elset}' names the material '{material}', which the deck has not: "
                        "correct the name or add the material"
                    )
                wanted = f"{instance}.{elset}" if instance else elset
                name = next((name for name in self.raw.volumes if name.upper() == wanted.upper()), None)
                if name:
                    groups.setdefault(material.upper(), []).append(name)
        for key, one in self.materials.items():
            yield replace(one, groups=tuple(groups.get(key, ())))

    def _masses(self) -> Iterator[deck.PointMass]:
        for instance, scope in {**self.assembly.instances, "": self.assembly.top}.items():
            for elset, value in scope.masses:
                for where, label in self.assembly.elements(elset, instance):
                    node = self.assembly.scope(where).elements[label][1][0]
                    yield deck.PointMass(self._node(self.row[where, node]), value)


def _axes(card: Card, fields: list[str]) -> range:
    """Axes 0..5 from a first and a last one, counted from 1 in the deck."""
    given = [card.whole(text) for text in fields if text]
    if not given:
        return range(0)
    return range(given[0] - 1, min(given[-1] if len(given) > 1 else given[0], 6))


def engineering_constants(D: list[float]) -> tuple[float, ...]:
    """(E1, E2, E3, nu12, nu13, nu23, G12, G13, G23) from D1111, D1122, D2222, D1133, D2233, D3333, D1212, D1313, ..."""
    S = np.linalg.inv(_normal_block(D))
    E = 1 / np.diag(S)
    return (*E.tolist(), float(-S[0, 1] * E[0]), float(-S[0, 2] * E[0]), float(-S[1, 2] * E[1]), *D[6:9])


def _normal_block(D: list[float]) -> np.ndarray:
    return np.array([[D[0], D[1], D[3]], [D[1], D[2], D[4]], [D[3], D[4], D[5]]])


def _regular(D: list[float]) -> bool:
    """Whether a stiffness can be inverted; those of fluids cannot."""
    return bool(np.linalg.eigvalsh(_normal_block(D))[0] > 0)
