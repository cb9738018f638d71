"""From a part to its reduced model: masters, relative coordinates, prescribed displacement."""

from dataclasses import replace
from typing import Any

import numpy as np

from tribodyn.fem.assembly import pieces
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.factor import SingularStiffness
from tribodyn.fem.interface import COMPONENTS
from tribodyn.fem.part import Part
from tribodyn.fem.springs import Spring
from tribodyn.reduction.craig_bampton import craig_bampton
from tribodyn.reduction.interface_modes import interface_modes
from tribodyn.reduction.model import ReducedModel, ReductionBasis
from tribodyn.reduction.prescribed import prescribe
from tribodyn.reduction.relative import body_1_dofs, relative
from tribodyn.reduction.residual_flexibility import residual_flexibility
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import joints, scene_assembly
from tribodyn.workflows.scene.schema import MeshScene, Scene

BOLTS = "bolts."  # begins the names of outputs that are elongations of bolts
MOST_MASTERS = 3000  # contact DOFs up to which all of them remain coordinates by default


def material(scene: MeshScene, mesh: Any = None) -> Any:
    """What the part is made of, or what every body of an assembly is made of."""
    return mesh.material if scene.material is None else scene_assembly.make_material(scene.material)


def components(scene: Scene) -> tuple[str, ...]:
    """Contact components that some joint models, in their order."""
    modelled = {c for contact in scene.joints.values() for c in contact.components}
    return tuple(c for c in COMPONENTS if c in modelled) or COMPONENTS


def contacts(scene: MeshScene) -> list[ContactFaces]:
    """The contact of every face; in a wheel some second faces are those of the next sector."""
    contact_faces = []
    for name, c in scene.joints.items():
        joint_faces = [
            ContactFaces(
                face, c.t1, c.opposite, components(scene), c.gap, c.vertices_only, c.plane, c.inclination, c.pairing,
                c.reach, name,
            )
            for face in c.groups
        ]  # fmt: skip
        if c.meets_next and scene.wheel is not None:
            from tribodyn.fem.cyclic_symmetry import with_neighbours  # only wheels need it

            joint_faces = with_neighbours(joint_faces, scene.wheel.sectors, scene.wheel.axis)
        contact_faces += joint_faces
    return contact_faces


def reduce(scene: MeshScene, part: Part) -> ReducedModel:
    """The part on its contact, load and prescribed nodes and a few modes; not damped yet, nothing prescribed yet."""
    options, system, interface, back = scene.reduction, part.system, part.interface, None
    if without_masters(scene, interface.B.shape[0], len(part.held_rows) > 0):
        springs = joints.contact_stiffness(scene, joints.unreduced(part))
        sparse_solver = "mumps" if options.solver == "mumps" else None
        return residual_flexibility(system, interface, springs, options.modes, options.cutoff, solver=sparse_solver)
    prescribed_dofs = [part.dofs(table.group, table.axis) for table in scene.prescribed.values()]
    if prescribed_dofs and len(part.held_rows):
        raise Refusal("prescribed: a part whose turning is held cannot have prescribed nodes; hold it by springs")
    relative_dofs = np.zeros(0, int)
    if options.relative:
        relative_dofs = body_1_dofs(interface).ravel()
        system, interface, back = relative(system, interface)
    # a shank stays physical: a joint that slides is told by it
    shanks = [np.flatnonzero(row) for name, row in part.system.outputs.items() if name.startswith(BOLTS)]
    extra = np.concatenate([[], *prescribed_dofs, *shanks]).astype(int)
    held_rows = part.held_rows if back is None else part.held_rows @ back
    solver = None if options.solver == "direct" else options.solver

    def reduced_on(masters: np.ndarray) -> ReducedModel:
        return craig_bampton(system, interface, options.modes, options.cutoff, masters, solver, held_rows)

    try:
        reduced = reduced_on(extra)
    except SingularStiffness:  # a body that no support, joint or load has a master on
        extra = np.union1d(extra, anchors(part, relative_dofs))
        reduced = reduced_on(extra)
    if options.interface_modes is not None:
        masters = reduced.origin.masters
        touched = np.flatnonzero(np.abs(np.asarray(reduced.interface.B)[:, : len(masters)]).max(axis=0))
        keep = np.union1d(np.delete(masters, touched), extra)
        if options.interface_keep is not None:
            named = [part.dofs(group, axis) for group in options.interface_keep for axis in "xyz"]
            keep = np.union1d(np.intersect1d(np.concatenate([[], *named]), masters), extra)
        reduced = interface_modes(reduced, options.interface_modes, keep.astype(int), separate=extra)
    if back is None:
        return reduced
    assert isinstance(reduced.origin, ReductionBasis)
    return replace(reduced, origin=replace(reduced.origin, basis=back @ reduced.origin.basis))


def without_masters(scene: MeshScene, contact_dofs: int, has_constraints: bool) -> bool:
    """Whether the contact DOFs are no coordinates: as the scene asks, else where there are thousands of them.

    has_constraints : whether motions are held besides the clamps
    Raises  Refusal where the scene asks for it and has what needs them"""
    method = scene.reduction.method
    needs = {"[wheel]": scene.wheel, "[prescribed]": scene.prescribed, "no_turning": has_constraints}
    needed = [name for name, is_present in needs.items() if is_present]
    if method == "residual_flexibility" and needed:
        raise Refusal(f'reduction.method: "residual_flexibility" cannot do {needed[0]}: take "craig_bampton"')
    if method != "auto":
        return method == "residual_flexibility"
    return contact_dofs > MOST_MASTERS and not needed and not scene.reduction.needs_masters


def anchors(part: Part, relative_dofs: np.ndarray) -> np.ndarray:
    """Free DOFs of three nodes far apart on every body, without which it cannot move rigidly.

    relative_dofs : free DOFs that have become relative displacements, which hold nothing"""
    dofs = []
    moves = np.full(3 * len(part.points), -1)
    moves[part.free] = np.arange(len(part.free))
    moves[part.free[relative_dofs]] = -1
    for piece in pieces(part.mesh):
        nodes = piece.node + np.arange(piece.mesh.doflocs.shape[1])
        nodes = nodes[(moves.reshape(-1, 3)[nodes] >= 0).all(axis=1)]
        if len(nodes) < 3:
            continue
        x = part.points[nodes]
        first = int(np.linalg.norm(x - x.mean(axis=0), axis=1).argmax())
        second = int(np.linalg.norm(x - x[first], axis=1).argmax())
        third = int(np.linalg.norm(np.cross(x - x[first], x[second] - x[first]), axis=1).argmax())
        dofs.append(moves.reshape(-1, 3)[nodes[[first, second, third]]].ravel())
    return np.concatenate([[], *dofs]).astype(int)


def with_prescribed(scene: MeshScene, part: Part, reduced: ReducedModel) -> ReducedModel:
    """The reduced model with the static displacement that the scene prescribes as a static load of that name."""
    for name, table in scene.prescribed.items():
        dofs = part.dofs(table.group, table.axis)
        support = np.zeros(len(dofs))
        for spring in (scene.springs[spring] for spring in table.springs):
            matrix = Spring(spring.group, spring.direction, spring.stiffness).matrix(part.mesh, part.node_sets)
            support += matrix.diagonal()[part.free[dofs]]
        masters = np.searchsorted(reduced.origin.masters, dofs)
        reduced = prescribe(reduced, masters, name, support=support)
    return reduced
