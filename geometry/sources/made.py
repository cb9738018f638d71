"""Labels of nodes and elements -> a `RawMesh`, for formats whose groups are lists of labels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from tribodyn.geometry.sources.deck import Deck
from tribodyn.geometry.sources.raw import Cells, RawMesh


def assembled(
    path: Path,
    points: Mapping[int, Sequence[float]],
    blocks: Sequence[tuple[str, Sequence[int], Sequence[Sequence[int]]]],
    volumes: Mapping[str, Sequence[int]],
    node_sets: Mapping[str, Sequence[int]],
    deck: Deck,
    unused: Sequence[str] = (),
) -> RawMesh:
    """The mesh of labelled nodes and elements.

    blocks : kind, labels, nodes by label; volumes, node_sets : groups by label
    Raises  ValueError: an element that names a node that is not there
    """
    row = {label: i for i, label in enumerate(points)}
    cells: list[Cells] = []
    number: dict[int, int] = {}
    for kind, labels, nodes in blocks:
        try:
            table = np.array([[row[node] for node in element] for element in nodes])
        except KeyError as lost:
            raise ValueError(
                f"'{path}' has an element with node {lost.args[0]}, which it has not: the file is cut off"
            ) from None
        number |= {label: len(number) + i for i, label in enumerate(labels)}
        cells.append(Cells(kind, table, np.array(labels)))
    solid = np.zeros(len(points), dtype=bool)
    for block in cells:
        solid[block.nodes] = True
    where = np.array(list(points.values()), dtype=float)
    rows = {name: np.unique([row[label] for label in labels if label in row]) for name, labels in node_sets.items()}
    alone = {name for name, found in rows.items() if len(found) == 1 and not solid[found[0]]}
    missing = [
        f"{sum(label not in row for label in labels)} nodes of group '{name}', which the file has not"
        for name, labels in node_sets.items()
        if any(label not in row for label in labels)
    ]
    return RawMesh(
        where,
        np.array(list(points)),
        cells,
        {
            name: np.unique([number[label] for label in labels if label in number])
            for name, labels in volumes.items()
            if any(label in number for label in labels)
        },
        {},
        {name: found for name, found in rows.items() if len(found) and name not in alone},
        skins=frozenset(rows),
        points_of_reference={name: where[rows[name][0]] for name in alone},
        deck=deck,
        unused=[*unused, *missing],
    )
