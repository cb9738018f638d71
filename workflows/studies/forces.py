"""Static forces on every body of a scene, joint by joint, and whether they balance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, eye_array, vstack
from scipy.sparse.linalg import spsolve

from tribodyn.fem.constraints import find_group, free_dofs, pivoted
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.factor import factorise
from tribodyn.fem.load_vectors import Heating, Load
from tribodyn.fem.modes import stiffest
from tribodyn.fem.part import Part
from tribodyn.fem.prestress import spin_softening
from tribodyn.hbm import newton
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.linear.recovery import full_displacement
from tribodyn.hbm.threads import limited
from tribodyn.refusal import SolveFailed
from tribodyn.workflows.run import modelling, part_reduction, scene_assembly, scene_loads, settings
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import Overrides, Source, read_scene
from tribodyn.workflows.scene.schema import MeshScene
from tribodyn.workflows.studies.study_result import StudyResult

TOLERANCE = 1e-12  # of the contact at rest: the balance of forces is to be seen to 1e-8


@dataclass(frozen=True)
class BodyForces:
    """Static forces on a body, their sums (3,) along x, y, z [N].

    load : of the static loads, of centrifugal force where it has moved to
    joints : contact, "bolts.NAME" or label of a tie or coupling -> its force
    is_supported : whether a support, a spring, a neighbour or a prescribed displacement carries some of it too"""

    name: str
    load: np.ndarray
    joints: dict[str, np.ndarray]
    is_supported: bool

    @property
    def imbalance(self) -> float:
        """|load + forces of joints| over the largest of them."""
        forces = np.array([self.load, *self.joints.values()])
        scale = float(np.linalg.norm(forces, axis=1).max())
        return float(np.linalg.norm(forces.sum(axis=0))) / scale if scale > 0 else 0.0


@dataclass(frozen=True, repr=False)
class Forces(StudyResult):
    """Static forces on the bodies of a scene."""

    bodies: tuple[BodyForces, ...]

    def record(self) -> dict[str, Any]:
        return {
            body.name: {
                "load_N": body.load.tolist(),
                "joints_N": {name: force.tolist() for name, force in body.joints.items()},
                "imbalance": body.imbalance,
                "supported": body.is_supported,
            }
            for body in self.bodies
        }

    def lines(self) -> list[str]:
        texts = []
        for body in self.bodies:
            texts.append(f"{body.name}: static load {_vector(body.load)} N")
            texts += [f"  {name}: {_vector(force)} N" for name, force in body.joints.items()]
            if body.is_supported:
                remainder = -body.load - sum(body.joints.values())
                texts.append(f"  supports and neighbours: {_vector(remainder)} N")
            else:
                texts.append(f"  out of balance by {body.imbalance:.1e} of the largest")
        return texts


def forces(scene: Source, *, overrides: Overrides = ()) -> Forces:
    """Show the static forces on every body of a scene, joint by joint, and whether they balance.

    At rest under the static loads, centrifugal force included; harmonic loads are away.

    scene : name of a scene with a mesh, or a .toml file
    Raises  SceneError for a scene of matrices; SolveFailed where the contact does not settle"""
    file = read_scene(scene, overrides)
    mesh_scene = file.mesh_scene
    with limited(mesh_scene.solver.threads):
        model = modelling.build(file, Progress())
        part, balance = model.part, model.balance.with_load(0.0)
        assert part is not None
        omega = 2 * np.pi * settings.response_range(mesh_scene)[0]
        solved = arc_length.solve_along_load(balance, omega, newton.NewtonOptions(tolerance=TOLERANCE))
        if not solved.converged:
            raise SolveFailed(f"the contact does not settle under the static loads: {solved.outcome}")
        force = solved.state.cycle.force
        q = full_displacement(balance, solved.state.flat, force.reshape(solved.state.flat.shape), omega)[:, 0]
    joined = scene_assembly.connections(mesh_scene, file.folder)
    static = {name: value.real for (harmonic, name), value in balance.excitation.loads.items() if harmonic == 0}
    loads = scene_loads.loads_on(mesh_scene, part.mesh, file.folder, joined)
    acting = [(static[name], load) for name, load in loads.items() if name in static]
    if joined.constraints and mesh_scene.wheel is None and not mesh_scene.prescribed and not len(part.held_rows):
        q = _completed(part, balance.excitation.force(0, part.system.loads, len(q)).real, force[:, :, 0], q)
    u, none = part.field(q), np.zeros((len(part.points), 3))
    mass, stiffness = assemble(part.mesh, part_reduction.material(mesh_scene, part.mesh))
    for spring in joined.springs:
        stiffness = stiffness + spring.matrix(part.mesh, part.node_sets)
    load = sum(
        (value * applied.vector(part.mesh, part.node_sets, mass).reshape(-1, 3) for value, applied in acting), none
    )
    if mesh_scene.wheel is not None and mesh_scene.wheel.speed:  # in a turning frame it grows with the displacement
        softening = spin_softening(mass, mesh_scene.wheel.axis, 2 * np.pi * mesh_scene.wheel.speed)
        load = load - (softening @ u.ravel()).reshape(-1, 3)
    by_joint = _contact_forces(mesh_scene, part, force[:, :, 0]) | _bolt_forces(mesh_scene, part, static, acting, u)
    reaction = (stiffness @ u.ravel()).reshape(-1, 3) - load - sum(by_joint.values(), none)
    by_joint |= _constraint_forces(joined, part, reaction)
    sets = {b.name: find_group(part.node_sets, b.name) for b in part.mesh.bodies if b.name}
    supported = _supported(mesh_scene, part, joined)
    bodies = []
    for name, nodes in (sets or {"part": np.arange(len(part.points))}).items():
        joints = {joint: on[nodes].sum(axis=0) for joint, on in by_joint.items() if on[nodes].any()}
        bodies.append(BodyForces(name, load[nodes].sum(axis=0), joints, bool(supported[nodes].any())))
    return Forces(tuple(bodies))


def _completed(part: Part, load: np.ndarray, contact: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The static displacement q (n_free,) [m] with what the reduction left out, for the forces of ties inside.

    load : (n_free,) [N]; contact : (n_pair, n_component) forces [N]"""
    K, M, B = part.system.stiffness, part.system.mass, part.interface.B
    shift = 1e-9 * stiffest(K, M)  # K alone is singular where contact alone holds a body
    return np.asarray(q + factorise(K + shift * M).solve(load - B.T @ contact.ravel() - K @ q))


def _supported(scene: MeshScene, part: Part, joined: scene_assembly.Connections) -> np.ndarray:
    """Whether each node (n_node,) is clamped, prescribed, on a spring, or on the seam of a wheel."""
    supported = np.zeros((len(part.points), 3), bool)
    for clamp in joined.clamps:
        supported.ravel()[clamp.dofs(part.node_sets)] = True
    for spring in joined.springs:
        supported.ravel()[spring.matrix(part.mesh, part.node_sets).diagonal() > 0] = True
    seam = scene.wheel.seam if scene.wheel is not None and scene.wheel.seam else ()
    for group in (*seam, *(motion.group for motion in scene.prescribed.values())):
        supported[find_group(part.node_sets, group)] = True
    return np.asarray(supported.any(axis=1))


def _bolt_forces(
    scene: MeshScene, part: Part, static: Mapping[str, float], acting: Sequence[tuple[float, Load]], u: np.ndarray
) -> dict[str, np.ndarray]:
    """Nodal forces (n_node, 3) [N] of every bolt: tightening, elongation of its shank, and heat.

    static : load or bolt -> its size; acting : sizes and loads; u : (n_node, 3) displacement [m]"""
    heat = [(value, load.temperature(part.mesh)) for value, load in acting if isinstance(load, Heating)]
    forces_by_joint = {}
    for name, shank in modelling.shanks(scene, part.mesh, part.node_sets).items():
        tension = static[name] + shank.stiffness * float(shank.elongation(part.mesh, part.node_sets) @ u.ravel())
        tension += sum(value * shank.thermal_force(part.mesh, part.node_sets, change) for value, change in heat)
        forces_by_joint[f"bolts.{name}"] = tension * shank.vector(part.mesh, part.node_sets).reshape(-1, 3)
    return forces_by_joint


def _constraint_forces(joined: scene_assembly.Connections, part: Part, reaction: np.ndarray) -> dict[str, np.ndarray]:
    """Nodal forces (n_node, 3) [N] of every tie, coupling and link.

    A constraint u_d = G u has the forces E_d^T f - G^T f; the reaction (n_node, 3) is the sum of them all and of the
    supports, from which f follows."""
    n_dof = reaction.size
    held = np.ones(n_dof, bool)
    held[free_dofs(n_dof, joined.clamps, part.node_sets)] = False
    built = pivoted([constraint.build(part.mesh, part.node_sets) for constraint in joined.constraints], held)
    if not built:
        return {}
    dofs = np.concatenate([constraint.dofs for constraint in built])
    G = csr_matrix(vstack([constraint.map for constraint in built]))
    f = spsolve(csc_matrix(eye_array(len(dofs)) - G[:, dofs].T), reaction.ravel()[dofs])
    forces_by_joint: dict[str, np.ndarray] = {}
    start = 0
    for constraint in built:
        of = slice(start, start := start + len(constraint.dofs))
        on = -(G[of].T @ f[of])
        on[constraint.dofs] += f[of]
        forces_by_joint[constraint.label] = forces_by_joint.get(constraint.label, 0.0) + on.reshape(-1, 3)
    return forces_by_joint


def _contact_forces(scene: MeshScene, part: Part, force: np.ndarray) -> dict[str, np.ndarray]:
    """Nodal forces (n_node, 3) [N] of every joint, in a wheel those that the sector gets on both sides.

    force : (n_pair, n_component) static part of the contact forces [N]"""
    forces_by_joint: dict[str, np.ndarray] = {}
    for contact, pairs in zip(part_reduction.contacts(scene), part.pairs.values(), strict=True):
        joint_force = force[pairs].ravel()
        if contact.opposite is None:
            on = -contact.build(part.mesh).B.T @ joint_force
        else:
            interface, second = contact.halves(part.mesh)
            on = second.T @ joint_force - interface.B.T @ joint_force
        forces_by_joint[contact.joint] = forces_by_joint.get(contact.joint, 0.0) + on.reshape(-1, 3)
    return forces_by_joint


def _vector(force: np.ndarray) -> str:
    return f"({', '.join(f'{value:.6g}' for value in force)})"
