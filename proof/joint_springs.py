"""The modes of a part as functions of the stiffness of its joint springs and contact.

The part of a scene is reduced once with the nodes of all its springs kept, so that another stiffness costs a dense
eigenvalue problem: what a fit of joints to measured frequencies needs."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.linalg import eigh

from tribodyn.fem.springs import Spring
from tribodyn.reduction.craig_bampton import craig_bampton
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.prescribed import hold
from tribodyn.reduction.relative import relative
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import joints, modelling
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.solution_tables import Output


@dataclass(frozen=True)
class JointSprings:
    """The reduced part without springs, and what each spring adds per unit of its stiffness.

    springs : name in the scene -> (n, n) [-]; contact : (n_pair, n_component) stuck contact of the scene [N/m]
    declared : name -> stiffness in the scene [N/m]"""

    model: ReducedModel
    springs: Mapping[str, np.ndarray]
    contact: np.ndarray
    declared: Mapping[str, float]

    def stiffness(self, springs: Mapping[str, float], contact: np.ndarray | None = None) -> np.ndarray:
        """Stiffness matrix (n, n) [N/m]; springs : by name [N/m], the scene's by default; contact : stuck, or none."""
        chosen = {**self.declared, **springs}
        K = self.model.system.stiffness + sum(chosen[name] * unit for name, unit in self.springs.items())
        return K if contact is None else stuck_stiffness(K, self.model.interface.B, contact)

    def modes(
        self, springs: Mapping[str, float], contact: np.ndarray | None = None, n: int = 10
    ) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies (n,) [Hz] and mass-normalised shapes (n_dof, n) of the lowest modes, as for `stiffness`."""
        K = self.stiffness(springs, contact)
        squares, shapes = eigh(K, self.model.system.mass, subset_by_index=[0, n - 1])
        return np.sqrt(np.clip(squares, 0.0, None)) / (2 * np.pi), shapes

    def outputs(self, shapes: np.ndarray) -> dict[str, np.ndarray]:
        """Displacement (n,) of every output in the shapes (n_dof, n)."""
        return {name: np.asarray(row @ shapes) for name, row in self.model.system.outputs.items()}


def joint_springs(file: SceneFile, probes: Mapping[str, tuple[str, str]] | None = None) -> JointSprings:
    """Reduce the part of a scene with the nodes of all its springs kept.

    probes : name -> group and axis, such as ("tip", "y"), of displacements that are observed beside the response;
        those of the scene by default
    Raises  ValueError for a scene without springs"""
    scene = file.mesh_scene
    if not scene.springs:
        raise Refusal(f"{file.name} has no springs whose stiffness could change: add a table such as [springs.seat]")
    axes = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    outputs = scene.response.others
    if probes is not None:
        outputs = {name: Output(group=group, direction=axes[axis]) for name, (group, axis) in probes.items()}
    changes: dict[str, Any] = {"springs": {}, "prescribed": {}}
    bare = scene.model_copy(update={**changes, "response": scene.response.model_copy(update={"others": outputs})})
    with TemporaryDirectory() as folder:
        mesh, node_sets = modelling.make_mesh(file, Path(folder))
    part = modelling.make_part(bare, mesh, node_sets)
    system, interface, back = part.system, part.interface, None
    if scene.reduction.relative:
        system, interface, back = relative(system, interface)
    stretch = {}
    for name, s in scene.springs.items():
        rows, share = Spring(s.group, s.direction, 1.0, s.opposite).elongation(mesh, node_sets)
        stretch[name] = (rows[:, part.free], share)
    masters = np.unique(np.concatenate([rows.nonzero()[1] for rows, _ in stretch.values()]))
    reduced = craig_bampton(system, interface, scene.reduction.modes, scene.reduction.cutoff, masters)
    model = hold(reduced, part.held_rows)
    basis = model.origin.basis if back is None else back @ model.origin.basis
    units = {}
    for name, (rows, share) in stretch.items():
        e = np.asarray(rows @ basis)
        units[name] = e.T @ (share[:, None] * e)
    stiffnesses = {name: spring.stiffness for name, spring in scene.springs.items()}
    return JointSprings(model, units, joints.contact_stiffness(scene, model), stiffnesses)
