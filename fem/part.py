"""From meshes to a full second-order system with its contacts: the chain that a scene runs for each structure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from tribodyn.fem.assembly import Assembly
from tribodyn.fem.constraints import AXES, Clamp, Constraint, NoMeanRotation, find_group, free_dofs, restriction
from tribodyn.fem.contact_faces import ContactFaces, no_contact
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.elements import coordinates
from tribodyn.fem.interface import ContactInterface, join
from tribodyn.fem.load_vectors import Load
from tribodyn.fem.springs import Mass
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.refusal import Refusal


class StiffnessElement(Protocol):
    """What adds stiffness (3 n_node, 3 n_node) [N/m]: a spring, a bolt."""

    def matrix(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> csr_matrix: ...


@dataclass(frozen=True)
class Part:
    """system : over the free DOFs; interface : likewise; free : (n_free,) DOF of the mesh that each one is,
    node * 3 + component; points : (n_node, 3) coordinates of the nodes [m]; nodes : (n_pair,) nearest to the pairs
    mesh : scikit-fem's, or an assembly
    held_rows : (k, n_free) further prescribed motions, held_rows @ q = 0, for reduction.prescribed
    pairs : contact face -> its pairs in the interface; node_sets : as geometry.mesh.read gives them
    joints : joint -> its pairs
    dependence : (n_dof, n_free) displacement of all DOFs where some depend on others, else None"""

    system: SecondOrderSystem
    interface: ContactInterface
    free: np.ndarray
    points: np.ndarray
    nodes: np.ndarray
    mesh: Any
    held_rows: np.ndarray
    pairs: Mapping[str, slice]
    node_sets: Mapping[str, np.ndarray]
    joints: Mapping[str, slice] = field(default_factory=dict)
    dependence: csr_matrix | None = None

    def dofs(self, group: str, axis: str) -> np.ndarray:
        """Places among the free DOFs (k,) of the displacements of a node set along "x", "y" or "z".

        Raises  Refusal where the set is unknown or empty, or where one of them is clamped"""
        group_dofs = find_group(self.node_sets, group) * 3 + AXES.index(axis)
        place = np.searchsorted(self.free, group_dofs)
        if not np.array_equal(self.free[np.minimum(place, len(self.free) - 1)], group_dofs):
            raise Refusal(f"a node of '{group}' is clamped along {axis}; choose nodes that can move")
        return place

    def field(self, q: np.ndarray) -> np.ndarray:
        """Displacement (n_node, 3, ...) [m] of all nodes from free DOFs q (n_free, ...)."""
        full = np.zeros((3 * len(self.points), *q.shape[1:]), dtype=q.dtype)
        if self.dependence is None:
            full[self.free] = q
        else:
            full = (self.dependence @ q.reshape(len(q), -1)).reshape(full.shape)
        return full.reshape(len(self.points), 3, *q.shape[1:])

    def largest(self, q: np.ndarray) -> float:
        """Largest displacement of a node [m] under free DOFs q (n_free,)."""
        return float(np.linalg.norm(self.field(q), axis=1).max())

    def rows(self, vectors: Any) -> Any:
        """Rows (k, n_dof) over all DOFs, sparse, as rows (k, n_free) over the free ones."""
        return vectors[:, self.free] if self.dependence is None else csr_matrix(vectors @ self.dependence)

    def restricted(self, matrix: Any) -> Any:
        """A symmetric matrix (n_dof, n_dof) over all DOFs as one (n_free, n_free) over the free ones."""
        if self.dependence is None:
            return matrix[self.free][:, self.free]
        return csr_matrix(self.dependence.T @ matrix @ self.dependence)

    def force(self, vector: np.ndarray) -> np.ndarray:
        """A force (n_dof,) on all DOFs as one (n_free,) on the free ones."""
        return vector[self.free] if self.dependence is None else np.asarray(self.dependence.T @ vector)


def build(
    mesh: Any, node_sets: Mapping[str, np.ndarray], material: Any, clamps: Sequence[Clamp],
    contacts: Sequence[ContactFaces], loads: Mapping[str, Load], outputs: Mapping[str, Load],
    springs: Sequence[StiffnessElement] = (), held_motions: Sequence[NoMeanRotation] = (),
    constraints: Sequence[Constraint] = (), masses: Sequence[Mass] = (),
) -> Part:  # fmt: skip
    """Assemble a part or an assembly, hold it, and define where it touches, is loaded and is observed.

    mesh, node_sets : as geometry.mesh.read gives them, or an Assembly and its node sets
    material : one, or subdomain name -> material; of an assembly one, or body name -> these
    springs : joints that give way, to the ground or between sets
    held_motions : prescribed, too; constraints : DOFs that depend on others; masses : on points or sets
    Raises  Refusal where a name is unknown or a group is empty, one sentence"""
    M, K = assemble(mesh, material)
    K = sum((spring.matrix(mesh, node_sets) for spring in springs), start=K)
    M = sum((mass.matrix(mesh, node_sets) for mass in masses), start=M)
    points = coordinates(mesh)
    free = free_dofs(K.shape[0], clamps, node_sets)
    dependence = None
    if constraints:
        free, dependence = restriction(
            K.shape[0], free, [constraint.build(mesh, node_sets) for constraint in constraints]
        )
    interfaces = [contact.build(mesh) for contact in contacts]
    ends = np.cumsum([0] + [contact_interface.n_pair for contact_interface in interfaces])
    interface = join(interfaces) if interfaces else no_contact(K.shape[0])
    pairs: dict[str, slice] = {}
    joints: dict[str, slice] = {}
    for i, contact in enumerate(contacts):
        pairs_of_contact = slice(*ends[i : i + 2].tolist())
        pairs[contact.face if contact.face not in pairs else f"{contact.face} on {contact.opposite}"] = pairs_of_contact
        joint = contact.joint or contact.face
        joints[joint] = slice(joints[joint].start if joint in joints else pairs_of_contact.start, pairs_of_contact.stop)
    rows = np.array([motion.row(points, M) for motion in held_motions]).reshape(len(held_motions), K.shape[0])
    nothing, nearest_nodes = SecondOrderSystem(M, K), scipy.spatial.cKDTree(points).query(interface.points)[1]
    part = Part(nothing, interface, free, points, nearest_nodes, mesh, rows, pairs, node_sets, joints, dependence)
    system = SecondOrderSystem(
        mass=part.restricted(M),
        stiffness=part.restricted(K),
        loads={
            name: _on_free_dofs(part, f"load '{name}'", load.vector(mesh, node_sets, M)) for name, load in loads.items()
        },
        outputs={
            name: _on_free_dofs(part, f"output '{name}'", of.vector(mesh, node_sets, M)) for name, of in outputs.items()
        },
    )
    held_rows = np.array([part.force(row) for row in rows]).reshape(len(held_motions), len(free))
    interface = replace(interface, B=part.rows(interface.B))
    return replace(part, system=system, interface=interface, held_rows=held_rows)


def _on_free_dofs(part: Part, label: str, vector: np.ndarray) -> np.ndarray:
    """A load or output (n_dof,) on the free DOFs; raises Refusal where it is on held ones alone."""
    felt = part.force(vector)
    if vector.any() and not felt.any():
        raise Refusal(f"{label} is on nodes alone that are held along its direction: name a group that can move")
    return felt


def unbalanced_load(force: np.ndarray, part: Part, motions: np.ndarray) -> str:
    """A sentence on static loads that push rigid motions of a structure, with their resultant.

    force : (n_free,) of all static loads [N]; motions : (n_free, r) the rigid motions that it pushes"""
    motion_size = np.linalg.norm(part.field(motions), axis=(1, 2))
    moves = motion_size > 1e-6 * motion_size.max()
    names = [""]
    if isinstance(part.mesh, Assembly):
        names = [body.name for body in part.mesh.bodies if body.name and moves[part.node_sets[body.name]].any()]
    centre = part.points[moves].mean(axis=0)
    arm = part.points - centre
    shifts = np.broadcast_to(np.eye(3)[:, None, :], (3, len(arm), 3))
    turns = np.stack([np.cross(axis, arm) for axis in np.eye(3)])
    full = np.concatenate([shifts, turns]) * moves[:, None]
    for node, turn in part.mesh.points.values() if isinstance(part.mesh, Assembly) else ():
        full[:3, turn], full[3:, turn] = 0.0, np.eye(3) * moves[node]
    resultant = full.reshape(6, -1)[:, part.free] @ force
    size, reach = float(np.abs(force).sum()), float(np.abs(arm).max())
    where = _vector(1e3 * centre, 1e-6 * reach)
    it, label = "them" if len(names) > 1 else "it", " and ".join(filter(None, names)) or "the structure"
    return (
        f"nothing holds {label}, and the static loads on {it} are not in equilibrium: their resultant is "
        f"{_vector(resultant[:3], 1e-9 * size)} N with {_vector(resultant[3:], 1e-9 * size * reach)} N m about "
        f"{where} mm: balance them, clamp {it} or add a spring"
    )


def _vector(values: np.ndarray, least: float) -> str:
    """A vector in words; what is not above `least` is rounding."""
    return f"({', '.join(f'{v if abs(v) > least else 0.0:.4g}' for v in values)})"
