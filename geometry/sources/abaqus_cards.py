"""What a deck of Abaqus or CalculiX holds beside its mesh: materials, constraints, loads, supports."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tribodyn.geometry.sources import abaqus, deck
from tribodyn.geometry.sources.abaqus import DeckAssembly, Node
from tribodyn.geometry.sources.card_table import CardTable, SkippedCards
from tribodyn.geometry.sources.directions import Directions, ElementAxes, System, axis_rotation, orthogonal
from tribodyn.geometry.sources.keywords import Card
from tribodyn.geometry.sources.raw_mesh import VOLUMES, RawMesh
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
TABLE = CardTable(
    read="""NODE, ELEMENT, NSET, ELSET, SURFACE, SOLID SECTION, PART, END PART, INSTANCE, END INSTANCE, ASSEMBLY,
        END ASSEMBLY, INCLUDE, SYSTEM, ORIENTATION, DISTRIBUTION, MATERIAL, ELASTIC, DENSITY, EXPANSION, MASS, SPRING,
        TIE, EQUATION, COUPLING, KINEMATIC, DISTRIBUTING, KINEMATIC COUPLING, DISTRIBUTING COUPLING, RIGID BODY, CLOAD,
        BOUNDARY, DSLOAD, DLOAD, INITIAL CONDITIONS, STEP, CONTACT PAIR, SURFACE INTERACTION, CHANGE FRICTION,
        FRICTION""",
    silent="""HEADING, PREPRINT, RESTART, OUTPUT, NODE OUTPUT, ELEMENT OUTPUT, CONTACT OUTPUT, ENERGY OUTPUT,
        NODE PRINT, NODE FILE, EL PRINT, EL FILE, CONTACT PRINT, CONTACT FILE, END STEP, MONITOR, PRINT, ENERGY PRINT,
        SECTION PRINT, FILE FORMAT""",
    harmless={
        "the step is the scene's": """STATIC, FREQUENCY, DYNAMIC, BUCKLE, VISCO, STEADY STATE DYNAMICS, MODAL DYNAMIC,
            RANDOM RESPONSE, RESPONSE SPECTRUM, COMPLEX FREQUENCY, HEAT TRANSFER, SUBSTRUCTURE GENERATE,
            SUBSTRUCTURE MATRIX OUTPUT, SUBSTRUCTURE LOAD CASE, RETAINED NODAL DOFS, SELECT EIGENMODES, AMPLITUDE,
            MATRIX GENERATE, MATRIX OUTPUT, CONTROLS, SOLUTION TECHNIQUE, TIME POINTS, SECTION CONTROLS,
            HOURGLASS STIFFNESS, DISTRIBUTION TABLE, PHYSICAL CONSTANTS, USER OUTPUT, FILTER, NORMAL""",
        "damping is the scene's": "DAMPING, MODAL DAMPING, GLOBAL DAMPING, DAMPING CONTROLS",
        "bodies are elastic": "PLASTIC, CREEP, CYCLIC HARDENING, RATE DEPENDENT, CONDUCTIVITY, SPECIFIC HEAT",
        "contact is the scene's": """SURFACE BEHAVIOR, CONTACT, CONTACT INCLUSIONS,
            CONTACT EXCLUSIONS, CONTACT PROPERTY ASSIGNMENT, CONTACT CONTROLS, CONTACT CONTROLS ASSIGNMENT,
            CONTACT FORMULATION, CONTACT INITIALIZATION ASSIGNMENT, CONTACT INITIALIZATION DATA, CONTACT DAMPING,
            CLEARANCE, GAP CONDUCTANCE, SURFACE PROPERTY ASSIGNMENT""",
    },
)


def read(path: Path) -> RawMesh:
    """Read a deck. Raises ValueError: one sentence that names the card and the cure."""
    assembly = abaqus.load(path)
    raw, row, number = abaqus.raw_of(assembly)
    if not raw.cells:
        return raw
    reader = _Cards(assembly, raw, row, number)
    for card in sorted(assembly.cards, key=lambda card: card.name not in FIRST):  # the order is kept beyond that
        reader.take(card)
    return reader.finished()


@dataclass
class _Cards:
    """Cards taken one after the other; what they name is turned into groups of the mesh."""

    assembly: DeckAssembly
    raw: RawMesh
    row: dict[Node, int]
    number: dict[Node, int]
    materials: dict[str, deck.DeckMaterial] = field(default_factory=dict)
    ties: list[deck.DeckTie] = field(default_factory=list)
    contacts: list[deck.DeckTie] = field(default_factory=list)
    couplings: list[deck.Coupling] = field(default_factory=list)
    equations: list[deck.DeckEquation] = field(default_factory=list)
    forces: list[deck.Force] = field(default_factory=list)
    pressures: list[deck.FacePressure] = field(default_factory=list)
    supports: list[deck.Support] = field(default_factory=list)
    nodes: dict[str, np.ndarray] = field(default_factory=dict)
    faces: dict[str, list[np.ndarray]] = field(default_factory=dict)
    references: dict[int, str] = field(default_factory=dict)
    unused: list[str] = field(default_factory=list)
    springs: list[deck.DeckSpring] = field(default_factory=list)
    met: SkippedCards = field(default_factory=lambda: SkippedCards(TABLE, "*"))
    steps: int = 0
    frictions: dict[str, float] = field(default_factory=dict)  # of surface interactions
    interaction: str = ""
    material: str = ""
    coupling: Card | None = None
    solid: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=bool))
    warm: np.ndarray = field(default_factory=lambda: np.empty(0))  # initial temperature of each point

    def __post_init__(self) -> None:
        self.solid, self.warm = np.zeros(len(self.raw.points), dtype=bool), np.full(len(self.raw.points), np.nan)
        for block in self.raw.cells:
            self.solid[block.nodes] = True
        self.keys = list(self.row)
        for name, rows in self.raw.nodes.items():  # a point has one name, whichever of its sets a card takes
            if len(rows) == 1 and not self.solid[rows[0]]:
                self.references.setdefault(int(rows[0]), name)

    def take(self, card: Card) -> None:
        """Use a card, or count it among those that are not used or refused."""
        if card.name in TABLE.reads:
            getattr(self, "_" + card.name.lower().replace(" ", "_"))(card)
        else:
            self.met.other(card.name)

    def _refused(self, card: Card, what: str = "") -> None:
        """Refuse a card, or one form of it."""
        self.met.refuse(f"*{card.name}{what and ', '}{what}")

    # materials

    def _material(self, card: Card) -> None:
        self.material = card.option("NAME").upper()
        if self.material in self.materials:
            raise Refusal(f"{card.where} defines the material '{card.option('NAME')}' again: give each its own name")
        self.materials[self.material] = deck.DeckMaterial(card.option("NAME"))

    def _elastic(self, card: Card) -> None:
        kind = card.option("TYPE").upper() or "ISO"
        if kind.startswith("ISO") and (values := self._row(card, 2, 1)):
            self._give(card, young=values[0], poisson=values[1])
        elif kind.startswith("ENGINEERING") and (values := self._row(card, 9, 2)):
            self._give(card, engineering=tuple(values))
        elif kind.startswith("ORTHO") and (values := self._row(card, 9, 2)) and _regular(values):
            self._give(card, engineering=engineering_constants(values))
        elif kind.startswith("ANISO") and (values := self._row(card, 21, 3)):
            self._give(card, stiffness=anisotropic(values))
        else:
            self._refused(card, kind)

    def _row(self, card: Card, count: int, lines: int) -> list[float]:
        """So many constants, each row on so many lines with its temperature behind it; none where they are not there.

        Several rows are taken at the initial temperature, and refused where that is not one for all
        """
        rows = [[card.number(text) for line in card.data[i : i + lines] for text in line]
                for i in range(0, len(card.data), lines)]  # fmt: skip
        if not rows or len(rows[0]) < count:
            return []
        warm, at = self.warm[self.solid], [row[count] for row in rows if len(row) > count]
        if len(rows) == 1:
            return rows[0][:count]
        if len(at) < len(rows) or not (np.diff(at) > 0).all() or np.ptp(warm) != 0:
            self._refused(card, "at several temperatures")
            return rows[0][:count]
        return [float(np.interp(warm[0], at, column)) for column in list(zip(*rows, strict=False))[:count]]

    def _density(self, card: Card) -> None:
        if values := self._row(card, 1, 1):
            self._give(card, density=values[0])

    def _expansion(self, card: Card) -> None:
        if card.option("TYPE").upper() in ("", "ISO") and (values := self._row(card, 1, 1)):
            self._give(card, expansion=values[0])
        else:
            self._refused(card, card.option("TYPE").upper())

    def _give(self, card: Card, **values: object) -> None:
        if self.material not in self.materials:
            raise Refusal(f"{card.where} stands before any *MATERIAL: move it below its material")
        self.materials[self.material] = replace(self.materials[self.material], **values)  # type: ignore[arg-type]

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
            count, fields = card.whole(line[0]), [text for text in line[1:] if text]
            while len(fields) < 3 * count:
                more = next(lines, None)
                if more is None:
                    raise Refusal(f"{card.where} ends before its {count} terms: the deck is cut off")
                fields += [text for text in more if text]
            terms = [
                (fields[i], card.whole(fields[i + 1]) - 1, card.number(fields[i + 2])) for i in range(0, 3 * count, 3)
            ]
            members = [self._rows(place, card) for place, _, _ in terms]
            for i in range(max(map(len, members))):
                picked = [rows[min(i, len(rows) - 1)] for rows in members]
                self.equations.append(
                    deck.DeckEquation(
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
            self.met.refused.pop(kind, None)
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
            axis = card.whole(line[1]) - 1
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
            with suppress(ValueError):  # of faces of what is no solid
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
            self.met.ignored["*INITIAL CONDITIONS, TEMPERATURE"] += 1
            for line in (line for line in card.data if len(line) > 1):
                with suppress(ValueError):  # of nodes that the deck has not: no table is taken at a temperature then
                    self.warm[self._rows(line[0], card)] = card.number(line[1])
        else:
            self._refused(card, card.option("TYPE").upper())

    # places

    def _rows(self, text: str, card: Card) -> list[int]:
        try:
            members = self.assembly.nodes(text)
            return sorted(self.row[node] for node in members)
        except KeyError:
            raise Refusal(
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
            raise Refusal(
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
            raise Refusal(f"{card.where} needs one reference node, '{text}' has {len(rows)}: name one node")
        name = self.references.get(rows[0]) or (f"node {text}" if text.replace(".", "").isdigit() else text)
        self.references[rows[0]] = name
        return name

    def _faces_of(self, text: str, face: int, card: Card) -> list[np.ndarray]:
        try:
            named = self.assembly.elements(text)
        except KeyError:
            named = []
        wanted = np.array([self.number[key] for key in named if key in self.number], dtype=int)
        found, start = [], 0
        for block in self.raw.cells:
            inside = wanted[(wanted >= start) & (wanted < start + len(block.nodes))] - start
            start += len(block.nodes)
            faces = abaqus.FACES[VOLUMES[block.kind][0].corners]
            if len(inside) and face <= len(faces):
                found.append(block.nodes[inside][:, list(faces[face - 1])])
        if not found:
            self._refused(card, f"on '{text}', which is no solid element")
        return found

    # the end

    def finished(self) -> RawMesh:
        """The mesh with everything that the cards give."""
        solid = self.solid
        made = deck.Deck(
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
        unused += self.met.unused()
        notes = [f"the loads and supports of {self.steps} steps are taken together"] if self.steps > 1 else []
        return replace(
            self.raw,
            nodes=nodes,
            faces={**self.raw.faces, **self.faces},
            points_of_reference=points,
            deck=made,
            unused=[*self.raw.unused, *unused],
            refused={**self.raw.refused, **self.met.refused},
            notes=[*self.raw.notes, *notes],
        )

    def _with_groups(self) -> Iterator[deck.DeckMaterial]:
        groups: dict[str, dict[str, Directions | None]] = {}
        for instance, scope in {**self.assembly.instances, "": self.assembly.top}.items():
            for card in scope.sections:
                elset, material = card.option("ELSET"), card.option("MATERIAL")
                if "COMPOSITE" in card.options:
                    self._refused(card, "COMPOSITE")
                    continue
                if material.upper() not in self.materials:
                    raise Refusal(
                        f"*SOLID SECTION of '{elset}' names the material '{material}', which the deck has not: "
                        "correct the name or add the material"
                    )
                wanted = f"{instance}.{elset}" if instance else elset
                name = next((name for name in self.raw.volumes if name.upper() == wanted.upper()), None)
                if name:
                    groups.setdefault(material.upper(), {})[name] = self._directions(card, scope, instance)
        for key, one in self.materials.items():
            mine = groups.get(key, {})
            yield replace(one, groups=tuple(mine), directions={name: axes for name, axes in mine.items() if axes})

    def _directions(self, section: Card, scope: abaqus.Scope, instance: str) -> Directions | None:
        """Axes of the material of a section, None for x, y, z."""
        name = section.option("ORIENTATION")
        if not name:
            return None
        scope = scope if name.upper() in scope.orientations else self.assembly.top
        card = scope.orientations.get(name.upper())
        if card is None:
            raise Refusal(f"{section.where} names the orientation '{name}', which the deck has not: add it")
        if card.option("DEFINITION").upper() not in ("", "COORDINATES") or not card.data:
            self._refused(card, card.option("DEFINITION").upper())
            return None
        turn, shift = self.assembly.moves.get(instance, (np.eye(3), np.zeros(3)))
        own = np.eye(3)
        if len(card.data) > 1 and card.data[1][0]:
            axis, angle = card.floats(card.data[1], 2)
            if axis not in (1.0, 2.0, 3.0):
                raise Refusal(f"{card.where} turns about axis {axis:g}: give 1, 2 or 3")
            own = axis_rotation(int(axis) - 1, angle)
        table = scope.distributions.get(card.data[0][0].upper())
        if table is not None:
            return self._listed(table, instance, turn, own)
        points = np.array(card.floats(card.data[0], 9)).reshape(3, 3)
        kind = card.option("SYSTEM").upper() or "RECTANGULAR"
        if kind in ("RECTANGULAR", "Z RECTANGULAR"):
            rows = orthogonal(points[0] - points[2], points[1] - points[2])
            if kind[0] == "Z":  # the first is z, the second x
                rows = np.roll(rows, -1, axis=0)
            system = System("rectangular", np.zeros(3), rows, own)
        elif kind in ("CYLINDRICAL", "SPHERICAL"):
            pole = points[1] - points[0]
            aside = np.eye(3)[np.abs(pole).argmin()]
            system = replace(System.of_points(kind.lower(), points[0], points[1], points[0] + aside), turn=own)
        else:
            self._refused(card, kind)
            return None
        return system.moved(turn, shift)

    def _listed(self, card: Card, instance: str, turn: np.ndarray, own: np.ndarray) -> ElementAxes:
        """Axes element by element; those that no line names have those of the first line."""
        centres = np.vstack([self.raw.points[block.nodes].mean(axis=1) for block in self.raw.cells])
        mine = [number for (where, _), number in self.number.items() if where == instance]  # labels are those of a part
        axes: list[np.ndarray] = []
        which = np.zeros(len(centres), dtype=int)
        for line in card.data:
            points = np.array(card.floats(line[1:], 6)).reshape(2, 3)
            if line[0]:
                try:
                    named = self.assembly.elements(line[0], instance)
                except KeyError:
                    raise Refusal(f"{card.where} names the elements '{line[0]}', which the deck has not") from None
                which[[self.number[key] for key in named if key in self.number]] = len(axes)
            axes.append(own @ orthogonal(*points) @ turn.T)
        return ElementAxes(centres[mine], np.array(axes)[which[mine]])

    def _springs(self) -> Iterator[deck.DeckSpring]:
        for instance, scope in {**self.assembly.instances, "": self.assembly.top}.items():
            for card in scope.springs:
                if not card.data or {"NONLINEAR", "ORIENTATION"} & set(card.options):
                    self._refused(card, ", ".join({"NONLINEAR", "ORIENTATION"} & set(card.options)) or "no stiffness")
                    continue
                axes = [card.whole(text) - 1 for line in card.data[:-1] for text in line if text]
                for where, label in self.assembly.elements(card.option("ELSET"), instance):
                    kind, nodes = self.assembly.scope(where).elements[label]
                    rows = [self.row[where, node] for node in nodes]
                    if kind == "SPRINGA":
                        along = np.subtract(*self.raw.points[rows[::-1]])
                        factors = along / np.linalg.norm(along)
                        terms = [
                            (r, k, s * f) for r, s in zip(rows, (-1, 1), strict=True) for k, f in enumerate(factors)
                        ]
                    else:
                        terms = [(r, axis, s) for r, axis, s in zip(rows, axes, (1.0, -1.0), strict=False)]
                    kept = tuple((self._node(r), axis, float(factor)) for r, axis, factor in terms if factor)
                    yield deck.DeckSpring(kept, card.number(card.data[-1][0]))

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


def anisotropic(D: list[float]) -> tuple[tuple[float, ...], ...]:
    """The stiffness in our order of 21 values: columns of its upper triangle, stresses 11, 22, 33, 12, 13, 23."""
    by_rows = [D[j * (j + 1) // 2 + i] for i in range(6) for j in range(i, 6)]
    return deck.stiffness(by_rows, (0, 1, 2, 5, 4, 3))


def _normal_block(D: list[float]) -> np.ndarray:
    return np.array([[D[0], D[1], D[3]], [D[1], D[2], D[4]], [D[3], D[4], D[5]]])


def _regular(D: list[float]) -> bool:
    """Whether a stiffness can be inverted; those of fluids cannot."""
    return bool(np.linalg.eigvalsh(_normal_block(D))[0] > 0)
