"""Elements with all nodes of second order, and how they are cut into tetrahedra."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tribodyn.geometry.numbering import REFERENCE_POINTS, TET_EDGES
from tribodyn.geometry.sources.raw_mesh import HEXA, PYRAMID, TETRA, VOLUMES, WEDGE, Cells, Solid
from tribodyn.refusal import Refusal

_REFERENCE_CORNERS = {
    id(HEXA): REFERENCE_POINTS["hexahedron27"][:8],
    id(TETRA): REFERENCE_POINTS["tetra10"][:4],
    id(WEDGE): np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=float),
    id(PYRAMID): np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]], dtype=float),
}


@dataclass(frozen=True)
class Full:
    """Elements of one solid with all second-order nodes: corners, edges, quadrilateral faces, middle of a hexahedron.

    rows : (n, k) rows of the file's points, -1 for a node that the file has not; points : (n, k, 3)"""

    solid: Solid
    rows: np.ndarray
    points: np.ndarray


def supports(solid: Solid) -> list[tuple[int, ...]]:
    """For each node of a full element the corners at whose mean it lies."""
    middle = [tuple(range(8))] if solid is HEXA else []
    return [*((i,) for i in range(solid.corners)), *solid.edges, *solid.quads, *middle]


def full(cells: Cells, points: np.ndarray) -> Full:
    """Complete the nodes of elements; what is added does not change their shape.

    Source  serendipity shape functions at the middle of a face: corners -1/4, edges 1/2; of a hexahedron: -1/4, 1/4"""
    solid, has_edges, has_quads, has_middle = VOLUMES[cells.kind]
    n, n_corner, n_edge = len(cells.nodes), solid.corners, len(solid.edges)
    roles = supports(solid)
    rows = np.full((n, len(roles)), -1)
    rows[:, : cells.nodes.shape[1]] = cells.nodes  # meshio's order is this one: corners, edges, faces, middle
    positions = np.empty((n, len(roles), 3))
    n_given = cells.nodes.shape[1]
    positions[:, :n_given] = points[cells.nodes]
    corner = positions[:, :n_corner]
    if not has_edges:
        ends = np.array(solid.edges)
        positions[:, n_corner : n_corner + n_edge] = (corner[:, ends[:, 0]] + corner[:, ends[:, 1]]) / 2
    edge_of = {frozenset(edge): n_corner + i for i, edge in enumerate(solid.edges)}
    if has_edges:
        _check_between(solid, positions, cells)
    if not has_quads:
        for i, quad in enumerate(solid.quads):
            edges_of_quad = [edge_of[frozenset(pair)] for pair in zip(quad, quad[1:] + quad[:1], strict=True)]
            middle = positions[:, edges_of_quad].sum(axis=1) / 2 - corner[:, list(quad)].sum(axis=1) / 4
            positions[:, n_corner + n_edge + i] = middle
    if solid is HEXA and not has_middle:
        edges = positions[:, n_corner : n_corner + n_edge]
        positions[:, -1] = edges.sum(axis=1) / 4 - corner.sum(axis=1) / 4
    return Full(solid, rows, positions)


def _check_between(solid: Solid, positions: np.ndarray, cells: Cells) -> None:
    """Refuse edge nodes that lie nowhere near their edge: the file counts them in another order."""
    ends = np.array(solid.edges)
    a, b = positions[:, ends[:, 0]], positions[:, ends[:, 1]]
    middle = positions[:, solid.corners : solid.corners + len(ends)]
    off = np.linalg.norm(middle - (a + b) / 2, axis=2) > 0.5 * np.linalg.norm(b - a, axis=2)
    if off.any():
        label = cells.labels[off.any(axis=1).argmax()]
        raise Refusal(
            f"element {label} ({cells.kind}) has an edge node away from its edge: "
            "the nodes are in another order than the format's, or the mesh is folded"
        )


@dataclass(frozen=True)
class Pieces:
    """What full elements become: parent : (m,) the element of each piece; local : (m, k) its nodes, as places in the
    full element, in the order of tetra10 or hexahedron27"""

    parent: np.ndarray
    local: np.ndarray


def uncut(elements: Full) -> Pieces:
    """Hexahedra or tetrahedra as they are."""
    n, k = elements.rows.shape
    return Pieces(np.arange(n), np.broadcast_to(np.arange(k), (n, k)))


def tetrahedra(elements: Full) -> Pieces:
    """Each element cut into tetrahedra: from its corner of the lowest number to the faces that do not hold it."""
    solid = elements.solid
    if solid is TETRA:
        return uncut(elements)
    corner_rows = elements.rows[:, : solid.corners]
    lowest = corner_rows.argmin(axis=1)
    step = [1, 2, 3] if solid.corners in (4, 6) else [1, 3, 4]  # edges at the first corner
    edges = elements.points[:, step] - elements.points[:, :1]
    mirrored = np.linalg.det(edges).sum() < 0  # as VTK's prisms are
    place = {frozenset(support): i for i, support in enumerate(supports(solid))}
    parents, locals_ = [], []
    for apex in range(solid.corners):
        mine = np.flatnonzero(lowest == apex)
        for face in solid.faces:
            if apex in face or not len(mine):
                continue
            if len(face) == 3:
                cuts: list[tuple[np.ndarray, tuple[Any, ...]]] = [(mine, (face,))]
            else:
                a, b, c, d = face
                through_a = corner_rows[np.ix_(mine, np.array(face))].argmin(axis=1) % 2 == 0
                cuts = [(mine[through_a], ((a, b, c), (a, c, d))), (mine[~through_a], ((b, c, d), (b, d, a)))]
            for members, triangles in cuts:
                for triangle in triangles:
                    parents.append(members)
                    nodes = _ten_nodes(solid, (*triangle, apex), place, mirrored)
                    locals_.append(np.broadcast_to(nodes, (len(members), 10)))
    parent, local = np.concatenate(parents), np.vstack(locals_)
    order = parent.argsort(kind="stable")
    return Pieces(parent[order], local[order])


def cut_face(corners: np.ndarray) -> np.ndarray:
    """The two triangles (2 k, 3) of quadrilaterals (k, 4), cut as `tetrahedra` cuts them."""
    through_first = (corners.argmin(axis=1) % 2 == 0)[:, None]
    first = np.where(through_first, corners[:, [0, 1, 2]], corners[:, [1, 2, 3]])
    second = np.where(through_first, corners[:, [0, 2, 3]], corners[:, [1, 3, 0]])
    return np.vstack([first, second])


def _ten_nodes(solid: Solid, corners: tuple[int, ...], place: dict[frozenset[int], int], mirrored: bool) -> np.ndarray:
    """Places of the ten nodes of a tetrahedron of a full element, positively oriented."""
    at = _REFERENCE_CORNERS[id(solid)][list(corners)]
    if (np.linalg.det(at[1:] - at[0]) < 0) != mirrored:
        corners = (corners[1], corners[0], *corners[2:])
    middles = []
    for i, j in TET_EDGES:
        ends = {corners[i], corners[j]}
        on = place.get(frozenset(ends))
        if on is None:  # the diagonal of a face, or of the hexahedron
            on = next(place[frozenset(quad)] for quad in (*solid.quads, tuple(range(8))) if ends <= set(quad))
        middles.append(on)
    return np.array([*corners, *middles])
