"""Open and stuck frequencies of the fretting rig as functions of the stiffness of its joints.

The rig is reduced once with the nodes of all joints kept, so that a change of joint springs costs a dense eigenvalue
problem. Modes are told apart by how the beam moves: tangential and normal bending, twisting.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment

from tribodyn.fem.springs import Spring
from tribodyn.reduction.craig_bampton import craig_bampton
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.relative import relative
from tribodyn.workflows.cases.rig.published import OPEN, STUCK
from tribodyn.workflows.run import modelling
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import Output

KINDS = ("tangential", "normal", "twisting")
STATIONS = (1, 2, 3, 4)
MODES = 14  # looked at in each state
DOMINANT = 0.4  # share of the motion that makes a mode one of its kind
STRANGER = 10.0  # cost of calling a mode what it is not, against squared logarithms of frequencies

@dataclass(frozen=True)
class Modes:
    """frequency : (n,) [Hz]; share : (n, 3) of the motion of the beam's axis that is tangential, normal, twisting."""

    frequency: np.ndarray
    share: np.ndarray

    def assigned(self, published: Sequence[tuple[str, float]]) -> np.ndarray:
        """The frequency [Hz] of ours that stands for each published mode: of its kind, and nearest on the whole."""
        distance = np.log(self.frequency[None, :] / np.array([[value] for _, value in published])) ** 2
        for row, (kind, _) in zip(distance, published, strict=True):
            row[self.share[:, KINDS.index(kind)] < DOMINANT] = STRANGER
        return self.frequency[linear_sum_assignment(distance)[1]]


@dataclass(frozen=True)
class Joints:
    """The reduced rig without springs, and what each spring adds per unit of its stiffness.

    springs : name in the scene -> (n, n) [-]; contact : (n_pair, n_component) stuck contact [N/m]
    given : name -> stiffness in the scene [N/m]
    """

    model: ReducedModel
    springs: Mapping[str, np.ndarray]
    contact: np.ndarray
    given: Mapping[str, float]

    def modes(self, stiffness: Mapping[str, float], stuck: bool) -> Modes:
        """Modes with other springs (by name, the scene's where not told), contact open or closed and stuck."""
        K = self.stiffness(stiffness)
        if stuck:
            K = stuck_stiffness(K, self.model.interface.B, self.contact)
        squares, shapes = eigh(K, self.model.system.mass, subset_by_index=[0, MODES - 1])
        row = {name: output @ shapes for name, output in self.model.system.outputs.items()}
        energy = np.zeros((3, MODES))
        for k in STATIONS:
            turn = (row[f"high{k}_y"] - row[f"low{k}_y"]) / 2
            energy += [row[f"middle{k}_y"] ** 2, row[f"middle{k}_z"] ** 2, turn**2]
        return Modes(np.sqrt(np.abs(squares)) / (2 * np.pi), (energy / energy.sum(axis=0)).T)

    def stiffness(self, stiffness: Mapping[str, float]) -> np.ndarray:
        """Stiffness matrix with other springs."""
        chosen = {**self.given, **stiffness}
        return self.model.system.stiffness + sum(chosen[name] * unit for name, unit in self.springs.items())

    def normal_stiffness(self, stiffness: Mapping[str, float], held: str) -> float:
        """Preload per platform height [N/m] between two flat faces whose contact springs are left out.

        held : the spring through which the platform is held at its height, taken as rigid
        """
        rigid = 1e6 * max(self.given.values())
        K = self.stiffness({**stiffness, held: rigid})
        i = self.model.interface
        row = (i.area / i.area.sum()) @ i.B[i.components.index("n") :: len(i.components)]
        return float(1 / (row @ np.linalg.solve(K, row)))

    def frequencies(self, stiffness: Mapping[str, float]) -> np.ndarray:
        """Ours for all published modes [Hz], open ones first."""
        return np.concatenate(
            [self.modes(stiffness, False).assigned(OPEN), self.modes(stiffness, True).assigned(STUCK)]
        )


def joints_of(file: SceneFile) -> Joints:
    """Reduce the rig of a scene with the nodes of all its springs as masters."""
    scene = file.part_scene
    probes: dict[str, Output] = {}
    for place, axis in (("low", "y"), ("middle", "y"), ("high", "y"), ("middle", "z")):
        along = (0.0, 1.0, 0.0) if axis == "y" else (0.0, 0.0, 1.0)
        probes |= {f"{place}{k}_{axis}": Output(group=f"{place}{k}", direction=along) for k in STATIONS}
    watched = scene.response.model_copy(update={"others": probes})
    bare = scene.model_copy(update={"springs": {}, "prescribed": {}, "response": watched})
    with TemporaryDirectory() as folder:
        mesh, node_sets = modelling.make_mesh(file, Path(folder))
    part = modelling.make_part(bare, mesh, node_sets)
    system, interface, back = relative(part.system, part.interface)
    stretch = {}
    for name, s in scene.springs.items():
        rows, share = Spring(s.group, s.direction, 1.0, s.opposite).elongation(mesh, node_sets)
        stretch[name] = (rows[:, part.free], share)
    masters = np.unique(np.concatenate([rows.nonzero()[1] for rows, _ in stretch.values()]))
    model = craig_bampton(system, interface, scene.reduction.modes, scene.reduction.cutoff, masters)
    basis = back @ model.basis
    units = {}
    for name, (rows, share) in stretch.items():
        e = rows @ basis
        units[name] = e.T @ (share[:, None] * e)
    given = {name: spring.stiffness for name, spring in scene.springs.items()}
    return Joints(model, units, modelling.contact_stiffness(scene, model), given)
