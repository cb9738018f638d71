"""The two faces of every contact on the mesh of its parts, and what wear takes off each of them.

The mesh of body 2 need not match that of body 1: a node between pairs wears as the polygon of pairs around it does."""

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
    none : a weight below this is none"""

    plane: float = 0.05
    inside: float = 1e-4
    none: float = 1e-9


TOLERANCES = Near()


@dataclass(frozen=True)
class Face:
    """One side of a contact on the mesh.

    points : (n_pair, 3) where the pairs lie on this side [m]
    outward : (n_pair, 3) unit normals out of the body
    nodes : (n_node,) nodes of the mesh on this side, those between the pairs too
    weights : (n_node, n_pair) by which what pairs have is interpolated at the nodes, sparse, rows add up to one
    share : of the total wear depth that is worn off this side
    turn : (3, 3) rotation by which the face meets body 1's, points @ turn, where its blade is not body 1's own"""

    points: np.ndarray
    outward: np.ndarray
    nodes: np.ndarray
    weights: csr_matrix
    share: float
    turn: np.ndarray | None = None

    def worn_off(self, depth: np.ndarray, n_node: int) -> np.ndarray:
        """(n_node, 3) how far each node of the mesh is moved inward by a total depth (n_pair,) [m]."""
        displacement = np.zeros((n_node, 3))
        displacement[self.nodes] = self.weights @ (-self.share * np.asarray(depth)[:, None] * self.outward)
        return displacement


@dataclass(frozen=True)
class Meeting:
    """Two faces that touch: a named contact, or the only one.

    name : of the contact, empty for the only one; pairs : of the result that are its own; patch : of these alone
    faces : body 1's, then body 2's where it is meshed too"""

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
    meetings = []
    for name, pairs in named.items():
        patch_of_pairs = patch.of(pairs)
        if len(patch_of_pairs.faces):
            meetings.append(
                Meeting("" if len(named) == 1 else name, pairs, patch_of_pairs, _faces(result, part, patch_of_pairs))
            )
    return tuple(meetings)


def _faces(result: Result, part: PartMesh, patch: Patch) -> tuple[Face, ...]:
    split, normal, none = result.facts.share_of_body_1, patch.frames[:, 2], np.zeros(0, int)
    first = _nodes(part, patch, patch.points, normal, none)
    first_side = first or (patch.nodes, csr_matrix(np.eye(len(patch.nodes))))
    across: list[tuple[np.ndarray, np.ndarray, np.ndarray | None]] = [(patch.points, -normal, None)]
    if (wheel := result.facts.around) is not None:
        across.append((wheel.sector(patch.points, 1), wheel.sector(-normal, 1), wheel.turn))
    for points, outward, turned in across:
        second_side = _nodes(part, patch, points, outward, first_side[0] if turned is None else none)
        if second_side is not None:
            return Face(patch.points, normal, *first_side, split), Face(
                points, outward, *second_side, 1 - split, turned
            )
    return (Face(patch.points, normal, *first_side, split),)


def worn_off(meetings: Sequence[Meeting], depth: np.ndarray, n_node: int) -> np.ndarray:
    """(n_node, 3) displacement of the nodes of the mesh by a total wear depth (n_pair,) on all faces [m]."""
    displacement = np.zeros((n_node, 3))
    for meeting in meetings:
        for face in meeting.faces:
            displacement += face.worn_off(np.asarray(depth)[meeting.pairs], n_node)
    return displacement


def bodies(part: PartMesh) -> np.ndarray:
    """(n_node,) number of the connected piece of the mesh that each node belongs to, from 0; -1 where none does."""
    piece = connected(part.cells, len(part.points))
    body, used = np.full(len(piece), -1), np.unique(part.cells)
    body[used] = np.unique(piece[used], return_inverse=True)[1]
    return body


def _nodes(
    part: PartMesh, patch: Patch, points: np.ndarray, outward: np.ndarray, excluded: np.ndarray
) -> tuple[np.ndarray, csr_matrix] | None:
    """Nodes of the mesh in the polygons of pairs at points that have elements behind the normals, without those taken.

    Returns the nodes and their weights (n_node, n_pair) of the pairs, None where there are no such nodes"""
    polygons = patch.faces
    corner = points[polygons]
    middle, normal = corner.mean(axis=1), outward[polygons].mean(axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    size = np.linalg.norm(corner - middle[:, None], axis=2).max(axis=1)
    nodes_of_face = cKDTree(part.points).query_ball_point(middle, size * (1 + TOLERANCES.plane))
    elements_of_node = _elements(
        part, np.setdiff1d(np.concatenate([np.asarray(n, int) for n in nodes_of_face]), excluded)
    )
    elements = part.points[part.cells].mean(axis=1)
    face_of_node: dict[int, tuple[int, np.ndarray]] = {}
    for face, nodes in enumerate(nodes_of_face):
        candidates = np.array([n for n in nodes if n in elements_of_node and n not in face_of_node], int)
        height = (part.points[candidates] - middle[face]) @ normal[face]
        candidates = candidates[np.abs(height) < TOLERANCES.plane * size[face]]
        weights = _wachspress(corner[face], part.points[candidates], normal[face])
        for node, weight in zip(candidates, weights, strict=True):
            is_backed = (elements[elements_of_node[int(node)]] - part.points[node]) @ normal[face] < 0
            if np.isfinite(weight).all() and is_backed.any():
                face_of_node[int(node)] = (face, np.where(weight < TOLERANCES.none, 0.0, weight))
    face_of_node = _of_one_body(face_of_node, bodies(part), patch.face_of[polygons[:, 0]])
    if not face_of_node:
        return None
    rows = np.repeat(np.arange(len(face_of_node)), polygons.shape[1])
    columns = np.concatenate([polygons[face] for face, _ in face_of_node.values()])
    values = np.concatenate([weight / weight.sum() for _, weight in face_of_node.values()])
    weights = csr_matrix((values, (rows, columns)), shape=(len(face_of_node), len(points)))
    weights.eliminate_zeros()
    return np.array(list(face_of_node)), weights


def _of_one_body(
    face_of_node: dict[int, tuple[int, np.ndarray]], body: np.ndarray, part_of: np.ndarray
) -> dict[int, tuple[int, np.ndarray]]:
    """Without nodes of the other body, whose elements reach behind the face at its edges.

    part_of : (n_face,) connected part of the patch that each polygon belongs to"""
    body_of_part: dict[int, int] = {}
    for number in set(part_of.tolist()):
        bodies_of_face = [body[node] for node, (face, _) in face_of_node.items() if part_of[face] == number]
        if bodies_of_face:
            body_of_part[number] = int(np.bincount(bodies_of_face).argmax())
    return {node: entry for node, entry in face_of_node.items() if body[node] == body_of_part[part_of[entry[0]]]}


def _elements(part: PartMesh, nodes: np.ndarray) -> dict[int, np.ndarray]:
    """Node -> the elements that it belongs to, of some nodes."""
    cell, corner = np.nonzero(np.isin(part.cells, nodes))
    node = part.cells[cell, corner]
    order = np.argsort(node, kind="stable")
    numbers, start = np.unique(node[order], return_index=True)
    return {int(n): members for n, members in zip(numbers, np.split(cell[order], start[1:]), strict=False)}


def _wachspress(corner: np.ndarray, points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Coordinates (n, n_corner) of points in a convex polygon, linear along its edges; nan for those outside.

    Source  Wachspress, A Rational Finite Element Basis, 1975, multiplied through by the areas at all edges"""
    after = np.roll(corner, -1, axis=0)
    edge = after - corner
    area = np.einsum("ex,nex->ne", np.cross(normal, edge), points[:, None] - corner)  # twice that at each edge
    total_area = float(np.cross(np.roll(edge, 1, axis=0), edge).sum(axis=0) @ normal)
    sign = 1.0 if total_area > 0 else -1.0
    corner_area = np.abs(np.cross(np.roll(edge, 1, axis=0), edge) @ normal)
    area = sign * area
    outside = (area < -TOLERANCES.inside * corner_area.sum()).any(axis=1)
    area = np.maximum(area, 0.0)
    n = len(corner)
    weights = np.stack(
        [
            corner_area[i] * np.prod([area[:, j] for j in range(n) if j not in (i, (i - 1) % n)], axis=0)
            for i in range(n)
        ],
        1,
    )
    total = weights.sum(axis=1, keepdims=True)
    return np.where(outside[:, None] | (total <= 0), np.nan, weights / np.where(total > 0, total, 1.0))
