"""Open and stuck frequencies of the fretting rig as functions of the stiffness of its joints.

The rig is reduced once with the nodes of all joints kept, so that a change of joint springs costs a dense eigenvalue
problem. Modes are told apart by how the beam moves, tangential and normal bending, twisting: frequencies alone mislead
where modes cross."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from proof.cases.rig.published import OPEN, STUCK
from proof.joint_springs import JointSprings, joint_springs
from tribodyn.workflows.scene.scene_file import SceneFile

KINDS = ("tangential", "normal", "twisting")
STATIONS = (1, 2, 3, 4)
MODES = 14  # looked at in each state


@dataclass(frozen=True)
class Modes:
    """frequency : (n,) [Hz]; share : (n, 3) of the motion of the beam's axis that is tangential, normal, twisting."""

    frequency: np.ndarray
    share: np.ndarray

    def assigned(self, published: Sequence[tuple[str, float]]) -> np.ndarray:
        """The frequency [Hz] of ours that stands for each published mode: of its kind, and nearest on the whole."""
        expected = [(KINDS.index(kind), value) for kind, value in published]
        return self.frequency[match_kinds(self.frequency, self.share, expected)]


@dataclass(frozen=True)
class Joints:
    """The reduced rig as a function of the stiffness of its joints."""

    springs: JointSprings

    def modes(self, stiffness: Mapping[str, float], stuck: bool) -> Modes:
        """Modes with other springs (by name, the scene's by default), contact open or closed and stuck."""
        frequency, shapes = self.springs.modes(stiffness, self.springs.contact if stuck else None, MODES)
        row = self.springs.outputs(shapes)
        energy = np.zeros((3, MODES))
        for k in STATIONS:
            turn = (row[f"high{k}_y"] - row[f"low{k}_y"]) / 2
            energy += [row[f"middle{k}_y"] ** 2, row[f"middle{k}_z"] ** 2, turn**2]
        return Modes(frequency, (energy / energy.sum(axis=0)).T)

    def frequencies(self, stiffness: Mapping[str, float]) -> np.ndarray:
        """Ours for all published modes [Hz], open ones first."""
        return np.concatenate(
            [self.modes(stiffness, False).assigned(OPEN), self.modes(stiffness, True).assigned(STUCK)]
        )


def joints_of(file: SceneFile) -> Joints:
    """Reduce the rig of a scene with the nodes of all its springs kept."""
    places = (("low", "y"), ("middle", "y"), ("high", "y"), ("middle", "z"))
    probes = {f"{place}{k}_{axis}": (f"{place}{k}", axis) for place, axis in places for k in STATIONS}
    return Joints(joint_springs(file, probes))


def match_kinds(
    frequency: np.ndarray,
    share: np.ndarray,
    targets: Sequence[tuple[int, float]],
    dominant: float = 0.4,
    stranger: float = 10.0,
) -> np.ndarray:
    """The mode (n_target,) that stands for each target: of its kind, and nearest in frequency on the whole.

    frequency : (n,) of the modes; share : (n, n_kind) of each mode's motion that is of a kind
    targets : kind and frequency of each; dominant : share from which on a mode counts as one of a kind
    stranger : cost of a mode of another kind, beside squared logarithms of ratios of frequencies
    Returns indices into frequency, no two the same; where there are too few modes of a kind, one of another kind stands
    Raises  ValueError where there are fewer modes than wanted ones"""
    if len(targets) > len(frequency):
        raise ValueError(f"{len(targets)} modes are wanted of {len(frequency)}: compute more modes")
    distance = np.log(np.asarray(frequency)[None, :] / np.array([[value] for _, value in targets])) ** 2
    for row, (kind, _) in zip(distance, targets, strict=True):
        row[share[:, kind] < dominant] = stranger
    return np.asarray(linear_sum_assignment(distance)[1])
