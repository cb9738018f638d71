"""Gauss points of the surface that two faces of different meshes share, and dual functions on it.

Facets of the second face are carried along the normal of a facet of the first one, cut with it, and Gauss points are
laid on the triangles of each cut. A flat facet is cut in its plane, which is exact for straight edges; a curved one in
its own reference coordinates, in which the cuts fill it without overlap.
Source  Puso and Laursen, Computer Methods in Applied Mechanics and Engineering 193, 2004 (segments); Popp, Wohlmuth,
    Gee and Wall, SIAM Journal on Scientific Computing 34, 2012 (second order, dual functions); Cichosz and Bischoff,
    Computer Methods in Applied Mechanics and Engineering 200, 2011 (dual functions on cut facets)"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from tribodyn.fem.assembly import piece_of_facets
from tribodyn.fem.elements import coordinates
from tribodyn.fem.facet_cuts import clip_polygons, locate_on_facets, polygon_areas, reference_corners, tangent_planes
from tribodyn.fem.surface import facet_nodes, require_outside, tabulate
from tribodyn.geometry.element_library import skfem


@dataclass(frozen=True)
class MortarOptions:
    """Limits of the cuts of two faces, relative but for orders and counts.

    reach : default of the farthest opening at which faces meet or a tie bridges, over the length of the first face
    curved : bulge of a facet, over its size, from which on it counts as curved; just above rounding
    edge_pieces : straight pieces that stand for a curved edge
    flat_order, curved_order : of the rule in a triangle; 8 is exact for products of two nine-node shape functions
    facing : cosine between directions from which on they look the same way; facets that face each other have less than
        its negative, which keeps the rims of bores and rounded edges out
    sliver : part of a facet that is too small to be a cut
    full : part of a facet that counts as all of it
    negligible : part of a point's own area that is too little to carry
    tied : part of it from which on a node is tied; less asks too much of the other face by extrapolation
    independent : least eigenvalue, of the largest possible 1, at which shape functions still differ on a cut facet
    rounding : gap that is rounding of node positions, over the length of the face
    separated : mean gap of two tied faces, over the length of the first, from which on they do not touch"""

    reach: float = 0.1
    curved: float = 1e-9
    edge_pieces: int = 6
    flat_order: int = 8
    curved_order: int = 12
    facing: float = 0.3
    sliver: float = 1e-10
    full: float = 1 - 1e-6
    negligible: float = 1e-6
    tied: float = 1e-3
    independent: float = 1e-7
    rounding: float = 1e-9
    separated: float = 5e-3


MORTAR = MortarOptions()


@dataclass(frozen=True)
class Side:
    """A face in space: nodes (n_facet, k), points (n_facet, k, 3) [m], corners first, then mid-sides, then middle;
    centre, normal : (n_facet, 3), the normal outward; sign : (n_facet,) that makes dx/dxi cross dx/deta outward
    turn : (3, 3) rotation about the origin that brought the mesh here; n_node : of the mesh"""

    nodes: np.ndarray
    points: np.ndarray
    centre: np.ndarray
    normal: np.ndarray
    sign: np.ndarray
    turn: np.ndarray
    n_node: int

    @property
    def corners(self) -> int:
        """Corners of a facet: 4 or 3."""
        return 4 if self.nodes.shape[1] in (9, 4) else 3

    @property
    def length(self) -> float:
        """Largest extent [m]."""
        return float(np.linalg.norm(np.ptp(self.points.reshape(-1, 3), axis=0)))

    @property
    def bulge(self) -> float:
        """How far mid-side and middle nodes lie off the plane and the straight edges of their corners, relative."""
        n = self.corners
        middles = self.points[:, n : 2 * n]
        edges = middles - (self.points[:, :n] + np.roll(self.points[:, :n], -1, axis=1))[:, : middles.shape[1]] / 2
        off = np.einsum("fkx,fx->fk", self.points - self.centre[:, None], self.normal)
        size = np.linalg.norm(self.points[:, 1] - self.points[:, 0], axis=1)
        return float((np.maximum(np.abs(edges).max(axis=(1, 2), initial=0.0), np.abs(off).max(axis=1)) / size).max())


def side(mesh: Any, facets: np.ndarray, rotation: np.ndarray | None = None) -> Side:
    """The side that some facets of one body make, turned by a rotation (3, 3) about the origin."""
    require_outside(mesh, facets)
    nodes = facet_nodes(mesh, facets)
    piece, local_facets = piece_of_facets(mesh, facets)
    points, inner = (
        coordinates(mesh)[nodes],
        piece.mesh.p[:, piece.mesh.t[:, piece.mesh.f2t[0, local_facets]]].mean(axis=1).T,
    )
    if rotation is not None:
        points, inner = points @ rotation.T, inner @ rotation.T
    n = 4 if isinstance(piece.mesh, skfem.MeshHex1) else 3
    centre = points[:, :n].mean(axis=1)
    middle = np.tile(np.full((2, 1), 0.5 if n == 4 else 1 / 3), len(nodes))
    _, slopes = tabulate(points.shape[1], middle)
    normal = np.cross(*np.einsum("aid,dax->idx", slopes, points))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    sign = np.sign(np.einsum("fx,fx->f", normal, centre - inner))
    turn = np.eye(3) if rotation is None else np.asarray(rotation, dtype=float)
    return Side(nodes, points, centre, normal * sign[:, None], sign, turn, mesh.doflocs.shape[1])


@dataclass(frozen=True)
class SharedSurface:
    """Gauss points of the surface that two sides share, cut by cut.

    first, second : (n,) facets; xi, eta : (2, n) places on them; weight : (n,) area [m2] on the first side
    normal : (n, 3) outward unit normal of the first side; gap : (n,) opening along it [m], negative where they overlap
    cuts : (n_cut + 1,) where the points of each cut begin; covered : (n_facet,) part of each facet of the first side"""

    first: np.ndarray
    second: np.ndarray
    xi: np.ndarray
    eta: np.ndarray
    weight: np.ndarray
    normal: np.ndarray
    gap: np.ndarray
    cuts: np.ndarray
    covered: np.ndarray

    def each(self) -> Iterator[tuple[int, int, slice]]:
        """Facets and points of every cut."""
        for start, stop in zip(self.cuts[:-1].tolist(), self.cuts[1:].tolist(), strict=True):
            yield int(self.first[start]), int(self.second[start]), slice(start, stop)


def shared_surface(first_side: Side, second_side: Side, reach: float) -> SharedSurface:
    """Gauss points of the surface on which two sides face each other.

    reach : farthest distance along the normal at which facets still meet [m]
    Returns the points, none where the sides do not meet"""
    i, j = _candidates(first_side, second_side, reach)
    if not len(i):
        none, pairs = np.zeros(0), np.zeros((2, 0))
        return SharedSurface(
            i, j, pairs, pairs, none, np.zeros((0, 3)), none, np.zeros(1, int), np.zeros(len(first_side.nodes))
        )
    frames = tangent_planes(first_side.normal)[i]
    curved = first_side.bulge > MORTAR.curved
    outline = _outline(second_side, second_side.bulge > MORTAR.curved)[j]
    corners = first_side.points[:, : first_side.corners]
    if curved:
        region = reference_corners(first_side.corners)[None].repeat(len(i), axis=0)
        m = outline.shape[1]
        s = locate_on_facets(first_side.points[i].repeat(m, 0), outline.reshape(-1, 3), frames.repeat(m, 0))
        subject = s.T.reshape(len(i), m, 2)
    else:
        region = np.einsum("pkx,pdx->pkd", corners[i] - first_side.centre[i][:, None], frames)
        subject = np.einsum("pkx,pdx->pkd", outline - first_side.centre[i][:, None], frames)
    facet_area = polygon_areas(region)
    region[facet_area < 0] = region[facet_area < 0][:, ::-1]
    polygon = clip_polygons(subject, region)
    is_cut = np.abs(polygon_areas(polygon)) > MORTAR.sliver * np.abs(facet_area)
    i, j, frames, polygon, facet_area = (
        i[is_cut],
        j[is_cut],
        frames[is_cut],
        polygon[is_cut],
        np.abs(facet_area[is_cut]),
    )

    X, w = skfem.quadrature.get_quadrature(skfem.ElementTriP1, MORTAR.curved_order if curved else MORTAR.flat_order)
    hub = polygon.mean(axis=1, keepdims=True)
    a, b = polygon - hub, np.roll(polygon, -1, axis=1) - hub
    twice = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    twice *= np.sign(twice.sum(axis=1, keepdims=True))
    pair, corner = np.nonzero(np.abs(twice) > MORTAR.sliver * facet_area[:, None])
    s = hub[pair, 0][:, None] + X[0][:, None] * a[pair, corner][:, None] + X[1][:, None] * b[pair, corner][:, None]
    weight = (twice[pair, corner][:, None] * w).ravel()
    s, of = s.reshape(-1, 2).T, np.repeat(pair, len(w))

    local = first_side.points[i[of]]
    if curved:
        xi = s
    else:
        e = frames[of]
        at = first_side.centre[i[of]] + s[0][:, None] * e[:, 0] + s[1][:, None] * e[:, 1]
        xi = locate_on_facets(local, at, e)
    N, slopes = tabulate(local.shape[1], xi)
    x = np.einsum("an,nax->nx", N, local)
    normal = np.cross(*np.einsum("ain,nax->inx", slopes, local)) * first_side.sign[i[of]][:, None]
    size = np.linalg.norm(normal, axis=1)
    if curved:
        weight = weight * size
    normal = normal / size[:, None]
    eta = locate_on_facets(second_side.points[j[of]], x, frames[of])
    y = np.einsum("an,nax->nx", tabulate(second_side.points.shape[1], eta)[0], second_side.points[j[of]])
    gap = np.einsum("nx,nx->n", y - x, normal)
    covered = np.bincount(i, np.abs(polygon_areas(polygon)) / facet_area, len(first_side.nodes))
    is_near = np.abs(gap) <= reach
    starts = np.append(np.flatnonzero(np.diff(of[is_near], prepend=-1)), is_near.sum())
    if not is_near.all():
        kept_weight = np.bincount(i[of], np.where(is_near, np.abs(weight), 0.0), len(first_side.nodes))
        full_weight = np.bincount(i[of], np.abs(weight), len(first_side.nodes))
        covered = covered * np.divide(kept_weight, full_weight, out=np.zeros_like(kept_weight), where=full_weight > 0)
    return SharedSurface(
        i[of][is_near], j[of][is_near], xi[:, is_near], eta[:, is_near], weight[is_near], normal[is_near], gap[is_near],
        starts, covered,
    )  # fmt: skip


def coefficients(k: int) -> np.ndarray:
    """The matrix (k, k) that makes Bernstein coefficients of the values at the nodes of a facet of k nodes.

    On every cut of a facet Bernstein polynomials have a positive integral, which shape functions have not: that of the
    corner of a six-node facet is zero. Those of first order are the shape functions"""
    line = np.array([[1, 0, 0], [0, 1, 0], [-0.5, -0.5, 2]])  # both ends and the middle of an edge
    if k == 9:
        i, j = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (1, 2), (2, 1), (0, 2), (2, 2)]).T
        return np.asarray(line[i[:, None], i] * line[j[:, None], j])
    matrix = np.eye(k)
    for middle in range(3, k if k == 6 else 0):
        matrix[middle, [middle - 3, (middle - 2) % 3, middle]] = line[2]
    return matrix


def dual(side: Side, shared: SharedSurface) -> tuple[np.ndarray, np.ndarray]:
    """Dual functions of the first side, times the weights of the points, and what each coefficient weighs.

    Returns psi (k, n) [m2] and d (n_facet, k) [m2] with sum(psi_a u) = d_a times the Bernstein coefficient a of u, for
        any u that the facet can take; both are integrals over what is covered, and psi sums to the weights, so that
        constant tractions are carried exactly. Where a cut is so thin that shape functions look alike on it, this
        holds for u that are linear in space, rigid motions among them"""
    k = side.nodes.shape[1]
    to = coefficients(k)
    N = np.linalg.inv(to).T @ tabulate(k, shared.xi)[0]
    offset = side.points - side.centre[:, None]
    offset /= np.abs(offset).max(axis=(1, 2), keepdims=True)
    affine = np.concatenate([np.ones((*side.nodes.shape, 1)), to @ offset], axis=2)
    starts = np.searchsorted(shared.first, np.arange(len(side.nodes) + 1))
    psi, d = np.zeros_like(N), np.zeros(side.nodes.shape)
    for i in np.unique(shared.first):
        g = slice(starts[i], starts[i + 1])
        sign, root = np.sign(shared.weight[g]), np.sqrt(np.abs(shared.weight[g]))  # below 0 in parts of a hollow cut
        b = N[:, g] * root
        d[i] = b @ (sign * root)
        scale = 1 / np.linalg.norm(b, axis=1)
        b *= scale[:, None]
        gram = (b * sign) @ b.T
        if np.linalg.eigvalsh(gram)[0] > MORTAR.independent * k:
            best = scale[:, None] * np.linalg.solve(gram, b)
        else:
            best = affine[i] @ np.linalg.pinv((affine[i].T @ (b / scale[:, None])).T, MORTAR.rounding) * sign
        psi[:, g] = d[i][:, None] * best * (sign * root)
    return psi, d


def _candidates(first_side: Side, second_side: Side, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of facets that may meet."""
    r_1, r_2 = (np.linalg.norm(s.points - s.centre[:, None], axis=2).max(axis=1) for s in (first_side, second_side))
    neighbours = scipy.spatial.cKDTree(second_side.centre).query_ball_point(first_side.centre, r_1 + r_2.max() + reach)
    i = np.repeat(np.arange(len(neighbours)), [len(n) for n in neighbours])
    j = np.concatenate([np.sort(np.asarray(n, dtype=int)) for n in neighbours]) if len(i) else np.zeros(0, dtype=int)
    offset = second_side.centre[j] - first_side.centre[i]
    normal_distance = np.einsum("px,px->p", offset, first_side.normal[i])
    across = np.linalg.norm(offset - normal_distance[:, None] * first_side.normal[i], axis=1)
    facing = np.einsum("px,px->p", first_side.normal[i], second_side.normal[j]) < -MORTAR.facing
    meet = facing & (across <= r_1[i] + r_2[j]) & (np.abs(normal_distance) <= reach + r_1[i] + r_2[j])
    return i[meet], j[meet]


def _outline(of: Side, curved: bool) -> np.ndarray:
    """Points (n_facet, m, 3) around each facet: its corners, and more where edges are curved."""
    n = of.corners
    corners, middles = of.points[:, :n], of.points[:, n : 2 * n]
    if not curved or not middles.shape[1]:
        return corners
    t = np.arange(MORTAR.edge_pieces)[:, None] / MORTAR.edge_pieces
    following = np.roll(corners, -1, axis=1)
    shape = (1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)
    edge = sum(N * p[:, :, None] for N, p in zip(shape, (corners, middles, following), strict=True))
    return np.asarray(edge).reshape(len(corners), -1, 3)
