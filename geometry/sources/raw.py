"""A mesh as a file says it, before it becomes bodies: nodes, elements of any kind, groups. Every reader gives this."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from tribodyn.geometry.sources.deck import Deck


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
    unused : one clause for each thing that was met and has no use here; said : what a user should know
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
    said: Sequence[str] = ()
