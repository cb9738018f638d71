"""Builders of contact interfaces: a patch against the ground, or against the nodes of another patch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, vstack

from tribodyn.fem.interface import COMPONENTS, ContactInterface
from tribodyn.fem.loads import unit
from tribodyn.fem.matching import TOLERANCE, facing_partners, partners
from tribodyn.fem.mortar_contact import ROUNDING, mortar_halves
from tribodyn.fem.surface import Surface, facet_nodes, surface

REACH = 0.1  # default of the farthest opening at which two faces still meet, as a part of the length of the first
PAIRINGS = ("auto", "nodes", "mortar")


def ground_contact(
    mesh: Any,
    facets: np.ndarray,
    t1: Sequence[float],
    components: Sequence[str] = COMPONENTS,
    gap: float | np.ndarray = 0.0,
    vertices_only: bool = False,
) -> ContactInterface:
    """Nodes of a face against the ground, which body 1 approaches along its outward normal.

    mesh : scikit-fem mesh; facets : facets of the face; t1 : (3,) direction whose part along the face is t1
    components : those a scene needs, of t1, t2, n; gap : opening before loading [m], one or (n_pair,)
    vertices_only : no pairs at mid-side and mid-face nodes; without, six-node faces have theirs at mid-side nodes only
    Returns the interface with B over all 3 n_node DOFs of the mesh, pairs in ascending node order
    Raises  ValueError for an empty face, a t1 along the normal, unknown components, a gap of the wrong length
    """
    return _interface(mesh, surface(mesh, facets, vertices_only), t1, components, gap)


def plane_contact(
    mesh: Any,
    facets: np.ndarray,
    towards: Sequence[float],
    t1: Sequence[float],
    components: Sequence[str] = COMPONENTS,
    gap: float | np.ndarray = 0.0,
    vertices_only: bool = False,
    inclination: float = 0.0,
) -> ContactInterface:
    """Nodes of a face against a plane ground that touches the nearest of them, plus a gap.

    towards : (3,) in which every pair closes, across the plane; inclination : of the plane about t1, by the right hand
        [rad], so small that it does not change the direction. The gap of a pair is its distance from the plane along
        that direction: what the face is bowed, and what the plane leans away.
    Other arguments, returns and errors as ground_contact; ValueError too for an inclination of a quarter turn or more
    """
    if not abs(inclination) < np.pi / 2:
        raise ValueError(f"the inclination of a contact is {inclination} rad; keep it far below a quarter turn")
    face = surface(mesh, facets, vertices_only)
    normal = unit(towards, "the direction in which a plane contact closes")
    face = replace(face, normals=np.tile(normal, (len(face.nodes), 1)))
    along = contact_frames(face.normals, t1)[0, 1]
    away = np.tan(inclination) * (face.points @ along) - face.points @ normal
    return _interface(mesh, face, t1, components, gap + away - away.min())


def pair_contact(
    mesh: Any,
    facets_1: np.ndarray,
    facets_2: np.ndarray,
    t1: Sequence[float],
    components: Sequence[str] = COMPONENTS,
    gap: float | np.ndarray = 0.0,
    vertices_only: bool = False,
    tolerance: float = TOLERANCE,
) -> ContactInterface:
    """Nodes of face 1 against the matching nodes of face 2, which may be larger.

    tolerance : largest distance of two matching nodes, as a part of the length of face 1
    Other arguments, returns and errors as ground_contact; ValueError too where a node of face 1 finds no partner
    """
    interface, B_2 = pair_halves(mesh, facets_1, facets_2, t1, components, gap, vertices_only, tolerance)
    return replace(interface, B=interface.B - B_2)


def pair_halves(
    mesh: Any,
    facets_1: np.ndarray,
    facets_2: np.ndarray,
    t1: Sequence[float],
    components: Sequence[str] = COMPONENTS,
    gap: float | np.ndarray = 0.0,
    vertices_only: bool = False,
    tolerance: float = TOLERANCE,
    rotation: np.ndarray | None = None,
) -> tuple[ContactInterface, csr_matrix]:
    """Both halves of a contact whose second body is the copy of this mesh turned by a rotation.

    rotation : (3, 3) that carries face 2 of this mesh onto face 1, as the next sector of a cyclic part does
    Returns interface whose B is the half of body 1, and the half B_2 of the turned body 2 in its own sector
        coordinates: relative displacement = B q - B_2 q_2
    """
    rotation = np.eye(3) if rotation is None else np.asarray(rotation, dtype=float)
    face_1 = surface(mesh, facets_1, vertices_only)
    face_2 = surface(mesh, facets_2, vertices_only)
    partner = partners(face_1.points, face_2.points @ rotation.T, "the two contact faces", tolerance)
    interface = _interface(mesh, face_1, t1, components, gap)
    turned = _rows(interface.frames, components) @ rotation
    return interface, _map(turned, face_2.nodes[partner], mesh)


def facing_halves(
    mesh: Any,
    facets_1: np.ndarray,
    facets_2: np.ndarray,
    t1: Sequence[float],
    components: Sequence[str] = COMPONENTS,
    gap: float | np.ndarray | None = None,
    vertices_only: bool = False,
    rotation: np.ndarray | None = None,
    pairing: str = "auto",
    reach: float | None = None,
) -> tuple[ContactInterface, csr_matrix]:
    """Both halves of a contact of two faces that may be meshed differently and may stand apart or overlap.

    gap : opening before loading [m], one or (n_pair,); None takes that of the geometry, interference negative
    pairing : "nodes" pairs matching nodes, "mortar" weighs both faces over the surface they share, "auto" pairs nodes
        where every facet of face 1 has its like on face 2
    reach : farthest opening at which the faces still meet [m], a tenth of the length of face 1 by default
    Other arguments and returns as `pair_halves`
    Raises  ValueError where the faces do not meet, or do not match where nodes are to be paired
    """
    if pairing not in PAIRINGS:
        raise ValueError(f"there is no pairing '{pairing}': there are {', '.join(PAIRINGS)}")
    turn = np.eye(3) if rotation is None else np.asarray(rotation, dtype=float)
    corners = facet_nodes(mesh, facets_1)
    length = float(np.linalg.norm(np.ptp(np.asarray(mesh.doflocs.T)[np.unique(corners)], axis=0)))
    farthest = REACH * length if reach is None else reach
    if pairing != "mortar":
        matched = _matched(mesh, facets_1, facets_2, turn, vertices_only, farthest)
        if matched is not None:
            face_1, nodes_2, opening = matched
            opening[np.abs(opening) < ROUNDING * length] = 0.0
            interface = _interface(mesh, face_1, t1, components, opening if gap is None else gap)
            return interface, _map(_rows(interface.frames, components) @ turn, nodes_2, mesh)
        if pairing == "nodes":
            return pair_halves(
                mesh, facets_1, facets_2, t1, components, 0.0 if gap is None else gap, vertices_only, rotation=turn
            )
    interface, B_2 = mortar_halves(mesh, facets_1, facets_2, t1, components, farthest, vertices_only, rotation)
    if gap is not None:
        if np.ndim(gap) and np.shape(gap) != interface.area.shape:
            raise ValueError(f"the contact gap has {np.size(gap)} values for {interface.n_pair} points; give one each")
        interface = replace(interface, gap=np.broadcast_to(np.asarray(gap, dtype=float), interface.area.shape).copy())
    return interface, B_2


def _matched(
    mesh: Any, facets_1: np.ndarray, facets_2: np.ndarray, turn: np.ndarray, vertices_only: bool, reach: float
) -> tuple[Surface, np.ndarray, np.ndarray] | None:
    """Face 1, the partners of its nodes on face 2 and their opening (n_pair,) [m]; None where facets do not match."""
    one, two = facet_nodes(mesh, facets_1), facet_nodes(mesh, facets_2)
    if one.shape[1] != two.shape[1] or len(one) > len(two):
        return None
    face_1 = surface(mesh, facets_1, vertices_only)
    points = np.asarray(mesh.doflocs.T)
    nodes = np.unique(two)
    found = facing_partners(face_1.points, face_1.normals, points[nodes] @ turn.T, reach)
    if found is None:
        return None
    partner, opening = nodes[found[0]], found[1]
    of_facet = slice(3, 6) if one.shape[1] == 6 and not vertices_only else slice(0, 4 if one.shape[1] == 9 else 3)
    place = np.searchsorted(face_1.nodes, one[:, of_facet])
    there = {tuple(row) for row in np.sort(two[:, of_facet], axis=1).tolist()}
    if not all(tuple(row) in there for row in np.sort(partner[place], axis=1).tolist()):
        return None
    return face_1, partner, opening


def join(interfaces: Sequence[ContactInterface]) -> ContactInterface:
    """Several contacts of one structure as one interface, pairs in the order given; triangles become quadrangles that
    repeat a corner where there are quadrangles too.

    Raises  ValueError where they differ in components
    """
    if len({i.components for i in interfaces}) > 1:
        raise ValueError("the contacts of a structure must be built with the same components")
    first = np.cumsum([0] + [i.n_pair for i in interfaces])
    names = ("points", "frames", "area", "gap")
    fields = {name: np.concatenate([getattr(i, name) for i in interfaces]) for name in names}
    width = max(i.faces.shape[1] for i in interfaces)
    faces = [np.pad(i.faces, ((0, 0), (0, width - i.faces.shape[1])), mode="edge") for i in interfaces]
    return ContactInterface(
        components=interfaces[0].components,
        **fields,
        B=vstack([i.B for i in interfaces], format="csr"),
        faces=np.concatenate([of + start for of, start in zip(faces, first, strict=False)]),
    )


def no_contact(n_dof: int, components: Sequence[str] = COMPONENTS) -> ContactInterface:
    """The interface of a structure that touches nothing."""
    none = np.zeros(0)
    B = csr_matrix((0, n_dof))
    return ContactInterface(
        tuple(components), np.zeros((0, 3)), np.zeros((0, 3, 3)), none, none, B, np.zeros((0, 4), int)
    )


def _interface(
    mesh: Any, face: Surface, t1: Sequence[float], components: Sequence[str], gap: float | np.ndarray
) -> ContactInterface:
    """Interface of the nodes of one face, with B of that face alone."""
    components = tuple(components)
    if not components or components != tuple(c for c in COMPONENTS if c in components):
        raise ValueError(f"contact components {list(components)} must be some of t1, t2, n, in this order")
    if np.ndim(gap) and np.shape(gap) != face.area.shape:
        raise ValueError(f"the contact gap has {np.size(gap)} values for {len(face.area)} node pairs; give one each")
    frames = contact_frames(face.normals, t1)
    return ContactInterface(
        components=components,
        points=face.points,
        frames=frames,
        area=face.area,
        gap=np.broadcast_to(np.asarray(gap, dtype=float), face.area.shape).copy(),
        B=_map(_rows(frames, components), face.nodes, mesh),
        faces=face.faces,
    )


def contact_frames(normals: np.ndarray, t1: Sequence[float]) -> np.ndarray:
    """Right-handed frames (k, 3, 3), rows t1, t2, n, from normals (k, 3) and a direction that t1 follows.

    Raises  ValueError where the direction is along a normal
    """
    direction = unit(t1, "the contact direction t1")
    along = direction - (normals @ direction)[:, None] * normals
    length = np.linalg.norm(along, axis=1, keepdims=True)
    if (length < 1e-3).any():
        raise ValueError(f"the contact direction t1 = {list(t1)} is along the contact normal; give one along the face")
    first = along / length
    return np.stack([first, np.cross(normals, first), normals], axis=1)


def _rows(frames: np.ndarray, components: Sequence[str]) -> np.ndarray:
    """The rows of the frames (n_pair, n_component, 3) that the components need."""
    return frames[:, [COMPONENTS.index(c) for c in components]]


def _map(rows: np.ndarray, nodes: np.ndarray, mesh: Any) -> csr_matrix:
    """Sparse map (n_pair * n_component, 3 n_node) from DOFs to rows (n_pair, n_component, 3) . u(node)."""
    n_pair, n_component, _ = rows.shape
    columns = np.broadcast_to((nodes[:, None] * 3 + np.arange(3))[:, None], rows.shape)
    lines = np.broadcast_to(np.arange(n_pair * n_component).reshape(n_pair, n_component, 1), rows.shape)
    rows = np.where(np.abs(rows) < 1e-14, 0.0, rows)  # rounding of a frame must not make a DOF a master
    shape = (n_pair * n_component, mesh.doflocs.shape[1] * 3)
    matrix = csr_matrix((rows.ravel(), (lines.ravel(), columns.ravel())), shape=shape)
    matrix.eliminate_zeros()
    return matrix
