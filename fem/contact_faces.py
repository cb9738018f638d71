"""Contact interfaces of faces: against the ground, against a plane, or against another face."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from tribodyn.fem.constraints import find_group
from tribodyn.fem.interface import COMPONENTS, ContactInterface, checked_components, contact_frames, unit
from tribodyn.fem.matching import facing_partners, partners
from tribodyn.fem.mortar import MORTAR, side
from tribodyn.fem.mortar_contact import mortar_halves
from tribodyn.fem.surface import Surface, facet_nodes, surface
from tribodyn.refusal import Refusal

PAIRINGS = ("auto", "nodes", "mortar")


@dataclass(frozen=True)
class ContactFaces:
    """The face of a body and what it touches: the ground, a plane, or another face, meshed alike or not.

    face : boundary name of body 1; opposite : boundary name of body 2, None for the ground
    t1 : (3,) direction whose part along the face is t1; components : those modelled, of t1, t2, n
    gap : opening before loading [m], one or (n_pair,); None takes the geometric gap between two faces, interference
        negative, and 0 to the ground
    vertices_only : no pairs at mid-side and mid-face nodes; without, six-node faces have theirs at mid-side nodes only
    plane : (3,) direction in which every pair closes, across a plane ground that touches the nearest of them
    inclination : of the plane about t1, by the right hand [rad], so small that it does not change the direction. The
        gap of a pair is its distance from the plane along that direction: what the face is bowed, what the plane leans
    pairing : "nodes" pairs matching nodes, "mortar" weighs both faces over the surface they share, "auto" pairs nodes
        where every facet of the first face has its like on the second
    reach : farthest opening at which two faces still meet [m], a tenth of the length of the first by default
    joint : name of its joint, by default the name of the face
    turn : (3, 3) rotation from a sector of a wheel to the next one, whose opposite face is met; None for the same body
    Raises  Refusal, as its methods, for what contradicts itself"""

    face: str
    t1: Sequence[float] | None
    opposite: str | None = None
    components: Sequence[str] = COMPONENTS
    gap: float | np.ndarray | None = None
    vertices_only: bool = False
    plane: Sequence[float] | None = None
    inclination: float = 0.0
    pairing: str = "auto"
    reach: float | None = None
    joint: str = ""
    turn: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.plane is not None and self.opposite is not None:
            raise Refusal(f"contact '{self.face}': a plane ground and an opposite face exclude each other; drop one")
        if self.inclination and self.plane is None:
            raise Refusal(f"contact '{self.face}': an inclination needs a plane ground; give its plane")
        if not abs(self.inclination) < np.pi / 2:
            raise Refusal(f"contact '{self.face}': inclination = {self.inclination} rad; keep it below pi / 2")
        if self.pairing not in PAIRINGS:
            raise Refusal(f"there is no pairing '{self.pairing}': there are {', '.join(PAIRINGS)}")

    def build(self, mesh: Any) -> ContactInterface:
        """The interface with B over all 3 n_node DOFs of the mesh, pairs in ascending node order.

        Where the second face is a neighbour's B is the half of the first alone
        Raises  Refusal for an unknown or empty face, a t1 along the normal, a gap of the wrong length"""
        if self.opposite is not None:
            interface, B_2 = self.halves(mesh)
            return interface if self.turn is not None else replace(interface, B=interface.B - B_2)
        face = surface(mesh, find_group(mesh.boundaries or {}, self.face, "face"), self.vertices_only)
        gap: float | np.ndarray = 0.0 if self.gap is None else self.gap
        if self.plane is not None:
            normal = unit(self.plane, "the direction in which a plane contact closes")
            face = replace(face, normals=np.tile(normal, (len(face.nodes), 1)))
            tangent = contact_frames(face.normals, self.t1)[0, 1]
            height = np.tan(self.inclination) * (face.points @ tangent) - face.points @ normal
            gap = gap + height - height.min()
        return self._interface(mesh, face, gap)

    def halves(self, mesh: Any) -> tuple[ContactInterface, csr_matrix]:
        """Both halves of a contact of two faces, over all DOFs of the mesh.

        Returns interface whose B is the half of the first face, and the half B_2 of the second one in the coordinates
            of its own sector: relative displacement = B q - B_2 q_2
        Raises  Refusal, naming the faces, where they do not meet, or do not match where nodes are to be paired"""
        faces = mesh.boundaries or {}
        try:
            first, second = (find_group(faces, name, "face") for name in (self.face, self.opposite or ""))
            return self._facing(mesh, first, second)
        except Refusal as trouble:
            raise type(trouble)(f"contact of '{self.face}' and '{self.opposite}': {trouble}") from None

    def _facing(self, mesh: Any, first: np.ndarray, second: np.ndarray) -> tuple[ContactInterface, csr_matrix]:
        turn = np.eye(3) if self.turn is None else np.asarray(self.turn, dtype=float).T
        corners = np.asarray(mesh.doflocs.T)[np.unique(facet_nodes(mesh, first))]
        length = float(np.linalg.norm(np.ptp(corners, axis=0)))
        reach = MORTAR.reach * length if self.reach is None else self.reach
        matched = None
        if self.pairing != "mortar":
            matched = self._matched(mesh, first, second, turn, reach)
            if matched is None and self.pairing == "nodes":
                face, second_face = (surface(mesh, facets, self.vertices_only) for facets in (first, second))
                partner = partners(face.points, second_face.points @ turn.T, "the two contact faces")
                matched = face, second_face.nodes[partner], np.zeros(len(partner))
        if matched is None:
            first_side, second_side = side(mesh, first), side(mesh, second, None if self.turn is None else turn)
            interface, B_2 = mortar_halves(first_side, second_side, self.t1, self.components, reach, self.vertices_only)
            if self.gap is not None:
                interface = replace(interface, gap=_gaps(self.gap, interface.area))
            return interface, B_2
        face, nodes, opening = matched
        opening[np.abs(opening) < MORTAR.rounding * length] = 0.0
        interface = self._interface(mesh, face, opening if self.gap is None else self.gap)
        return interface, _map(_rows(interface.frames, self.components) @ turn, nodes, mesh)

    def _matched(
        self, mesh: Any, first: np.ndarray, second: np.ndarray, turn: np.ndarray, reach: float
    ) -> tuple[Surface, np.ndarray, np.ndarray] | None:
        """The first face, the partners of its nodes on the second and their opening (n_pair,) [m]; None where facets do
        not match."""
        first_nodes, second_nodes = facet_nodes(mesh, first), facet_nodes(mesh, second)
        if first_nodes.shape[1] != second_nodes.shape[1] or len(first_nodes) > len(second_nodes):
            return None
        face = surface(mesh, first, self.vertices_only)
        nodes = np.unique(second_nodes)
        match = facing_partners(face.points, face.normals, np.asarray(mesh.doflocs.T)[nodes] @ turn.T, reach)
        if match is None:
            return None
        partner, opening = nodes[match[0]], match[1]
        quads = first_nodes.shape[1] != 6
        of_facet = slice(0, 4) if quads else slice(0, 3) if self.vertices_only else slice(3, 6)
        place = np.searchsorted(face.nodes, first_nodes[:, of_facet])
        facets = {tuple(row) for row in np.sort(second_nodes[:, of_facet], axis=1).tolist()}
        if not all(tuple(row) in facets for row in np.sort(partner[place], axis=1).tolist()):
            return None
        return face, partner, opening

    def _interface(self, mesh: Any, face: Surface, gap: float | np.ndarray) -> ContactInterface:
        """Interface of the nodes of one face, with B of that face alone."""
        components = checked_components(self.components)
        frames = contact_frames(face.normals, self.t1)
        B = _map(_rows(frames, components), face.nodes, mesh)
        return ContactInterface(components, face.points, frames, face.area, _gaps(gap, face.area), B, face.faces)


def no_contact(n_dof: int) -> ContactInterface:
    """The interface of a structure that touches nothing."""
    none, B = np.zeros(0), csr_matrix((0, n_dof))
    return ContactInterface(COMPONENTS, np.zeros((0, 3)), np.zeros((0, 3, 3)), none, none, B, np.zeros((0, 4), int))


def _gaps(gap: float | np.ndarray, area: np.ndarray) -> np.ndarray:
    """The gap of every pair (n_pair,) [m]."""
    if np.ndim(gap) and np.shape(gap) != area.shape:
        raise Refusal(f"the contact gap has {np.size(gap)} values for {len(area)} node pairs; give one each")
    return np.broadcast_to(np.asarray(gap, dtype=float), area.shape).copy()


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
