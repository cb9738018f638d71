"""A mesh as it is in a file, before it becomes bodies: nodes, elements of any kind, groups. Every reader gives this."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tribodyn.geometry.sources.deck import Deck, Support


@dataclass(frozen=True)
class Cells:
    """Elements of one kind. kind : meshio's name; nodes : (n, k) rows of the points; labels : (n,) their numbers"""

    kind: str
    nodes: np.ndarray
    labels: np.ndarray


@dataclass(frozen=True)
class RawMesh:
    """points : (n, 3) in the file's unit of length; labels : (n,) node numbers in the file; cells : volume elements
    volumes : group -> element numbers, counted through all blocks of `cells`
    faces : group -> list of (k, 3) and (k, 4) corner nodes, in cyclic order
    nodes : group -> rows of `points`; bodies : those of `volumes` that the file calls bodies
    skins : those of `nodes` that may stand for a face
    points_of_reference : name -> (3,) points that belong to no element
    unused : one clause for each thing that was met and changes nothing here; notes : what a user should know
    refused : name of a card or element -> clause, which would change stiffness, mass, support or load
    """

    points: np.ndarray
    labels: np.ndarray
    cells: Sequence[Cells]
    volumes: Mapping[str, np.ndarray] = field(default_factory=dict)
    faces: Mapping[str, Sequence[np.ndarray]] = field(default_factory=dict)
    nodes: Mapping[str, np.ndarray] = field(default_factory=dict)
    bodies: Sequence[str] = ()
    skins: frozenset[str] = frozenset()
    points_of_reference: Mapping[str, np.ndarray] = field(default_factory=dict)
    deck: Deck = field(default_factory=Deck)
    unused: Sequence[str] = ()
    notes: Sequence[str] = ()
    refused: Mapping[str, str] = field(default_factory=dict)


NOTHING = RawMesh(np.empty((0, 3)), np.empty(0, dtype=int), ())
"""Of a file without solids."""


def listed(counts: Mapping[str, int]) -> str:
    """Names with how often each was met, as a clause."""
    return ", ".join(f"{name} ({count})" if count > 1 else name for name, count in counts.items())


@dataclass
class LabelledMesh:
    """Labelled nodes and elements of a file while it is read, for formats whose groups are lists of labels.

    points : label -> (3,); solids : kind -> its elements, label and nodes by label
    volumes, node_sets : groups by label; held : (axis, value) -> nodes that are held there
    ignored : cards and elements that have no use here
    """

    points: dict[int, list[float]] = field(default_factory=dict)
    solids: dict[str, list[tuple[int, list[int]]]] = field(default_factory=dict)
    volumes: dict[str, list[int]] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    held: dict[tuple[int, float], list[int]] = field(default_factory=dict)
    ignored: Counter[str] = field(default_factory=Counter)

    def solid(self, kind: str, label: int, nodes: list[int], group: str) -> None:
        """An element and the volume group of its property."""
        self.solids.setdefault(kind, []).append((label, nodes))
        self.volumes.setdefault(group, []).append(label)

    def at(self, label: int) -> str:
        """Group of one node, made for a card that names it by its number."""
        self.node_sets[f"node {label}"] = [label]
        return f"node {label}"

    def raw(self, path: Path, cards: str, deck: Deck) -> RawMesh:
        """The mesh, with the deck and the nodes that are held. cards : what the format calls its cards

        Raises  ValueError: an element that names a node that is not there
        """
        if not self.solids:
            return NOTHING
        places: dict[tuple[int, ...], str] = {}
        supports = []
        for (axis, value), labels in self.held.items():
            place = places.setdefault(tuple(sorted(labels)), f"support {len(places) + 1}")
            self.node_sets[place] = labels
            supports.append(Support(place, axis, value))
        row = {label: i for i, label in enumerate(self.points)}
        cells: list[Cells] = []
        number: dict[int, int] = {}
        for kind, elements in self.solids.items():
            try:
                table = np.array([[row[node] for node in nodes] for _, nodes in elements])
            except KeyError as lost:
                raise ValueError(
                    f"'{path}' has an element with node {lost.args[0]}, which it has not: the file is cut off"
                ) from None
            number |= {label: len(number) + i for i, (label, _) in enumerate(elements)}
            cells.append(Cells(kind, table, np.array([label for label, _ in elements])))
        solid = np.zeros(len(row), dtype=bool)
        for block in cells:
            solid[block.nodes] = True
        where = np.array(list(self.points.values()), dtype=float)
        rows = {name: np.unique([row[at] for at in labels if at in row]) for name, labels in self.node_sets.items()}
        alone = {name for name, found in rows.items() if len(found) == 1 and not solid[found[0]]}
        volumes = {name: [number[at] for at in labels if at in number] for name, labels in self.volumes.items()}
        unused = [f"{cards} {listed(self.ignored)}"] if self.ignored else []
        for name, labels in self.node_sets.items():
            if missing := sum(label not in row for label in labels):
                unused.append(f"{missing} nodes of group '{name}', which the file has not")
        return RawMesh(
            where,
            np.array(list(row)),
            cells,
            {name: np.unique(members) for name, members in volumes.items() if members},
            {},
            {name: found for name, found in rows.items() if len(found) and name not in alone},
            skins=frozenset(rows),
            points_of_reference={name: where[rows[name][0]] for name in alone},
            deck=replace(deck, supports=tuple(supports)),
            unused=unused,
        )
