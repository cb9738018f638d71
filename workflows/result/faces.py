"""The two faces of every contact on the mesh of its parts, and what wear takes off each of them.

The mesh of body 2 need not match that of body 1: a node between pairs wears as the polygon of pairs around it does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from tribodyn.workflows.result.result import PartMesh, Patch, Result, connected


@dataclass(frozen=True)
class Near:
    """When a node of the mesh belongs to a face of pairs.

    plane : how far above or below the plane of a polygon of pairs it may lie, of its size; inside : outside its edges
    none : a weight below this is none
    """

    plane: float = 0.05
    inside: float = 1e-4
    none: float = 1e-9


NEAR = Near()


@dataclass(frozen=True)
class Face:
    """One side of a contact on the mesh.

    points : (n_pair, 3) where the pairs lie on this side [m]
    outward : (n_pair, 3) unit normals out of the body
    nodes : (n_node,) nodes of the mesh on this side, those between the pairs too
    weights : (n_node, n_pair) by which what pairs have is interpolated at the nodes, sparse, rows add up to one
    share : of the total wear depth that is worn off this side
    turn : (3, 3) rotation by which the face meets body 1's, points @ turn, where its blade is not body 1's own
    """

    points: np.ndarray
    outward: np.ndarray
    nodes: np.ndarray
    weights: csr_matrix
    share: float
    turn: np.ndarray | None = None

    def worn_off(self, depth: np.ndarray, n_node: int) -> np.ndarray:
        """(n_node, 3) how far each node of the mesh is moved inward by a total depth (n_pair,) [m]."""
        moved = np.zeros((n_node, 3))
        moved[self.nodes] = self.weights @ (-self.share * np.asarray(depth)[:, None] * self.outward)
        return moved


@dataclass(frozen=True)
class Meeting:
    """Two faces that touch: a named contact, or the only one.

    name : of the contact, empty for the only one; pairs : of the result that are its own; patch : of these alone
    faces : body 1's, then body 2's where it is meshed too
    """

    name: str
    pairs: slice
    patch: Patch
    faces: tuple[Face, ...]


def meetings_of(result: Result) -> tuple[Meeting, ...]:
    """Every contact with the faces that the mesh of a result has; none without a mesh or without faces."""
    part, patch = result.part, result.patch
    if part is None or not len(patch.faces):
        return ()
    named = result.facts.joints or {"": slice(0, len(patch.area))}
    found = []
    for name, pairs in named.items():
        own = patch.of(pairs)
        if len(own.faces):
            found.append(Meeting("" if len(named) == 1 else name, pairs, own, _faces(result, part, own)))
    return tuple(found)


def _faces(result: Result, part: PartMesh, patch: Patch) -> tuple[Face, ...]:
    split, normal, none = result.facts.share_of_body_1, patch.frames[:, 2], np.zeros(0, int)
    first = _nodes(part, patch, patch.points, normal, none)
    own = first or (patch.nodes, csr_matrix(np.eye(len(patch.nodes))))
    across: list[tuple[np.ndarray, np.ndarray, np.ndarray | None]] = [(patch.points, -normal, None)]
    if (around := result.facts.around) is not None:
        across.append((around.sector(patch.points, 1), around.sector(-normal, 1), around.turn))
    for points, outward, turned in across:
        there = _nodes(part, patch, points, outward, own[0] if turned is None else none)
        if there is not None:
            return Face(patch.points, normal, *own, split), Face(points, outward, *there, 1 - split, turned)
    return (Face(patch.points, normal, *own, split),)


def worn_off(meetings: Sequence[Meeting], depth: np.ndarray, n_node: int) -> np.ndarray:
    """(n_node, 3) displacement of the nodes of the mesh by a total wear depth (n_pair,) on all faces [m]."""
    moved = np.zeros((n_node, 3))
    for one in meetings:
        for face in one.faces:
            moved += face.worn_off(np.asarray(depth)[one.pairs], n_node)
    return moved


def bodies(part: PartMesh) -> np.ndarray:
    """(n_node,) number of the connected piece of the mesh that each node belongs to, from 0; -1 where none does."""
    piece = connected(part.cells, len(part.points))
    found, used = np.full(len(piece), -1), np.unique(part.cells)
    found[used] = np.unique(piece[used], return_inverse=True)[1]
    return found


def _nodes(
    part: PartMesh, patch: Patch, points: np.ndarray, outward: np.ndarray, taken: np.ndarray
) -> tuple[np.ndarray, csr_matrix] | None:
    """Nodes of the mesh in the polygons of pairs at points that have elements behind the normals, without those taken.

    Returns the nodes and their weights (n_node, n_pair) of the pairs, None where there are no such nodes
    """
    polygons = patch.faces
    corner = points[polygons]
    middle, normal = corner.mean(axis=1), outward[polygons].mean(axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    size = np.linalg.norm(corner - middle[:, None], axis=2).max(axis=1)
    near = cKDTree(part.points).query_ball_point(middle, size * (1 + NEAR.plane))
    around = _elements(part, np.setdiff1d(np.concatenate([np.asarray(n, int) for n in near]), taken))
    elements = part.points[part.cells].mean(axis=1)
    found: dict[int, tuple[int, np.ndarray]] = {}
    for face, nodes in enumerate(near):
        here = np.array([n for n in nodes if n in around and n not in found], int)
        height = (part.points[here] - middle[face]) @ normal[face]
        here = here[np.abs(height) < NEAR.plane * size[face]]
        weights = _wachspress(corner[face], part.points[here], normal[face])
        for node, weight in zip(here, weights, strict=True):
            behind = (elements[around[int(node)]] - part.points[node]) @ normal[face] < 0
            if np.isfinite(weight).all() and behind.any():
                found[int(node)] = (face, np.where(weight < NEAR.none, 0.0, weight))
    found = _of_one_body(found, bodies(part), patch.face_of[polygons[:, 0]])
    if not found:
        return None
    rows = np.repeat(np.arange(len(found)), polygons.shape[1])
    columns = np.concatenate([polygons[face] for face, _ in found.values()])
    values = np.concatenate([weight / weight.sum() for _, weight in found.values()])
    weights = csr_matrix((values, (rows, columns)), shape=(len(found), len(points)))
    weights.eliminate_zeros()
    return np.array(list(found)), weights


def _of_one_body(
    found: dict[int, tuple[int, np.ndarray]], body: np.ndarray, part_of: np.ndarray
) -> dict[int, tuple[int, np.ndarray]]:
    """Without nodes of the other body, whose elements reach behind the face at its edges.

    part_of : (n_face,) connected part of the patch that each polygon belongs to
    """
    most: dict[int, int] = {}
    for number in set(part_of.tolist()):
        here = [body[node] for node, (face, _) in found.items() if part_of[face] == number]
        if here:
            most[number] = int(np.bincount(here).argmax())
    return {node: entry for node, entry in found.items() if body[node] == most[part_of[entry[0]]]}


def _elements(part: PartMesh, nodes: np.ndarray) -> dict[int, np.ndarray]:
    """Node -> the elements that it belongs to, of some nodes."""
    cell, corner = np.nonzero(np.isin(part.cells, nodes))
    node = part.cells[cell, corner]
    order = np.argsort(node, kind="stable")
    which, start = np.unique(node[order], return_index=True)
    return {int(n): own for n, own in zip(which, np.split(cell[order], start[1:]), strict=False)}


def _wachspress(corner: np.ndarray, points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Coordinates (n, n_corner) of points in a convex polygon, linear along its edges; nan for those outside.

    Source  Wachspress, A Rational Finite Element Basis, 1975, multiplied through by the areas at all edges
    """
    after = np.roll(corner, -1, axis=0)
    edge = after - corner
    area = np.einsum("ex,nex->ne", np.cross(normal, edge), points[:, None] - corner)  # twice that at each edge
    around = float(np.cross(np.roll(edge, 1, axis=0), edge).sum(axis=0) @ normal)
    sign = 1.0 if around > 0 else -1.0
    whole = np.abs(np.cross(np.roll(edge, 1, axis=0), edge) @ normal)
    area = sign * area
    outside = (area < -NEAR.inside * whole.sum()).any(axis=1)
    area = np.maximum(area, 0.0)
    n = len(corner)
    weights = np.stack(
        [whole[i] * np.prod([area[:, j] for j in range(n) if j not in (i, (i - 1) % n)], axis=0) for i in range(n)], 1
    )
    total = weights.sum(axis=1, keepdims=True)
    return np.where(outside[:, None] | (total <= 0), np.nan, weights / np.where(total > 0, total, 1.0))
