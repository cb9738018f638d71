"""The fretting rig of a scene, reduced once, with other heights of platform and faces, forces, damping, harmonics."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from proof.problems import cycle_at
from tests.helpers.fits import plain
from tribodyn.hbm.balance import State
from tribodyn.reduction.model import ReducedModel
from tribodyn.refusal import SolveFailed
from tribodyn.workflows.run.modelling import Model, build
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneError, SceneFile, read_scene
from tribodyn.workflows.scene.schema import MeshScene

PLATFORM, SHAKER = "platform", "shaker"  # names in the scene
TIED = {
    "base_vertical": ("base_vertical",),
    "base_sliding": ("base_along", "base_across"),
    "seat": ("seat_along", "seat_across", "seat_vertical"),
}
"""Springs of the scene that act at one joint, tied where frequencies cannot tell them apart."""


class NoSolution(RuntimeError):
    """A state of the rig was not found; the message says which."""


@dataclass(frozen=True)
class Cycle:
    """One vibration cycle of the rig.

    energy : dissipated [J]; slip : amplitude of the mean sliding displacement of the patch, half of its range [m]
    preload : static normal force of the contact [N]; reaction : static force of the platform's screws [N]
    amplitude : of the scene's response [m]"""

    state: State
    energy: float
    slip: float
    preload: float
    reaction: float
    amplitude: float


@dataclass(frozen=True)
class Rig:
    """file : the scene, with what was changed; opening : (n_pair,) of its gaps beyond it [m]."""

    file: SceneFile
    opening: np.ndarray

    @classmethod
    def of(cls, file: SceneFile) -> Rig:
        """The rig of a scene; raises SceneError as `check` does."""
        check(file)
        return cls(file, np.zeros(plain(file).interface.n_pair))

    @property
    def scene(self) -> MeshScene:
        """The scene, with what was changed."""
        return self.file.mesh_scene

    @property
    def frequency(self) -> float:
        """Frequency of the wear test [Hz]."""
        assert self.scene.wear is not None
        hertz = self.scene.wear.duties[0].at.frequency
        assert hertz is not None
        return hertz

    @property
    def height(self) -> float:
        """Platform height of the scene [m]."""
        return self.scene.prescribed[PLATFORM].displacement

    def with_height(self, height: float) -> Rig:
        """The rig with the platform at another height [m]."""
        return self.with_keys(f"prescribed.{PLATFORM}.displacement={height!r} m")

    def with_force(self, force: float) -> Rig:
        """The rig with another shaker force [N]."""
        return self.with_keys(f"loads.harmonic.{SHAKER}.value={force!r} N")

    def with_damping(self, ratio: float) -> Rig:
        """The rig with another modal damping ratio."""
        return self.with_keys(f"damping.modal={ratio!r}")

    def with_harmonics(self, harmonics: tuple[int, ...]) -> Rig:
        """The rig with other harmonics."""
        return self.with_keys(f"harmonics.kept={list(harmonics)}")

    def with_mating_height(self, rise: float) -> Rig:
        """The rig with its faces pushed on by another `more` [m] (thesis 5.5: 0, +3 and -3 um)."""
        return self.with_opening(np.full_like(self.opening, -rise))

    def with_opening(self, depth: np.ndarray) -> Rig:
        """The rig with its gaps opened by a wear depth (n_pair,) [m]."""
        return replace(self, opening=self.opening + depth)

    def with_keys(self, *overrides: str) -> Rig:
        """The rig with other keys of its scene."""
        return replace(self, file=read_scene(self.file, overrides))

    def plain(self) -> ReducedModel:
        """The reduced model, not damped, nothing prescribed."""
        return plain(self.file)

    def model(self) -> Model:
        """The nonlinear problem."""
        built = build(self.file, Progress())
        return replace(built, balance=built.balance.with_gap(built.balance.contact.gap + self.opening))

    def at_rest(self) -> Cycle:
        """The static state: the rig without its shaker force."""
        return self.with_force(0.0).cycle()

    def cycle(self, frequency: float | None = None) -> Cycle:
        """The cycle at a frequency [Hz], that of the wear test by default; raises NoSolution."""
        model, hertz = self.model(), self.frequency if frequency is None else frequency
        try:
            state = cycle_at(self.file, model.balance, hertz)
        except SolveFailed as failure:
            force = self.scene.loads.harmonic[SHAKER].amplitude
            raise NoSolution(f"the rig at {force:.4g} N: {failure}") from None
        return self.told(model, state)

    def told(self, model: Model, state: State) -> Cycle:
        """What is told about a solved state of this rig's model."""
        balance = model.balance
        interface, output = balance.model.interface, balance.outputs(state)[0]
        mean = np.tensordot(interface.area / interface.area.sum(), state.x[:, 0], axes=1)
        sliding = balance.basis.to_time(mean)
        work, stroke, amplitude = balance.energy(state).sum(), np.ptp(sliding) / 2, np.linalg.norm(output[1:])
        reaction = _reaction(self.file, model, state)
        return Cycle(state, float(work), float(stroke), balance.preload(state), reaction, float(amplitude))


def check(file: SceneFile) -> None:
    """Raise SceneError where a scene lacks what the fits and the study of the rig change or look at."""
    scene = file.mesh_scene
    wear, springs = scene.wear, [name for tied in TIED.values() for name in tied]
    for missing, key in (
        (list(scene.prescribed) != [PLATFORM], f"one table under prescribed, [prescribed.{PLATFORM}]"),
        (list(scene.loads.harmonic) != [SHAKER], f"one harmonic load, [loads.harmonic.{SHAKER}]"),
        (
            wear is None or len(wear.duties) > 1 or wear.duties[0].at.frequency is None,
            'wear at one frequency, wear.at = "290 Hz"',
        ),
        (scene.harmonics.automatic, "harmonics that are named, harmonics.kept = [0, 1, 2, 3]"),
        *((name not in scene.springs, f"the joint [springs.{name}]") for name in springs),
    ):
        if missing:
            raise SceneError(f"{file.name}: the fits and the study of the rig need {key}")


def _reaction(file: SceneFile, model: Model, state: State) -> float:
    """Static force at the prescribed nodes of a scene in a solved state of its model [N]."""
    inputs, base_reaction = next(iter(file.mesh_scene.prescribed.values())), model.balance.model.reaction
    assert base_reaction is not None
    return float(base_reaction.force(inputs.displacement, state.cycle.force[:, :, 0]).sum())
