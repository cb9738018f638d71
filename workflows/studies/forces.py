"""Static forces on every body of a scene, joint by joint, and whether they balance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tribodyn.fem.constraints import find_group
from tribodyn.fem.elasticity import assemble
from tribodyn.fem.part import Part
from tribodyn.fem.prestress import spin_softening
from tribodyn.hbm import newton
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.linear.recovery import full_displacement
from tribodyn.hbm.threads import limited
from tribodyn.workflows.run import modelling, part_reduction, settings
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import MeshScene
from tribodyn.workflows.scene.source import Overrides, Source, read_scene
from tribodyn.workflows.studies.study_result import StudyResult

TOLERANCE = 1e-12  # of the contact at rest: the balance of forces is to be seen to 1e-8


@dataclass(frozen=True)
class BodyForces:
    """Static forces on a body, their sums (3,) along x, y, z [N].

    load : of the static loads, of centrifugal force where it has moved to; joints : joint -> force of that contact
    is_supported : whether a support, a spring or a prescribed displacement carries some of it too
    """

    name: str
    load: np.ndarray
    joints: dict[str, np.ndarray]
    is_supported: bool

    @property
    def imbalance(self) -> float:
        """|load + contact forces| over the largest of them."""
        forces = np.array([self.load, *self.joints.values()])
        scale = float(np.linalg.norm(forces, axis=1).max())
        return float(np.linalg.norm(forces.sum(axis=0))) / scale if scale > 0 else 0.0


@dataclass(frozen=True, repr=False)
class Forces(StudyResult):
    """Static forces on the bodies of a scene."""

    bodies: tuple[BodyForces, ...]

    def record(self) -> dict[str, Any]:
        """For machines."""
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
        """For people."""
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
    Raises  SceneError for a scene of matrices; SolveFailed where the contact does not settle
    """
    file = read_scene(scene, overrides)
    return of_scene(file, file.mesh_scene)


def of_scene(file: SceneFile, scene: MeshScene) -> Forces:
    """The forces of a scene that was read."""
    with limited(scene.solver.threads):
        model = modelling.build(file, Progress())
        part, balance = model.part, model.balance.with_load(0.0)
        assert part is not None
        omega = 2 * np.pi * settings.response_range(scene)[0]
        solved = arc_length.solve_along_load(balance, omega, newton.NewtonOptions(tolerance=TOLERANCE))
        if not solved.converged:
            raise SolveFailed(f"the contact does not settle under the static loads: {solved.outcome}")
        force = solved.state.cycle.force
        q = full_displacement(balance, solved.state.flat, force.reshape(solved.state.flat.shape), omega)[:, 0]
    load = _loads(scene, part, balance.excitation, q)
    contact = _contact_forces(scene, part, force[:, :, 0])
    bodies = [b.name for b in part.mesh.bodies if b.name]
    sets = {name: find_group(part.node_sets, name) for name in bodies} or {"part": np.arange(len(part.points))}
    free = np.zeros(3 * len(part.points), bool)
    free[part.free] = True
    for motion in scene.prescribed.values():
        free[part.free[part.dofs(motion.group, motion.axis)]] = False
    bodies_found = []
    for name, nodes in sets.items():
        joints = {joint: on[nodes].sum(axis=0) for joint, on in contact.items() if on[nodes].any()}
        is_supported = not free.reshape(-1, 3)[nodes].all() or part.dependence is not None or bool(scene.springs)
        bodies_found.append(BodyForces(name, load[nodes].sum(axis=0), joints, is_supported))
    return Forces(tuple(bodies_found))


def _loads(scene: MeshScene, part: Part, excitation: Excitation, q: np.ndarray) -> np.ndarray:
    """Static loads at the nodes (n_node, 3) [N]; those of a turning frame grow with the static displacement q."""
    full = np.zeros(3 * len(part.points))
    full[part.free] = excitation.force(0, part.system.loads, len(part.free)).real
    if scene.wheel is not None and scene.wheel.speed:
        mass, _ = assemble(part.mesh, part_reduction.material(scene, part.mesh))
        displacement = part.field(q).ravel()
        full -= spin_softening(mass, scene.wheel.axis, 2 * np.pi * scene.wheel.speed) @ displacement
    return full.reshape(-1, 3)


def _contact_forces(scene: MeshScene, part: Part, force: np.ndarray) -> dict[str, np.ndarray]:
    """Nodal forces (n_node, 3) [N] of every joint, in a wheel those that the sector gets on both sides.

    force : (n_pair, n_component) static part of the contact forces [N]
    """
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
