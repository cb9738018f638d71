"""A mesh as it is in a file, before it becomes bodies: nodes, elements of any kind, groups. Every reader gives this.

Corners, edges and faces of elements are in the node order of meshio, which is VTK's."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tribodyn.geometry.numbering import HEX_EDGES, HEX_FACES, TET_EDGES
from tribodyn.geometry.sources import deck
from tribodyn.geometry.sources.card_table import SkippedCards
from tribodyn.geometry.sources.directions import Directions
from tribodyn.refusal import Refusal

Face = tuple[int, ...]


@dataclass(frozen=True)
class Cells:
    """Elements of one kind. kind : meshio's name; nodes : (n, k) rows of the points; labels : (n,) their numbers

    formulations : of each, where they have eight nodes and the file names it"""

    kind: str
    nodes: np.ndarray
    labels: np.ndarray
    formulations: Sequence[str] = ()


@dataclass(frozen=True)
class RawMesh:
    """points : (n, 3) in the file's unit of length; labels : (n,) node numbers in the file; cells : volume elements
    volumes : group -> element numbers, counted through all blocks of `cells`
    faces : group -> list of (k, 3) and (k, 4) corner nodes, in cyclic order
    nodes : group -> rows of `points`; bodies : names of volume groups that the file calls bodies
    skins : names of node groups that may stand for a face
    points_of_reference : name -> (3,) points that belong to no element
    unused : one clause for each thing that was met and changes nothing here; notes : what a user should know
    refused : name of a card or element -> clause, which would change stiffness, mass, support or load"""

    points: np.ndarray
    labels: np.ndarray
    cells: Sequence[Cells]
    volumes: Mapping[str, np.ndarray] = field(default_factory=dict)
    faces: Mapping[str, Sequence[np.ndarray]] = field(default_factory=dict)
    nodes: Mapping[str, np.ndarray] = field(default_factory=dict)
    bodies: Sequence[str] = ()
    skins: frozenset[str] = frozenset()
    points_of_reference: Mapping[str, np.ndarray] = field(default_factory=dict)
    deck: deck.Deck = field(default_factory=deck.Deck)
    unused: Sequence[str] = ()
    notes: Sequence[str] = ()
    refused: Mapping[str, str] = field(default_factory=dict)


NOTHING = RawMesh(np.empty((0, 3)), np.empty(0, dtype=int), ())
"""Of a file without solids."""


Terms = list[tuple[int, int, float]]
"""Displacements that are summed: label of a node, axis 0..5, factor."""


@dataclass
class LabelledMesh:
    """Labelled nodes and elements of a file while it is read, for formats whose groups are lists of labels.

    skipped : its cards that are not read; points : label -> (3,); volumes, node_sets : groups by label
    solids : kind -> its elements, label and nodes by label
    frames : label -> the directions along which displacements of that node count, x, y, z for others
    formulations : label of an 8-node element -> its formulation, others have incompatible modes
    prescribed : (axis, value) -> nodes that are held there; equations, springs : terms, and a stiffness"""

    skipped: SkippedCards
    points: dict[int, list[float]] = field(default_factory=dict)
    solids: dict[str, list[tuple[int, list[int]]]] = field(default_factory=dict)
    element_labels: set[int] = field(default_factory=set)
    volumes: dict[str, list[int]] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    frames: dict[int, Directions] = field(default_factory=dict)
    prescribed: dict[tuple[int, float], dict[int, None]] = field(default_factory=dict)
    equations: list[Terms] = field(default_factory=list)
    springs: list[tuple[Terms, float]] = field(default_factory=list)
    forces: list[deck.Force] = field(default_factory=list)
    couplings: list[deck.Coupling] = field(default_factory=list)
    masses: list[deck.PointMass] = field(default_factory=list)
    formulations: dict[int, str] = field(default_factory=dict)

    def point(self, label: int, place: list[float]) -> None:
        """A node; raises Refusal for a second one elsewhere."""
        if self.points.setdefault(label, place) != place:
            raise Refusal(f"two nodes have the number {label}, at different places: take one out")

    def solid(self, kind: str, label: int, nodes: list[int], group: str) -> None:
        """An element and the volume group of its property; raises Refusal for a second one of its number."""
        if label in self.element_labels:
            raise Refusal(f"two elements have the number {label}: take one out")
        self.element_labels.add(label)
        self.solids.setdefault(kind, []).append((label, nodes))
        self.volumes.setdefault(group, []).append(label)

    def at(self, label: int) -> str:
        """Group of one node, made for a card that names it by its number."""
        self.node_sets[f"node {label}"] = [label]
        return f"node {label}"

    def hold(self, label: int, axes: Iterable[int], value: float = 0.0) -> None:
        """A support of a node."""
        for axis in axes:
            self.prescribed.setdefault((axis, value), {})[label] = None

    def force(self, label: int, axis: int, value: float) -> None:
        """A force, or a moment, along a displacement of a node."""
        self.forces += [
            deck.Force(place, along_axis, value * factor)
            for place, along_axis, factor in self._terms([(label, axis, 1.0)])
        ]

    def couple(self, card: str, kind: str, point: int, members: list[int], axes: Sequence[int] = range(6)) -> None:
        """Nodes that a point carries, or that carry a point."""
        group = f"{card} {len(self.couplings) + 1}"
        self.node_sets[group] = members
        self.couplings.append(deck.Coupling(group, kind, self.at(point), group, tuple(axes)))

    def _terms(self, terms: Terms) -> tuple[tuple[str, int, float], ...]:
        """Terms by groups, along x, y, z."""
        group_terms = []
        for label, axis, factor in terms:
            if label not in self.points:
                raise Refusal(f"node {label} is named, which the file has not: it is cut off")
            row = np.eye(3)[axis % 3]
            if label in self.frames:
                row = self.frames[label].at(np.array([self.points[label]]))[0][axis % 3]
            used_axes = np.flatnonzero(np.abs(row) > 1e-12).tolist()
            group_terms += [(self.at(label), axis - axis % 3 + k, factor * float(row[k])) for k in used_axes]
        return tuple(group_terms)

    def _supports(self, solid: set[int]) -> Iterator[deck.Support]:
        """Supports of groups: nodes that are held alike are one, and what lies between them is held too."""
        places: dict[tuple[int, ...], str] = {}
        for (axis, value), labels in self.prescribed.items():
            nodes_by_frame: dict[int, tuple[Directions | None, list[int]]] = {}
            first = axis - axis % 3
            for label in labels:
                frame = self.frames.get(label)
                if not value and all(label in self.prescribed.get((first + k, 0.0), ()) for k in range(3)):
                    frame = None  # held along all of them
                if label in solid:
                    nodes_by_frame.setdefault(id(frame), (frame, []))[1].append(label)
                elif label in self.points:
                    yield deck.Support(self.at(label), axis, value, frame)
                else:
                    self.skipped.ignored["supports of nodes that the file has not"] += 1
            for frame, members in nodes_by_frame.values():
                place = places.setdefault(tuple(sorted(members)), f"support {len(places) + 1}")
                self.node_sets[place] = members
                yield deck.Support(place, axis, value, frame)

    def raw(self, path: Path, materials: tuple[deck.DeckMaterial, ...]) -> RawMesh:
        """The mesh, with its materials and all else that was read.

        Raises  Refusal: an element, or a constraint, that names a node that is not there"""
        if not self.solids:
            return NOTHING
        labels_of_solids = {node for elements in self.solids.values() for _, nodes in elements for node in nodes}
        for coupling in self.couplings:
            if not labels_of_solids.issuperset(self.node_sets[coupling.face]):
                self.skipped.refuse(f"{coupling.name.split()[0]} of nodes that belong to no solid")
        content = deck.Deck(
            materials=materials,
            couplings=tuple(self.couplings),
            equations=tuple(deck.DeckEquation(self._terms(terms)) for terms in self.equations),
            springs=tuple(deck.DeckSpring(self._terms(terms), value) for terms, value in self.springs),
            forces=tuple(self.forces),
            supports=tuple(self._supports(labels_of_solids)),
            masses=tuple(self.masses),
        )
        row = {label: i for i, label in enumerate(self.points)}
        cells: list[Cells] = []
        number: dict[int, int] = {}
        for kind, elements in self.solids.items():
            try:
                table = np.array([[row[node] for node in nodes] for _, nodes in elements])
            except KeyError as lost:
                raise Refusal(
                    f"'{path}' has an element with node {lost.args[0]}, which it has not: the file is cut off"
                ) from None
            number |= {label: len(number) + i for i, (label, _) in enumerate(elements)}
            labels_of_kind = [label for label, _ in elements]
            forms = [self.formulations.get(label, "linear_incompatible") for label in labels_of_kind]
            cells.append(Cells(kind, table, np.array(labels_of_kind), forms if kind == "hexahedron" else ()))
        solid = np.zeros(len(row), dtype=bool)
        for block in cells:
            solid[block.nodes] = True
        where = np.array(list(self.points.values()), dtype=float)
        rows = {name: np.unique([row[at] for at in labels if at in row]) for name, labels in self.node_sets.items()}
        lone_points = {name for name, in_group in rows.items() if len(in_group) == 1 and not solid[in_group[0]]}
        volumes = {name: [number[at] for at in labels if at in number] for name, labels in self.volumes.items()}
        unused = self.skipped.unused()
        for name, labels in self.node_sets.items():
            if missing := sum(label not in row for label in labels):
                unused.append(f"{missing} nodes of group '{name}', which the file has not")
        return RawMesh(
            where,
            np.array(list(row)),
            cells,
            {name: np.unique(members) for name, members in volumes.items() if members},
            {},
            {name: in_group for name, in_group in rows.items() if len(in_group) and name not in lone_points},
            skins=frozenset(name for name, in_group in rows.items() if len(in_group) > 2),
            points_of_reference={name: where[rows[name][0]] for name in lone_points},
            deck=content,
            unused=unused,
            refused=self.skipped.refused,
        )


@dataclass(frozen=True)
class Solid:
    """edges : the two corners of each; faces : corners of each in cyclic order, triangles and quadrilaterals"""

    corners: int
    edges: tuple[tuple[int, int], ...]
    faces: tuple[Face, ...]

    @property
    def quads(self) -> tuple[Face, ...]:
        """The faces with four corners."""
        return tuple(face for face in self.faces if len(face) == 4)


TETRA = Solid(4, TET_EDGES, ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)))
HEXA = Solid(8, HEX_EDGES, HEX_FACES)
WEDGE = Solid(
    6,
    ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    ((0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
)
PYRAMID = Solid(
    5,
    ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
    ((0, 1, 2, 3), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
)

# kind -> (its solid, whether it has edge nodes, whether it has nodes in its quadrilateral faces, in its middle)
VOLUMES: dict[str, tuple[Solid, bool, bool, bool]] = {
    "tetra": (TETRA, False, False, False),
    "tetra10": (TETRA, True, False, False),
    "hexahedron": (HEXA, False, False, False),
    "hexahedron20": (HEXA, True, False, False),
    "hexahedron27": (HEXA, True, True, True),
    "wedge": (WEDGE, False, False, False),
    "wedge15": (WEDGE, True, False, False),
    "wedge18": (WEDGE, True, True, False),
    "pyramid": (PYRAMID, False, False, False),
    "pyramid13": (PYRAMID, True, False, False),
    "pyramid14": (PYRAMID, True, True, False),
}
# kind -> its corners
SURFACES = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}
COMMON_NAMES = {"tetra": "tetrahedra", "hexahedron": "hexahedra", "wedge": "prisms", "pyramid": "pyramids"}
