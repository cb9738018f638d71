"""Loads and outputs as vectors over all DOFs of the mesh."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import scipy

from tribodyn.fem.assembly import Assembly, materials_of, pieces
from tribodyn.fem.constraints import find_group
from tribodyn.fem.elasticity import element_tensors, strain_points
from tribodyn.fem.elements import coordinates
from tribodyn.fem.interface import unit
from tribodyn.fem.surface import face_integrals, facet_nodes, require_outside
from tribodyn.refusal import Refusal
from tribodyn.text_file import numbers_of, text_of


class Load(Protocol):
    """A load that knows its force vector (3 n_node,) per unit of its amplitude."""

    def vector(self, mesh: Any, node_sets: Mapping[str, np.ndarray], mass: Any) -> np.ndarray: ...


@dataclass(frozen=True)
class NodalForce:
    """A resultant of 1 N in a direction, shared by a node set.

    As an output the same vector observes the mean displacement of the set in that direction [m/m].
    nodes : name of the node set; direction : (3,), need not be a unit vector
    shared : "nodes" for evenly; "area" for the consistent forces of a uniform traction where the set is a face"""

    nodes: str
    direction: Sequence[float]
    shared: str = "nodes"

    def vector(self, mesh: Any, node_sets: Mapping[str, np.ndarray], mass: Any = None) -> np.ndarray:
        """Force vector (3 n_node,) [N/N]."""
        nodes = find_group(node_sets, self.nodes)
        force = np.zeros((mesh.doflocs.shape[1], 3))
        direction = unit(self.direction, f"the direction at node set '{self.nodes}'")
        if self.shared == "area" and self.nodes in (mesh.boundaries or {}):
            facets = mesh.boundaries[self.nodes]
            shares = face_integrals(mesh, facets)[0]
            np.add.at(force, facet_nodes(mesh, facets), shares[:, :, None] / shares.sum() * direction)
        else:
            force[nodes] = direction / len(nodes)
        return force.ravel()


@dataclass(frozen=True)
class Moment:
    """1 N m about a direction on a reference point of an assembly. point : its name; direction : (3,)."""

    point: str
    direction: Sequence[float]

    def vector(self, mesh: Any, node_sets: Mapping[str, np.ndarray], mass: Any = None) -> np.ndarray:
        """Force vector (3 n_node,) [N m/N m]; raises Refusal where there is no such point."""
        points = mesh.points if isinstance(mesh, Assembly) else {}
        if self.point not in points:
            raise Refusal(f"a moment acts on the point of a coupling, but '{self.point}' is none; couple the group")
        moment = np.zeros((mesh.doflocs.shape[1], 3))
        moment[points[self.point][1]] = unit(self.direction, f"the direction of the moment on '{self.point}'")
        return moment.ravel()


@dataclass(frozen=True)
class Pressure:
    """1 Pa on a face of the mesh, pushing into the body; consistent nodal forces. face : its boundary name."""

    face: str

    def vector(self, mesh: Any, node_sets: Mapping[str, np.ndarray], mass: Any = None) -> np.ndarray:
        """Force vector (3 n_node,) [N/Pa]."""
        facets = find_group(mesh.boundaries or {}, self.face, "face")
        require_outside(mesh, facets)
        force = np.zeros((mesh.doflocs.shape[1], 3))
        np.add.at(force, facet_nodes(mesh, facets), -face_integrals(mesh, facets)[1])
        return force.ravel()


@dataclass(frozen=True)
class BodyForce:
    """Acceleration of 1 m/s2 of the frame's gravity in a direction: force density rho g. direction : (3,)."""

    direction: Sequence[float]

    def vector(self, mesh: Any, node_sets: Mapping[str, np.ndarray], mass: Any) -> np.ndarray:
        """Force vector (3 n_node,) [N s2/m]; exact, as a constant field lies in the element space."""
        direction = unit(self.direction, "the direction of the body force")
        return mass @ np.tile(direction, mesh.doflocs.shape[1])


@dataclass(frozen=True)
class Centrifugal:
    """Centrifugal force of a rotation of 1 rad/s about an axis. axis : (3,); point : (3,) on the axis [m]."""

    axis: Sequence[float]
    point: Sequence[float] = (0.0, 0.0, 0.0)

    def vector(self, mesh: Any, node_sets: Mapping[str, np.ndarray], mass: Any) -> np.ndarray:
        """Force vector (3 n_node,) [N s2/rad2], to be scaled by speed squared; exact for isoparametric elements."""
        axis = unit(self.axis, "the axis of rotation")
        arm = coordinates(mesh) - np.asarray(self.point, dtype=float)
        return mass @ (arm - np.outer(arm @ axis, axis)).ravel()


@dataclass(frozen=True)
class Sum:
    """Several loads that act together as one. parts : each with its factor."""

    parts: Sequence[tuple[Load, float]]

    def vector(self, mesh: Any, node_sets: Mapping[str, np.ndarray], mass: Any = None) -> np.ndarray:
        """Force vector (3 n_node,)."""
        force = np.zeros(3 * mesh.doflocs.shape[1])
        for load, factor in self.parts:
            force += factor * load.vector(mesh, node_sets, mass)
        return force


@dataclass(frozen=True)
class Heating:
    """A change of temperature of 1 K, or of a field of values at the nodes, in some bodies.

    The strain alpha T, held back, has the stress C : alpha T, which acts as the forces
    f_ai = integral of C_ijkl alpha_kl T dN_a/dx_j
    Source  Cook, Malkus, Plesha and Witt, Concepts and Applications of Finite Element Analysis, 2002, section 3.9
    material : as for fem.elasticity.assemble; bodies : names, all where empty; values : (n_node,) [K], None for 1 K"""

    material: Any
    bodies: Sequence[str] = ()
    values: np.ndarray | None = None

    def temperature(self, mesh: Any) -> np.ndarray:
        """Change of temperature (n_node,) [K], 0 in bodies that are not heated; refuses a body that is not there."""
        names = [body.name for body in mesh.bodies] if isinstance(mesh, Assembly) else [""]
        for name in self.bodies:
            if name not in names:
                raise Refusal(f"temperature: there is no body '{name}'; there are {', '.join(names)}")
        change = np.zeros(mesh.doflocs.shape[1])
        for name, piece in zip(names, pieces(mesh), strict=True):
            if not self.bodies or name in self.bodies:
                change[piece.node : piece.node + piece.mesh.doflocs.shape[1]] = 1.0
        return change if self.values is None else change * self.values

    def vector(self, mesh: Any, node_sets: Mapping[str, np.ndarray], mass: Any = None) -> np.ndarray:
        """Force vector (3 n_node,) [N/K].

        Raises  Refusal for a body that is not there, or where nothing expands"""
        values = self.temperature(mesh)
        force = np.zeros((len(values), 3))
        for piece, material in materials_of(mesh, self.material):
            if not values[piece.node : piece.node + piece.mesh.doflocs.shape[1]].any():
                continue
            C, expansion = (
                element_tensors(piece.mesh, material, tensor_name) for tensor_name in ("tensor", "expansion_tensor")
            )
            held_back = np.einsum("eijkl,ekl->eij", C, expansion)
            for elements, nodes, N, gradient, weight in strain_points(piece.mesh, material):
                temperature = values[nodes + piece.node] @ N.T
                element_force = np.einsum(
                    "eq,eij,eqja->eai", weight * temperature, held_back[elements], gradient, optimize=True
                )
                np.add.at(force, nodes + piece.node, element_force)
        if not force.any():
            raise Refusal("temperature: no body that is heated expands; give its material an expansion")
        return force.ravel()


def temperature_at(path: Path, points: np.ndarray) -> np.ndarray:
    """Values (n,) at points (n, 3) [m] from a table with columns x, y, z [m] and value, linear between its rows; beyond
    them that of the nearest row.

    Raises  Refusal for a file that is no such table"""
    try:
        lines = text_of(path).splitlines()
        first = 0 if numbers_of(lines[0].split(",")) else 1  # the first line may name the columns
        table = np.loadtxt(lines[first:], delimiter=",", comments="#", ndmin=2)
    except (OSError, ValueError) as trouble:
        raise Refusal(f"the field '{path}' cannot be read ({trouble}): give lines x, y, z, value") from None
    if table.shape[1] != 4 or not np.isfinite(table).all():
        raise Refusal(f"the field '{path}' has {table.shape[1]} columns: give x, y, z and the value, all finite")
    nearest = scipy.interpolate.NearestNDInterpolator(table[:, :3], table[:, 3])(points)
    if len(table) < 5 or np.linalg.matrix_rank(table[:, :3] - table[0, :3]) < 3:
        return np.asarray(nearest)
    inside = scipy.interpolate.LinearNDInterpolator(table[:, :3], table[:, 3])(points)
    return np.where(np.isnan(inside), nearest, inside)
