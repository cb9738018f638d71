"""Names of an Abaqus or CalculiX deck as groups of its mesh: faces, node sets, single nodes and reference points."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tribodyn.geometry.sources.abaqus import DeckAssembly, Node
from tribodyn.geometry.sources.abaqus_sets import chosen_elements
from tribodyn.geometry.sources.card_table import CardTable, SkippedCards
from tribodyn.geometry.sources.keywords import Card
from tribodyn.geometry.sources.raw_mesh import RawMesh
from tribodyn.refusal import Refusal


@dataclass
class DeckPlaces:
    """What the cards of a deck name, as groups of its mesh; each card that cannot be used is recorded.

    row : node -> row of the points of `raw`; number : element -> its number
    nodes, faces : groups that are made for cards; references : row of a reference point -> its name
    solid : (n_point,) whether a point belongs to a solid element
    """

    assembly: DeckAssembly
    raw: RawMesh
    row: dict[Node, int]
    number: dict[Node, int]
    nodes: dict[str, np.ndarray] = field(default_factory=dict)
    faces: dict[str, list[np.ndarray]] = field(default_factory=dict)
    references: dict[int, str] = field(default_factory=dict)
    skipped: SkippedCards = field(default_factory=lambda: SkippedCards(TABLE, "*"))
    solid: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=bool))

    def __post_init__(self) -> None:
        self.solid = np.zeros(len(self.raw.points), dtype=bool)
        for block in self.raw.cells:
            self.solid[block.nodes] = True
        self.keys = list(self.row)
        for name, rows in self.raw.nodes.items():  # a point has one name, whichever of its sets a card takes
            if len(rows) == 1 and not self.solid[rows[0]]:
                self.references.setdefault(int(rows[0]), name)

    def _refused(self, card: Card, form: str = "") -> None:
        """Refuse a card, or one form of it."""
        self.skipped.refuse(f"*{card.name}{form and ', '}{form}")

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
        names = [*self.raw.faces, *self.raw.nodes] if face else [*self.raw.nodes, *self.raw.faces]
        for name in names:
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
            element_keys = self.assembly.elements(text)
        except KeyError:
            element_keys = []
        solids = np.array([self.number[key] for key in element_keys if key in self.number], dtype=int)
        chosen = chosen_elements(self.raw.cells, solids)
        face_corners = [nodes[:, list(faces[face - 1])] for nodes, faces in chosen if face <= len(faces)]
        if not face_corners:
            self._refused(card, f"on '{text}', which is no solid element")
        return face_corners


TABLE: CardTable = CardTable(
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
