"""The fretting rig of a scene, reduced once, with other heights of platform and faces, forces, damping, harmonics."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from tribodyn.fem.part import Part
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation.arc_length import solve_along_load
from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.result.result import Patch
from tribodyn.workflows.run import modelling, part_reduction
from tribodyn.workflows.run.references import free_deflection
from tribodyn.workflows.scene.scene_file import SceneError, SceneFile
from tribodyn.workflows.scene.schema import Damping, PartScene

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
    amplitude : of the scene's response [m]
    """

    state: State
    energy: float
    slip: float
    preload: float
    reaction: float
    amplitude: float


@dataclass(frozen=True)
class Rig:
    """scene : as read; part : with the gap of its faces; plain : reduced, not damped, nothing prescribed.

    folder : where relative file names of the scene begin
    """

    scene: PartScene
    part: Part
    plain: ReducedModel
    folder: Path

    @classmethod
    def of(cls, file: SceneFile) -> Rig:
        """Build and reduce the rig of a scene; raises SceneError as `check` does."""
        check(file)
        scene = file.part_scene
        with TemporaryDirectory() as folder:
            mesh, node_sets = modelling.make_mesh(file, Path(folder))
        part, _ = modelling.with_surfaces(scene, modelling.make_part(scene, mesh, node_sets), file.folder)
        return cls(scene, part, part_reduction.reduce(scene, part), file.folder)

    @property
    def omega(self) -> float:
        """Frequency of the wear test [rad/s]."""
        assert self.scene.wear is not None
        assert self.scene.wear.at.frequency is not None
        return 2 * np.pi * self.scene.wear.at.frequency

    @property
    def height(self) -> float:
        """Platform height of the scene [m]."""
        return self.scene.prescribed[PLATFORM].displacement

    def with_height(self, height: float) -> Rig:
        """The rig with the platform at another height [m]."""
        given = self.scene.prescribed[PLATFORM].model_copy(update={"displacement": height})
        return self._changed(prescribed={PLATFORM: given})

    def with_force(self, force: float) -> Rig:
        """The rig with another shaker force [N]."""
        shaker = self.scene.loads.harmonic[SHAKER].model_copy(update={"value": force})
        return self._changed(loads=self.scene.loads.model_copy(update={"harmonic": {SHAKER: shaker}}))

    def with_damping(self, ratio: float) -> Rig:
        """The rig with another modal damping ratio."""
        return self._changed(damping=Damping(modal=ratio))

    def with_harmonics(self, kept: tuple[int, ...]) -> Rig:
        """The rig with other harmonics."""
        return self._changed(harmonics=self.scene.harmonics.model_copy(update={"kept": kept}))

    def with_mating_height(self, more: float) -> Rig:
        """The rig with its faces pushed on by another `more` [m] (thesis 5.5: 0, +3 and -3 um)."""
        return self.with_opening(np.full(self.plain.interface.n_pair, -more))

    def with_opening(self, depth: np.ndarray) -> Rig:
        """The rig with its gaps opened by a wear depth (n_pair,) [m]."""
        interface = self.plain.interface
        return replace(self, plain=replace(self.plain, interface=replace(interface, gap=interface.gap + depth)))

    def _changed(self, **changes: object) -> Rig:
        return replace(self, scene=self.scene.model_copy(update=changes))

    def model(self) -> modelling.Model:
        """The nonlinear problem."""
        damped = modelling.damped(self.scene, self.plain)
        reduced = part_reduction.with_prescribed(self.scene, self.part, damped)
        return modelling.make_model(self.scene, self.part, reduced)

    def patch(self, balance: HarmonicBalance) -> Patch:
        """The contact patch as pictures need it; `balance` is this rig's problem."""
        i = self.plain.interface
        nodes = np.full(i.n_pair, -1)
        return Patch(i.components, nodes, i.points, i.frames, i.area, i.gap, i.faces, free_deflection(balance))

    def at_rest(self) -> Cycle:
        """The static state: the rig without its shaker force."""
        return self.with_force(0.0).cycle()

    def cycle(self, omega: float | None = None) -> Cycle:
        """The cycle at a frequency [rad/s], that of the wear test unless told; raises NoSolution."""
        balance, omega = self.model().balance, self.omega if omega is None else omega
        options = newton.NewtonOptions(tolerance=self.scene.solver.tolerance)
        solution = solve_along_load(balance, omega, options)
        if not solution.converged:
            force = self.scene.loads.harmonic[SHAKER].amplitude
            raise NoSolution(f"the rig at {omega / (2 * np.pi):.4g} Hz and {force:.4g} N: {solution.outcome}")
        return cycle_of(balance, solution.state, self.height)


def check(file: SceneFile) -> None:
    """Raise SceneError where a scene lacks what the fits and the study of the rig change or look at."""
    scene = file.part_scene
    wear, springs = scene.wear, [name for tied in TIED.values() for name in tied]
    for missing, key in (
        (list(scene.prescribed) != [PLATFORM], f"one table under prescribed, [prescribed.{PLATFORM}]"),
        (list(scene.loads.harmonic) != [SHAKER], f"one harmonic load, [loads.harmonic.{SHAKER}]"),
        (wear is None or bool(wear.mission) or wear.at.frequency is None, 'wear at one frequency, wear.at = "290 Hz"'),
        (scene.harmonics.automatic, "harmonics that are named, harmonics.kept = [0, 1, 2, 3]"),
        *((name not in scene.springs, f"the joint [springs.{name}]") for name in springs),
    ):
        if missing:
            raise SceneError(f"{file.name}: the fits and the study of the rig need {key}")


def cycle_of(balance: HarmonicBalance, state: State, height: float) -> Cycle:
    """What is told about a solved state."""
    interface, output = balance.model.interface, balance.outputs(state)[0]
    mean = np.tensordot(interface.area / interface.area.sum(), state.x[:, 0], axes=1)
    sliding = balance.basis.to_time(mean)
    reaction = part_reduction.reaction_of(balance.model).force(height, state.cycle.force[:, :, 0])
    return Cycle(
        state,
        float(balance.energy(state).sum()),
        float(np.ptp(sliding)) / 2,
        balance.preload(state),
        float(reaction.sum()),
        float(np.linalg.norm(output[1:])),
    )
