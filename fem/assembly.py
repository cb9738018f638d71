"""Several bodies in one numbering of nodes, elements and facets.

A body keeps its own mesh; the assembly only adds where its numbers start, so that bodies of different elements stand
side by side. Groups of a body are known as "body.group". What works on one mesh works on an assembly through `pieces`.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tribodyn.fem.material import AnyMaterial
from tribodyn.refusal import Refusal

Materials = AnyMaterial | Mapping[str, AnyMaterial]


@dataclass(frozen=True)
class Body:
    """name : unique in an assembly, may be empty for an only body, whose groups then keep their names;
    mesh, node_sets : as geometry.mesh.read gives them; material : one, or by subdomain
    notes : sentences on conversions of its file, and on its unused content"""

    name: str
    mesh: Any
    node_sets: Mapping[str, np.ndarray]
    material: Materials
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Piece:
    """A mesh, and the first numbers of its nodes, elements and facets in the assembly."""

    mesh: Any
    node: int = 0
    element: int = 0
    facet: int = 0


class Assembly:
    """Bodies side by side, and reference points that no body owns.

    points : (n_point, 3) reference points [m]; each counts as two nodes, the first for its translation, the second for
        its rotation [rad] about x, y, z
    doflocs, boundaries, subdomains, nelements : as of a mesh; facets and elements are numbered body by body
    node_sets : "body.group", see `group_name`, -> nodes; "body" -> all nodes of a body; "point" and "point.turn" of a
        reference point
    Raises  Refusal where two bodies have one name"""

    def __init__(self, bodies: Sequence[Body], points: Mapping[str, Sequence[float]] | None = None):
        names = [body.name for body in bodies]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice or not names:
            raise Refusal(f"bodies.{twice[0]} is there twice: give each body its own name" if twice else "no body")
        self.bodies = tuple(bodies)
        counts = [(b.mesh.doflocs.shape[1], b.mesh.t.shape[1], b.mesh.facets.shape[1]) for b in bodies]
        starts = np.cumsum([(0, 0, 0), *counts], axis=0)
        self.pieces = tuple(Piece(b.mesh, *(int(n) for n in at)) for b, at in zip(bodies, starts, strict=False))
        self.nelements = int(starts[-1, 1])
        first = int(starts[-1, 0])
        places = {} if points is None else points
        self.points = {name: (first + 2 * i, first + 2 * i + 1) for i, name in enumerate(places)}
        at = np.repeat(np.array([*places.values()], dtype=float).reshape(-1, 3), 2, axis=0)
        self.doflocs = np.hstack([*(b.mesh.doflocs for b in bodies), at.T])
        self.node_sets: dict[str, np.ndarray] = {}
        self.boundaries: dict[str, np.ndarray] = {}
        self.subdomains: dict[str, np.ndarray] = {}
        for body, piece in zip(self.bodies, self.pieces, strict=True):
            if body.name:
                self.node_sets[body.name] = piece.node + np.arange(body.mesh.doflocs.shape[1])
                self.subdomains[body.name] = piece.element + np.arange(body.mesh.t.shape[1])
            for groups, shared, start in (
                (body.node_sets, self.node_sets, piece.node),
                (body.mesh.boundaries or {}, self.boundaries, piece.facet),
                (body.mesh.subdomains or {}, self.subdomains, piece.element),
            ):
                renamed = {
                    group_name(body.name, name, body.node_sets): np.asarray(members) + start
                    for name, members in groups.items()
                }
                shared.update(renamed)
        for name, (node, turn) in self.points.items():
            self.node_sets[name] = np.array([node])
            self.node_sets[f"{name}.turn"] = np.array([turn])

    @property
    def material(self) -> dict[str, Materials]:
        """Body -> its material."""
        return {body.name: body.material for body in self.bodies}


def group_name(body: str, group: str, groups: Container[str]) -> str:
    """Name of a group of a body in an assembly: "body.group"; a group that its deck names so already keeps its name.

    groups : of the body; where "group" is one of them too, "body.group" is that one's name"""
    inner = group.removeprefix(f"{body}.")
    return group if not body or (inner != group and inner not in groups) else f"{body}.{group}"


def pieces(mesh: Any) -> tuple[Piece, ...]:
    """The meshes of an assembly with their starts; a mesh is its own only piece."""
    return mesh.pieces if isinstance(mesh, Assembly) else (Piece(mesh),)


def materials_of(mesh: Any, material: Any) -> Iterator[tuple[Piece, Materials]]:
    """Every piece with its material. An assembly has one material for all, or a table body -> material."""
    for i, piece in enumerate(pieces(mesh)):
        named = isinstance(mesh, Assembly) and isinstance(material, Mapping)
        yield piece, material[mesh.bodies[i].name] if named else material


def piece_of_facets(mesh: Any, facets: np.ndarray) -> tuple[Piece, np.ndarray]:
    """The piece that some facets belong to, and their numbers in its mesh.

    Raises  Refusal where they belong to several bodies"""
    facets = np.asarray(facets, dtype=int)
    for piece in pieces(mesh):
        inside = (facets >= piece.facet) & (facets < piece.facet + piece.mesh.facets.shape[1])
        if inside.all():
            return piece, facets - piece.facet
        if inside.any():
            break
    raise Refusal("a face lies on several bodies; name the face of one body")
