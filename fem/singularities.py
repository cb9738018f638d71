"""Where linear elasticity has an infinite stress: places at which a finer mesh gives a larger one without end.

They follow from the surface of a part: re-entrant edges, borders of clamps and of contacts, supports and loads at
points. How fast stress grows there depends on the angle; with the border of a load nothing grows.
Source  Williams, J. Applied Mechanics 19 (1952) 526"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy

from tribodyn.fem.assembly import Piece, pieces
from tribodyn.fem.elements import connectivity, coordinates
from tribodyn.fem.part import Part
from tribodyn.fem.surface import facet_nodes

KINDS = ("", "the border of a contact", "a load at a point", "a support at a point", "the border of a clamp",
         "a re-entrant edge")  # fmt: skip
"""What stands at a node, the first for nothing; of several it is the last."""


@dataclass(frozen=True)
class _Skin:
    """The surface of a piece: its facets, and the edges between them.

    corners : (n, 4 or 3) nodes of the assembly; sides : (n, k) nodes between them, none of 4-node facets
    normals, centres : (n, 3); edge : (m, 2) nodes; between : (m, 2) the two facets of each"""

    corners: np.ndarray
    sides: np.ndarray
    normals: np.ndarray
    centres: np.ndarray
    edge: np.ndarray
    between: np.ndarray

    @classmethod
    def of(cls, piece: Piece) -> "_Skin":
        mesh, points = piece.mesh, coordinates(piece.mesh)
        facets = mesh.boundary_facets()
        nodes = facet_nodes(mesh, facets)
        k = mesh.facets.shape[0]
        corners, sides = nodes[:, :k], nodes[:, k : 2 * k]
        x = points[corners]
        normals = np.cross(x[:, 2] - x[:, 0], x[:, -1] - x[:, 1])
        body = points[mesh.t[:, mesh.f2t[0, facets]]].mean(axis=0)
        normals *= np.sign(np.einsum("fi,fi->f", normals, x.mean(axis=1) - body))[:, None]
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        pairs = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
        edge, of_pair, count = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
        order = np.argsort(of_pair.ravel(), kind="stable") // k
        first = np.cumsum(count) - count
        is_pair = count == 2
        between = np.stack([order[first[is_pair]], order[first[is_pair] + 1]], axis=1)
        at = piece.node
        return cls(corners + at, sides + at, normals, x.mean(axis=1), edge[is_pair] + at, between)

    def covered(self, is_member: np.ndarray) -> np.ndarray:
        """Facets (n,) whose corners or sides are all among the nodes (n_node,)."""
        sides = is_member[self.sides].all(axis=1) if self.sides.shape[1] else False
        return np.asarray(is_member[self.corners].all(axis=1) | sides)

    def border(self, is_member: np.ndarray) -> np.ndarray:
        """Nodes of the edges between facets that are covered and others."""
        covered = self.covered(is_member)[self.between]
        return np.unique(self.edge[covered[:, 0] != covered[:, 1]])

    def lone(self, is_member: np.ndarray) -> np.ndarray:
        """Nodes among them of no facet that is covered."""
        nodes, covered = np.concatenate([self.corners, self.sides], axis=1), self.covered(is_member)
        return np.setdiff1d(nodes[is_member[nodes]], nodes[covered])

    def reentrant(self, points: np.ndarray, sharp: float) -> np.ndarray:
        """Nodes of edges at which the surface turns towards the outside by more than an angle [rad]."""
        n, m = (self.normals[side] for side in self.between.T)
        rise = np.einsum("ei,ei->e", n, self.centres[self.between[:, 1]] - points[self.edge].mean(axis=1))
        turned = (rise > 0) & (np.einsum("ei,ei->e", n, m) < np.cos(sharp))
        return np.unique(self.edge[turned])


def singular_nodes(part: Part, sharp: float = np.radians(35)) -> np.ndarray:
    """What stands in the elements at each node (n_node,), as numbers of KINDS.

    sharp : angle between facets [rad] from which on a re-entrant edge is one, not a fillet of many facets"""
    corner = np.zeros(len(part.points), int)
    for number, nodes in _findings(part, sharp):
        corner[nodes] = np.maximum(corner[nodes], number)
    kind = np.zeros_like(corner)
    for piece in pieces(part.mesh):
        nodes = connectivity(piece.mesh) + piece.node
        np.maximum.at(kind, nodes, corner[nodes].max(axis=1, keepdims=True))
    return kind


def _findings(part: Part, sharp: float) -> Iterator[tuple[int, np.ndarray]]:
    """Yield numbers of KINDS and nodes."""
    points, distance = part.points, np.full(len(part.points), np.inf)
    skins = [_Skin.of(piece) for piece in pieces(part.mesh)]
    if part.interface.n_pair:
        distance = np.asarray(scipy.spatial.cKDTree(part.interface.points).query(points)[0])
    touched = np.less(distance, 1e-6 * float(np.linalg.norm(np.ptp(points, axis=0))))
    moved = part.free if part.dependence is None else np.flatnonzero(np.diff(part.dependence.indptr))
    is_held = np.ones((len(points), 3), bool)
    is_held.ravel()[moved] = False
    for skin in skins:
        border = skin.border(touched)
        yield 1, border
        for other in skins if len(border) else ():
            distance, node = scipy.spatial.cKDTree(points[np.unique(other.corners)]).query(points[border])
            yield 1, np.unique(other.corners)[node[distance < np.linalg.norm(np.ptp(points[skin.edge[0]], axis=0))]]
    for skin in skins:
        for load in part.system.loads.values():
            force = np.zeros(3 * len(points))
            force[part.free] = load
            force = np.abs(force).reshape(-1, 3).max(axis=1)
            yield 2, skin.lone((force > 1e-9 * force.max()) | is_held.any(axis=1))
        for axis in range(3):
            yield 3, skin.lone(is_held[:, axis])
        yield 4, skin.border(np.all(is_held, axis=1))
        yield 5, skin.reentrant(points, sharp)
