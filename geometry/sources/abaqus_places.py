"""Names of an Abaqus or CalculiX deck as groups of its mesh: faces, node sets, single nodes and reference points."""

from dataclasses import dataclass, field

import numpy as np

from tribodyn.geometry.sources.abaqus import DeckAssembly, Node
from tribodyn.geometry.sources.abaqus_sets import chosen_elements
from tribodyn.geometry.sources.keywords import Card
from tribodyn.geometry.sources.raw_mesh import RawMesh
from tribodyn.refusal import Refusal


@dataclass
class DeckPlaces:
    """What the cards of a deck name, as groups of its mesh; each card that cannot be used is recorded.

    row : node -> row of the points of `raw`; number : element -> its number
    nodes, faces : groups that are made for cards; references : row of a reference point -> its name
    solid : (n_point,) whether a point belongs to a solid element
    instance, is_turned : in which the card stands that is read, and whether it is turned
    rotations : row of a node whose displacements are rotations -> the row of the point that they turn"""

    assembly: DeckAssembly
    raw: RawMesh
    row: dict[Node, int]
    number: dict[Node, int]
    nodes: dict[str, np.ndarray] = field(default_factory=dict)
    faces: dict[str, list[np.ndarray]] = field(default_factory=dict)
    references: dict[int, str] = field(default_factory=dict)
    rotations: dict[int, int] = field(default_factory=dict)
    solid: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=bool))
    instance: str = ""
    is_turned: bool = False

    def __post_init__(self) -> None:
        self.skipped = self.assembly.skipped
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

    def _qualified(self, text: str) -> str:
        """A name with the instance in which the card stands."""
        instance, name = self.assembly.split(text, self.instance)
        return f"{instance}.{name}" if instance else name

    def _rows(self, text: str, card: Card) -> list[int]:
        """Points of a node or a set in its order."""
        try:
            rows = [self.row[node] for node in self.assembly.ordered_nodes(self._qualified(text))]
        except KeyError as missing:
            lost = f" with node {missing.args[0][1]}" if isinstance(missing.args[0], tuple) else ""
            raise Refusal(
                f"{card.where} names '{text}'{lost}, which is no node and no set of the deck: correct it or add it"
            ) from None
        if not rows:
            raise Refusal(f"{card.where} names the set '{text}', which is empty: fill it, or take the line out")
        return rows

    def _dof(self, row: int, axis: int) -> tuple[str, int]:
        """Group and axis of a displacement of one node, or of the rotation that it stands for."""
        return self._node(self.rotations.get(row, row)), axis + 3 * (row in self.rotations)

    def _places(self, text: str, card: Card) -> tuple[list[str], int]:
        """Groups of the nodes of a set: its nodes of solids together, its points each by itself; and the first axis."""
        rows = self._rows(text, card)
        if len(rows) == 1 and rows[0] in self.rotations:
            return [self._node(self.rotations[rows[0]])], 3
        points = [row for row in rows if not self.solid[row]] if len(rows) > 1 else []
        return [*([self._place(text, card)] if len(points) < len(rows) else []), *map(self._node, points)], 0

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
        text = self._qualified(text)
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
            return bool(self.assembly.nodes(self._qualified(text)))
        except KeyError:
            return False

    def _reference(self, text: str, card: Card) -> str:
        rows = self._rows(text, card)
        if len(rows) != 1:
            raise Refusal(f"{card.where} needs one reference node, '{text}' has {len(rows)}: name one node")
        text = self._qualified(text)
        name = self.references.get(rows[0]) or (
            f"node {text}" if text.rpartition(".")[2].isdigit() else text  # as the label of a node is written
        )
        self.references[rows[0]] = name
        return name

    def _faces_of(self, text: str, face: int, card: Card) -> list[np.ndarray]:
        try:
            element_keys = self.assembly.elements(self._qualified(text))
        except KeyError:
            element_keys = []
        solids = np.array([self.number[key] for key in element_keys if key in self.number], dtype=int)
        chosen = chosen_elements(self.raw.cells, solids)
        face_corners = [nodes[:, list(faces[face - 1])] for nodes, faces in chosen if face <= len(faces)]
        if not face_corners:
            self._refused(card, f"on '{text}', which is no solid element")
        return face_corners
