"""A part of the surface: its nodes, normals, tributary areas and polygons."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from tribodyn.fem.assembly import piece_of_facets
from tribodyn.fem.elements import connectivity, coordinates
from tribodyn.geometry.element_library import skfem
from tribodyn.refusal import Refusal

# The four quads that a nine-node face shows, in its own node order: corners, mid-sides, middle.
NINE_NODE_QUADS = np.array([[0, 4, 8, 7], [4, 1, 5, 8], [8, 5, 2, 6], [7, 8, 6, 3]])
OPPOSITE = np.array([2, 0, 1])  # corner of a six-node face opposite each of its sides


@dataclass(frozen=True)
class Surface:
    """nodes : (k,) mesh nodes, sorted; points : (k, 3) [m]; normals : (k, 3) outward unit vectors, averaged by area;
    area : (k,) tributary area [m2], sums to the area of the surface;
    faces : (n_face, 4 or 3) corner-ordered polygons, as positions in `nodes`."""

    nodes: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    area: np.ndarray
    faces: np.ndarray


def surface(mesh: Any, facets: np.ndarray, vertices_only: bool = False) -> Surface:
    """The surface made of some facets of the mesh.

    facets : indices of boundary facets; vertices_only : leave out the mid-side and mid-face nodes
    Tributary areas are the consistent integrals of the shape functions of the nodes kept: 1/36, 4/36, 16/36 of a flat
    nine-node face, 1/4 or 1/3 with vertices only. A six-node face has none at its corners and 1/3 at each mid-side
    node, which are its nodes here. All nodes keep the first and second moments of a flat face; vertices only do not.
    Raises  Refusal where there are no facets, where they lie inside the body, or where an area is not positive"""
    facets = np.asarray(facets, dtype=int)
    if len(facets) == 0:
        raise Refusal("a contact or load surface has no faces; check the geometry that defines it")
    require_outside(mesh, facets)
    face_nodes = facet_nodes(mesh, facets)
    sides = face_nodes.shape[1] == 6 and not vertices_only
    weighted, vectors = face_integrals(mesh, facets, vertices_only or sides)
    if sides:  # of the functions 1 - 2 L, L of the corner opposite a side, see `side_functions`
        weighted, vectors = (of.sum(axis=1, keepdims=True) - 2 * of[:, OPPOSITE] for of in (weighted, vectors))
        corners, face_nodes = face_nodes[:, :3], face_nodes[:, 3:]
    elif vertices_only:
        face_nodes = face_nodes[:, : weighted.shape[1]]
    nodes, local = np.unique(face_nodes, return_inverse=True)
    local = local.reshape(face_nodes.shape)
    area = np.bincount(local.ravel(), weighted.ravel())
    if (area <= 1e-9 * area.sum()).any():
        raise Refusal("a face is so curved that areas of its nodes vanish; mesh it finer")
    summed = np.stack([np.bincount(local.ravel(), vectors[:, :, i].ravel()) for i in range(3)], axis=1)
    normals = summed / np.linalg.norm(summed, axis=1, keepdims=True)
    if sides:
        polygons = side_polygons(corners, local)
    else:
        polygons = local[:, NINE_NODE_QUADS].reshape(-1, 4) if face_nodes.shape[1] == 9 else local
    return Surface(nodes, coordinates(mesh)[nodes], normals, area, polygons)


def side_functions(xi: np.ndarray) -> np.ndarray:
    """Functions (3, n) of the sides of a triangle at xi (2, n): linear, one in the middle of a side, zero in others.

    They are orthogonal and sum to one, so that their means keep the first and second moments of a flat triangle
    Source  Crouzeix and Raviart, RAIRO 7, 1973"""
    x, y = xi
    return np.stack([1 - 2 * y, 2 * (x + y) - 1, 1 - 2 * x])


def side_polygons(corners: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """Triangles (k, 3) between the middles of sides: one in each facet, and what lies around each corner.

    corners, sides : (n_facet, 3) numbers, side j between the corners that are not OPPOSITE it
    At the rim of the face the small triangles beyond the middles stay out"""
    triangles = [np.asarray(sides)]
    links_of: dict[int, list[tuple[int, int]]] = {}
    for of, middles in zip(corners.tolist(), sides.tolist(), strict=True):
        for j, corner in enumerate(of):
            ends = [middles[k] for k in range(3) if OPPOSITE[k] != j]
            links_of.setdefault(corner, []).append((ends[0], ends[1]))
    for links in links_of.values():
        ring = _chain(links)
        triangles.append(np.array([(ring[0], a, b) for a, b in pairwise(ring[1:])], dtype=int).reshape(-1, 3))
    return np.concatenate(triangles)


def _chain(links: list[tuple[int, int]]) -> list[int]:
    """The numbers that links join, in a row; a ring begins anywhere and does not repeat its first one."""
    joined: dict[int, list[int]] = {}
    for a, b in links:
        joined.setdefault(a, []).append(b)
        joined.setdefault(b, []).append(a)
    current = next((a for a, neighbours in joined.items() if len(neighbours) == 1), links[0][0])
    row, visited = [current], {current}
    while (step := next((b for b in joined[current] if b not in visited), None)) is not None:
        row.append(step)
        visited.add(step)
        current = step
    return row


def require_outside(mesh: Any, facets: np.ndarray) -> None:
    """Raise Refusal where some of the facets lie inside a body."""
    piece, facets = piece_of_facets(mesh, facets)
    inside = int(np.sum(piece.mesh.f2t[1, facets] >= 0))
    if inside:
        raise Refusal(
            f"a contact or load surface lies inside the body with {inside} of its {len(facets)} facets; give faces of "
            "its boundary"
        )


def facet_nodes(mesh: Any, facets: np.ndarray) -> np.ndarray:
    """Nodes of the facets (n_facet, 9, 6 or 4): corners in cyclic order, then mid-sides, then the middle."""
    piece, facets = piece_of_facets(mesh, facets)
    return piece.node + _facet_nodes(piece.mesh, facets)


def _facet_nodes(mesh: Any, facets: np.ndarray) -> np.ndarray:
    n = connectivity(mesh).shape[1]
    parts = [mesh.facets[:, facets]]
    if n > 8:
        parts.append(mesh.dofs.edge_dofs[0][mesh.f2e[:, facets]])
    if n == 27:
        parts.append(mesh.dofs.facet_dofs[:, facets])
    return np.vstack(parts).T


def face_integrals(mesh: Any, facets: np.ndarray, vertices_only: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Integrals of N_a and of N_a times the outward normal over each facet.

    Returns (n_facet, k) [m2] and (n_facet, k, 3) [m2]; k nodes of the facet, or its vertices"""
    piece, facets = piece_of_facets(mesh, facets)
    mesh, nodes, points = piece.mesh, _facet_nodes(piece.mesh, facets), coordinates(piece.mesh)
    k, corners = nodes.shape[1], 4 if isinstance(mesh, skfem.MeshHex1) else 3
    element = getattr(skfem, ELEMENTS[k])
    X, w = skfem.quadrature.get_quadrature(element, 6)  # exact for a shape function times the normal of a flat face
    N, slopes = tabulate(k, X)  # n_a, n_q and n_a, 2, n_q
    tangents = np.einsum("aiq,fax->fiqx", slopes, points[nodes])
    normal = np.cross(tangents[:, 0], tangents[:, 1])  # |normal| is the area element
    body = points[mesh.t[:, mesh.f2t[0, facets]]].mean(axis=0)
    outward = points[nodes].mean(axis=1) - body
    normal *= np.sign(np.einsum("fqx,fx->f", normal, outward))[:, None, None]
    if vertices_only:
        N = tabulate(corners, X)[0]
    vectors = np.einsum("aq,fqx,q->fax", N, normal, w)
    return np.einsum("aq,fq,q->fa", N, np.linalg.norm(normal, axis=2), w), vectors


ELEMENTS = {9: "ElementQuad2", 6: "ElementTriP2", 4: "ElementQuad1", 3: "ElementTriP1"}  # of scikit-fem, by nodes


def tabulate(k: int, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions (k, n) and slopes (k, 2, n) of a facet of k nodes (9, 6, 4 or 3) at xi (2, n)."""
    element = getattr(skfem, ELEMENTS[k])()
    values = [element.lbasis(xi, a) for a in range(k)]
    slopes = [np.stack(np.broadcast_arrays(*slope, xi[0])[:2]) for _, slope in values]
    return np.stack([np.broadcast_to(value, xi.shape[1:]) for value, _ in values]), np.stack(slopes)
