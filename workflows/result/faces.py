"""The two faces of a contact on the mesh of its parts, and what wear takes off each of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tribodyn.fem.cyclic import rotation
from tribodyn.workflows.result.result import PartMesh, Patch, Result

SAME_PLACE = 1e-5  # of the size of the patch: two nodes of a closed pair


@dataclass(frozen=True)
class Face:
    """One side of a contact on the mesh.

    nodes : (n_pair,) node of the mesh at each pair
    outward : (n_pair, 3) unit normals out of the body
    share : of the total wear depth that is worn off this side
    turn : (3, 3) rotation by which the face meets body 1's, points @ turn, where its blade is not body 1's own
    between : a node, and the pairs that it lies in the middle of, where pairs stand at corners only
    """

    nodes: np.ndarray
    outward: np.ndarray
    share: float
    turn: np.ndarray | None = None
    between: tuple[tuple[int, np.ndarray], ...] = ()

    def worn_off(self, depth: np.ndarray, n_node: int) -> np.ndarray:
        """(n_node, 3) how far each node of the mesh is moved inward by a total depth (n_pair,) [m]."""
        moved = np.zeros((n_node, 3))
        along = -self.share * np.asarray(depth)[:, None] * self.outward
        for node, pairs in self.between:
            moved[node] = along[pairs].mean(axis=0)
        moved[self.nodes] = along
        return moved


def faces_of(result: Result) -> tuple[Face, ...]:
    """The faces that the mesh of a result has: body 1's, then body 2's where it is meshed too; none without a mesh."""
    part, patch = result.part, result.patch
    if part is None or patch is None or not len(patch.faces):
        return ()
    split = result.facts.share_of_body_1
    first, second = _nodes_on_both_sides(part, patch)
    faces = [Face(first, patch.frames[:, 2], split, between=_between(part, patch, first))]
    if second is not None:
        faces.append(Face(second, -patch.frames[:, 2], 1 - split, between=_between(part, patch, second)))
    elif (around := result.facts.around) is not None:
        x, y, z = around.axis
        turn = rotation((x, y, z), 2 * np.pi / around.sectors)
        left = patch.moved(part.points, patch.points @ turn.T, -patch.frames @ turn.T)
        between = _between(part, left, left.nodes)
        faces.append(Face(left.nodes, left.frames[:, 2], 1 - split, turn, between))
    return tuple(faces)


def worn_off(faces: tuple[Face, ...], depth: np.ndarray, n_node: int) -> np.ndarray:
    """(n_node, 3) displacement of the nodes of the mesh by a total wear depth (n_pair,) on all faces [m]."""
    return np.sum([np.zeros((n_node, 3)), *(face.worn_off(depth, n_node) for face in faces)], axis=0)


def bodies(part: PartMesh) -> np.ndarray:
    """(n_node,) number of the connected piece of the mesh that each node belongs to, from 0."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    n = len(part.points)
    first = np.repeat(part.cells[:, 0], part.cells.shape[1])
    links = coo_matrix((np.ones(part.cells.size), (first, part.cells.ravel())), shape=(n, n))
    return np.asarray(connected_components(links, directed=False)[1])


def _nodes_on_both_sides(part: PartMesh, patch: Patch) -> tuple[np.ndarray, np.ndarray | None]:
    """The nodes at the pairs whose elements lie behind the normals of body 1, and those that lie before them."""
    size = float(np.linalg.norm(np.ptp(patch.points, axis=0)))
    side = _side_of_elements(part, patch, size)
    found = cKDTree(part.points).query_ball_point(patch.points, SAME_PLACE * size)
    first, second = patch.nodes.copy(), np.full(len(patch.nodes), -1)
    for pair, nodes in enumerate(found):
        behind = [n for n in nodes if side[pair].get(n, 0) < 0]
        before = [n for n in nodes if side[pair].get(n, 0) > 0]
        if behind:
            first[pair] = behind[0]
        if before:
            second[pair] = before[0]
    return first, None if (second < 0).any() else second


def _side_of_elements(part: PartMesh, patch: Patch, size: float) -> list[dict[int, float]]:
    """For each pair: node near it -> how far along the normal of body 1 the middles of the node's elements lie."""
    near = cKDTree(part.points).query_ball_point(patch.points, SAME_PLACE * size)
    wanted = np.unique(np.concatenate([np.asarray(n, int) for n in near]))
    middle = part.points[part.cells].mean(axis=1)
    cell, _ = np.nonzero(np.isin(part.cells, wanted))
    node = part.cells[np.isin(part.cells, wanted)]
    total, count = np.zeros((len(part.points), 3)), np.zeros(len(part.points))
    np.add.at(total, node, middle[cell])
    np.add.at(count, node, 1)
    mean = total / np.maximum(count, 1)[:, None]
    return [
        {n: float((mean[n] - patch.points[pair]) @ patch.frames[pair, 2]) for n in nodes}
        for pair, nodes in enumerate(near)
    ]


def _between(part: PartMesh, patch: Patch, nodes: np.ndarray) -> tuple[tuple[int, np.ndarray], ...]:
    """Nodes of the face in the middle of an edge or of a face between pairs, of the same elements as the pairs."""
    size = float(np.linalg.norm(np.ptp(patch.points, axis=0)))
    around = part.cells[np.isin(part.cells, nodes).any(axis=1)]
    candidates = np.setdiff1d(around, nodes)
    if not len(candidates):
        return ()
    tree = cKDTree(part.points[candidates])
    corners = patch.faces
    groups = [*(np.stack([corners[:, i], corners[:, i - 1]], axis=1) for i in range(corners.shape[1])), corners]
    found: dict[int, np.ndarray] = {}
    for group in groups:
        distance, near = tree.query(patch.points[group].mean(axis=1))
        for k in np.flatnonzero(distance < SAME_PLACE * size):
            found.setdefault(int(candidates[near[k]]), group[k])
    return tuple(found.items())
