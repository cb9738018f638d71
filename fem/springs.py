"""Springs in one direction: from a node set to the ground, or across a joint to the matching nodes of another set."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from tribodyn.fem.assembly import Assembly
from tribodyn.fem.constraints import find_group
from tribodyn.fem.elements import coordinates
from tribodyn.fem.interface import unit
from tribodyn.fem.matching import partners
from tribodyn.fem.surface import surface
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class Spring:
    """A joint that gives way in one direction; its stiffness is shared by tributary area on a face, else evenly.

    On a face of some extent it also resists tilting: a rotational stiffness follows from where its shares sit.
    nodes : name of a face or node set; direction : (3,), need not be a unit vector
    stiffness : of the whole joint, >= 0 [N/m]; opposite : name of the matching set across the joint, else the ground"""

    nodes: str
    direction: Sequence[float]
    stiffness: float
    opposite: str | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.stiffness) and self.stiffness >= 0):
            raise Refusal(f"spring at '{self.nodes}': stiffness = {self.stiffness} N/m must be finite and >= 0")

    def matrix(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> csr_matrix:
        """Stiffness (3 n_node, 3 n_node) [N/m].

        Raises  Refusal where a set is unknown or empty, or where the nodes across the joint do not match"""
        elongation, share = self.elongation(mesh, node_sets)
        return csr_matrix(elongation.T @ elongation.multiply(self.stiffness * share[:, None]))

    def elongation(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> tuple[csr_matrix, np.ndarray]:
        """Map (n, 3 n_node) from DOFs to the elongations of the shares, and the shares (n,), which sum to one."""
        nodes, share = shares(mesh, node_sets, self.nodes)
        direction = unit(self.direction, f"the direction of the spring at '{self.nodes}'")
        rows = np.repeat(np.arange(len(nodes)), 3)
        shape = (len(nodes), 3 * mesh.doflocs.shape[1])

        def components(of: np.ndarray) -> csr_matrix:
            columns = (of[:, None] * 3 + np.arange(3)).ravel()
            matrix = csr_matrix((np.tile(direction, len(of)), (rows, columns)), shape=shape)
            matrix.eliminate_zeros()
            return matrix

        if self.opposite is None:
            return components(nodes), share
        opposite_nodes, points = find_group(node_sets, self.opposite), coordinates(mesh)
        label = f"the spring from '{self.nodes}' to '{self.opposite}': its nodes"
        size = np.linalg.norm(np.ptp(points[nodes], axis=0)) or np.linalg.norm(np.ptp(points, axis=0))
        place = partners(points[nodes], points[opposite_nodes], label, float(size))
        return csr_matrix(components(nodes) - components(opposite_nodes[place])), share


@dataclass(frozen=True)
class ElongationSpring:
    """A stiffness against one elongation, a sum of displacements of single nodes.

    terms : (group of one node, axis 0..2, factor); stiffness : [N/m]"""

    terms: Sequence[tuple[str, int, float]]
    stiffness: float

    def matrix(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> csr_matrix:
        """Stiffness (3 n_node, 3 n_node) [N/m]; raises Refusal where a node is unknown."""
        dofs = [3 * int(find_group(node_sets, group)[0]) + axis for group, axis, _ in self.terms]
        row = csr_matrix(
            ([factor for *_, factor in self.terms], ([0] * len(dofs), dofs)), (1, 3 * mesh.doflocs.shape[1])
        )
        return csr_matrix(self.stiffness * (row.T @ row))


def shares(mesh: Any, node_sets: Mapping[str, np.ndarray], name: str) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of a set and the part of a stiffness that each one takes."""
    faces = mesh.boundaries or {}
    if name in faces:
        face = surface(mesh, faces[name])
        return face.nodes, face.area / face.area.sum()
    nodes = find_group(node_sets, name)
    return nodes, np.full(len(nodes), 1.0 / len(nodes))


@dataclass(frozen=True)
class Mass:
    """A lumped mass on a reference point of an assembly or on a node set, where it is shared like a stiffness.

    at : name of the point or of the set; mass : [kg]; inertia : about x, y, z [kg m2], of a point only"""

    at: str
    mass: float
    inertia: Sequence[float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not (np.isfinite([self.mass, *self.inertia]).all() and min(self.mass, *self.inertia) >= 0):
            raise Refusal(f"mass at '{self.at}': mass and inertia must be finite and not negative")

    def matrix(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> csr_matrix:
        """Mass (3 n_node, 3 n_node) [kg]; [kg m2] at the rotations of a point.

        Raises  Refusal where the set is unknown or empty, or has an inertia"""
        diagonal = np.zeros((mesh.doflocs.shape[1], 3))
        points = mesh.points if isinstance(mesh, Assembly) else {}
        if self.at in points:
            place, turn = points[self.at]
            diagonal[place], diagonal[turn] = self.mass, self.inertia
        else:
            if any(self.inertia):
                raise Refusal(f"mass at '{self.at}': only a coupling's point has an inertia; couple the set")
            nodes, share = shares(mesh, node_sets, self.at)
            diagonal[nodes] = self.mass * share[:, None]
        return csr_matrix(diags_array(diagonal.ravel()))
