"""The surface that two faces of different meshes share: where it lies on both, and integrals over it.

Facets of the second face are carried along the normal of a facet of the first one, cut with it, and Gauss points are
laid on the triangles of each cut. A flat facet is cut in its plane, which is exact for straight edges; a curved one in
its own reference coordinates, in which the cuts fill it without overlap.
Source  Puso and Laursen, Computer Methods in Applied Mechanics and Engineering 193, 2004 (segments); Popp, Wohlmuth,
    Gee and Wall, SIAM Journal on Scientific Computing 34, 2012 (second order, dual functions); Cichosz and Bischoff,
    Computer Methods in Applied Mechanics and Engineering 200, 2011 (dual functions on cut facets)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from skfem import ElementTriP1, MeshHex1
from skfem.quadrature import get_quadrature

from tribodyn.fem.assembly import piece_of_facets
from tribodyn.fem.elements import coordinates
from tribodyn.fem.facet_cuts import clip_polygons, locate_on_facets, polygon_areas, reference_corners, tangent_planes
from tribodyn.fem.surface import facet_nodes, require_outside, tabulate


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
    whole : part of a facet that counts as all of it
    few : part of a point's own area that is too little to carry
    tied : part of it from which on a node is tied; less asks too much of the other face by extrapolation
    independent : least eigenvalue, of the largest possible 1, at which shape functions still differ on a cut facet
    rounding : gap that is rounding of node positions, over the length of the face
    apart : mean gap of two tied faces, over the length of the first, from which on they do not touch
    """

    reach: float = 0.1
    curved: float = 1e-9
    edge_pieces: int = 6
    flat_order: int = 8
    curved_order: int = 12
    facing: float = 0.3
    sliver: float = 1e-10
    whole: float = 1 - 1e-6
    few: float = 1e-6
    tied: float = 1e-3
    independent: float = 1e-7
    rounding: float = 1e-9
    apart: float = 5e-3


MORTAR = MortarOptions()


@dataclass(frozen=True)
class Side:
    """A face in space: nodes (n_facet, k), points (n_facet, k, 3) [m], corners first, then mid-sides, then middle;
    centre, normal : (n_facet, 3), the normal outward; sign : (n_facet,) that makes dx/dxi cross dx/deta outward
    turn : (3, 3) rotation about the origin that brought the mesh here; n_node : of the mesh
    """

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
    piece, own = piece_of_facets(mesh, facets)
    points, inner = coordinates(mesh)[nodes], piece.mesh.p[:, piece.mesh.t[:, piece.mesh.f2t[0, own]]].mean(axis=1).T
    if rotation is not None:
        points, inner = points @ rotation.T, inner @ rotation.T
    n = 4 if isinstance(piece.mesh, MeshHex1) else 3
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
    cuts : (n_cut + 1,) where the points of each cut begin; covered : (n_facet,) part of each facet of the first side
    """

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


def shared_surface(one: Side, two: Side, reach: float) -> SharedSurface:
    """Where two sides face each other.

    reach : farthest distance along the normal at which facets still meet [m]
    Returns the points, none where the sides do not meet
    """
    i, j = _candidates(one, two, reach)
    if not len(i):
        none, pairs = np.zeros(0), np.zeros((2, 0))
        return SharedSurface(
            i, j, pairs, pairs, none, np.zeros((0, 3)), none, np.zeros(1, int), np.zeros(len(one.nodes))
        )
    frames = tangent_planes(one.normal)[i]
    curved = one.bulge > MORTAR.curved
    outline = _outline(two, two.bulge > MORTAR.curved)[j]
    corners = one.points[:, : one.corners]
    if curved:
        region = reference_corners(one.corners)[None].repeat(len(i), axis=0)
        m = outline.shape[1]
        s = locate_on_facets(one.points[i].repeat(m, 0), outline.reshape(-1, 3), frames.repeat(m, 0))
        subject = s.T.reshape(len(i), m, 2)
    else:
        region = np.einsum("pkx,pdx->pkd", corners[i] - one.centre[i][:, None], frames)
        subject = np.einsum("pkx,pdx->pkd", outline - one.centre[i][:, None], frames)
    whole = polygon_areas(region)
    region[whole < 0] = region[whole < 0][:, ::-1]
    polygon = clip_polygons(subject, region)
    found = np.abs(polygon_areas(polygon)) > MORTAR.sliver * np.abs(whole)
    i, j, frames, polygon, whole = i[found], j[found], frames[found], polygon[found], np.abs(whole[found])

    X, w = get_quadrature(ElementTriP1, MORTAR.curved_order if curved else MORTAR.flat_order)
    hub = polygon.mean(axis=1, keepdims=True)
    a, b = polygon - hub, np.roll(polygon, -1, axis=1) - hub
    twice = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    twice *= np.sign(twice.sum(axis=1, keepdims=True))
    pair, corner = np.nonzero(np.abs(twice) > MORTAR.sliver * whole[:, None])
    s = hub[pair, 0][:, None] + X[0][:, None] * a[pair, corner][:, None] + X[1][:, None] * b[pair, corner][:, None]
    weight = (twice[pair, corner][:, None] * w).ravel()
    s, of = s.reshape(-1, 2).T, np.repeat(pair, len(w))

    local = one.points[i[of]]
    if curved:
        xi = s
    else:
        e = frames[of]
        at = one.centre[i[of]] + s[0][:, None] * e[:, 0] + s[1][:, None] * e[:, 1]
        xi = locate_on_facets(local, at, e)
    N, slopes = tabulate(local.shape[1], xi)
    x = np.einsum("an,nax->nx", N, local)
    normal = np.cross(*np.einsum("ain,nax->inx", slopes, local)) * one.sign[i[of]][:, None]
    size = np.linalg.norm(normal, axis=1)
    if curved:
        weight = weight * size
    normal = normal / size[:, None]
    eta = locate_on_facets(two.points[j[of]], x, frames[of])
    y = np.einsum("an,nax->nx", tabulate(two.points.shape[1], eta)[0], two.points[j[of]])
    gap = np.einsum("nx,nx->n", y - x, normal)
    covered = np.bincount(i, np.abs(polygon_areas(polygon)) / whole, len(one.nodes))
    near = np.abs(gap) <= reach
    starts = np.append(np.flatnonzero(np.diff(of[near], prepend=-1)), near.sum())
    if not near.all():
        kept = np.bincount(i[of], np.where(near, np.abs(weight), 0.0), len(one.nodes))
        everything = np.bincount(i[of], np.abs(weight), len(one.nodes))
        covered = covered * np.divide(kept, everything, out=np.zeros_like(kept), where=everything > 0)
    return SharedSurface(
        i[of][near], j[of][near], xi[:, near], eta[:, near], weight[near], normal[near], gap[near],
        starts, covered,
    )  # fmt: skip


def coefficients(k: int) -> np.ndarray:
    """The matrix (k, k) that makes Bernstein coefficients of the values at the nodes of a facet of k nodes.

    On every cut of a facet Bernstein polynomials have a positive integral, which shape functions have not: that of the
    corner of a six-node facet is zero. Those of first order are the shape functions
    """
    line = np.array([[1, 0, 0], [0, 1, 0], [-0.5, -0.5, 2]])  # both ends and the middle of an edge
    if k == 9:
        i, j = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (1, 2), (2, 1), (0, 2), (2, 2)]).T
        return np.asarray(line[i[:, None], i] * line[j[:, None], j])
    whole = np.eye(k)
    for middle in range(3, k if k == 6 else 0):
        whole[middle, [middle - 3, (middle - 2) % 3, middle]] = line[2]
    return whole


def dual(one: Side, shared: SharedSurface) -> tuple[np.ndarray, np.ndarray]:
    """Dual functions of the first side, times the weights of the points, and what each coefficient weighs.

    Returns psi (k, n) [m2] and d (n_facet, k) [m2] with sum(psi_a u) = d_a times the Bernstein coefficient a of u, for
        any u that the facet can take; both are integrals over what is covered, and psi sums to the weights, so that
        constant tractions are carried exactly. Where a cut is so thin that shape functions look alike on it, this
        holds for u that are linear in space, rigid motions among them
    """
    k = one.nodes.shape[1]
    to = coefficients(k)
    N = np.linalg.inv(to).T @ tabulate(k, shared.xi)[0]
    away = one.points - one.centre[:, None]
    away /= np.abs(away).max(axis=(1, 2), keepdims=True)
    affine = np.concatenate([np.ones((*one.nodes.shape, 1)), to @ away], axis=2)
    starts = np.searchsorted(shared.first, np.arange(len(one.nodes) + 1))
    psi, d = np.zeros_like(N), np.zeros(one.nodes.shape)
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


def _candidates(one: Side, two: Side, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of facets that may meet."""
    r_1, r_2 = (np.linalg.norm(s.points - s.centre[:, None], axis=2).max(axis=1) for s in (one, two))
    near = scipy.spatial.cKDTree(two.centre).query_ball_point(one.centre, r_1 + r_2.max() + reach)
    i = np.repeat(np.arange(len(near)), [len(n) for n in near])
    j = np.concatenate([np.sort(np.asarray(n, dtype=int)) for n in near]) if len(i) else np.zeros(0, dtype=int)
    apart = two.centre[j] - one.centre[i]
    along = np.einsum("px,px->p", apart, one.normal[i])
    across = np.linalg.norm(apart - along[:, None] * one.normal[i], axis=1)
    facing = np.einsum("px,px->p", one.normal[i], two.normal[j]) < -MORTAR.facing
    meet = facing & (across <= r_1[i] + r_2[j]) & (np.abs(along) <= reach + r_1[i] + r_2[j])
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
