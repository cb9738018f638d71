"""The wheel of a scene with blades that differ: patterns drawn at random, and the highest peak of each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tribodyn.fem.constraints import find_group
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation import highest_peak
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import adaptive, arc_length
from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.linear.travelling_wave import at_sector
from tribodyn.hbm.mistuned_wheel import MistunedWheel
from tribodyn.reduction import nominal_modes as reduction
from tribodyn.reduction.sector_reduction import ReducedSector
from tribodyn.refusal import Refusal, SolveFailed
from tribodyn.workflows.run import settings
from tribodyn.workflows.run.settings import OUTPUT
from tribodyn.workflows.scene.fields import unknown_key
from tribodyn.workflows.scene.scene_file import SceneError, SceneFile
from tribodyn.workflows.scene.wheel_tables import Mistuning
from tribodyn.workflows.studies.wheels import wheel_model as wheels

SHORTEST, LONGEST = 1e-4, 0.15  # steps of a scan, of its range: beyond a jump it continues

FURTHEST = 3.0  # standard deviations at which what is drawn is cut off


@dataclass(frozen=True)
class Pattern:
    """How the blades of one wheel differ, each (N,): relative stiffness and friction, and gap added [m]."""

    number: int
    stiffness: np.ndarray
    friction: np.ndarray
    gap: np.ndarray


def drawn(mistuning: Mistuning, n_sectors: int, number: int) -> Pattern:
    """One of the patterns of a scene; it depends on the seed and its number alone."""
    normal = np.random.default_rng([mistuning.seed, number]).normal(size=(3, n_sectors))
    frequency, friction, gap = np.clip(normal, -FURTHEST, FURTHEST)
    stiffness = (1 + mistuning.frequency * frequency) ** 2 - 1
    return Pattern(number, stiffness, mistuning.friction * friction, mistuning.gap * gap)


@dataclass(frozen=True)
class MistunedBlades:
    """The wheel of a scene, ready for any pattern.

    wheel : sectors alike, ready to deviate in some shapes"""

    file: SceneFile
    wheel: MistunedWheel

    @classmethod
    def of(cls, file: SceneFile) -> MistunedBlades:
        """Mesh and reduce; raises SceneError for a scene without [wheel] or [mistuning]."""
        table = asked_of(file)
        wheel = wheels.build(file)
        K = deviating(wheel, table.body)
        loads = sorted({name for _, name in wheel.wave().excitation.loads})
        shapes = reduction.nominal_shapes(wheel.reduced, wheel.springs, K, table.families, loads, table.left_out)
        wave = replace(wheel, reduced=reduction.with_ports(wheel.reduced, K, shapes)).wave()
        if table.friction and not wave.contact.has_friction:
            raise SceneError("mistuning.friction: no contact of this scene has friction: leave it out")
        ports = tuple(reduction.port_name(k) for k in range(shapes.shape[1]))
        return cls(file, MistunedWheel(wave, ports))

    def pattern(self, number: int) -> Pattern:
        """The pattern of this number, from 1; it depends on the seed of the scene and its number alone."""
        if number < 1:
            raise Refusal(f"--pattern {number}: patterns are counted from 1")
        return drawn(asked_of(self.file), self.wheel.n_sectors, number)

    @cached_property
    def tuned(self) -> OperatingPoint:
        """The peak of the wheel of sectors alike; raises SolveFailed."""
        point = settings.peak_of(self.file.scene).solve(self.wheel.wave)
        if not point.solution.converged:
            raise SolveFailed(f"the peak of sectors alike: {point.solution.outcome}")
        return point

    @cached_property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """(n_pair, n_component, n_coeff) of sectors alike at both ends of the range, where patterns begin."""
        tuned_wave, order = self.wheel.wave, self.wheel.model.engine_order
        starts, n = [], self.wheel.n_sectors
        for omega in settings.response_range(self.file.scene):
            x = arc_length.solve_along_load(tuned_wave, omega, settings.newton_options(self.file.scene)).state.x
            starts.append(np.concatenate([at_sector(tuned_wave.basis, x, order, n, k) for k in range(n)]))
        return starts[0], starts[1]

    def balance(self, pattern: Pattern) -> HarmonicBalance:
        """The whole wheel of a pattern."""

        def change(joint: Joint, sector: np.ndarray) -> Joint:
            opened = replace(joint.parameters, gap=joint.parameters.gap + pattern.gap[sector])
            changed = replace(joint, parameters=opened)
            return changed.with_friction_scaled(1 + pattern.friction[sector]) if pattern.friction.any() else changed

        return self.wheel.balance(pattern.stiffness, change)

    def peak(self, pattern: Pattern) -> tuple[OperatingPoint, int]:
        """The highest peak of any blade, and which blade; solves of the whole search are counted.

        Raises  SolveFailed where the response is not followed to its end, rises there, or its peak is not found"""
        scene = self.file.scene
        balance, names = self.balance(pattern), [f"{OUTPUT}@{n}" for n in range(self.wheel.n_sectors)]
        low, high = settings.response_range(scene)
        scan = adaptive.Options(
            tolerance=asked_of(self.file).tolerance, step=0.02, max_step=LONGEST, min_step=SHORTEST,
            newton=settings.newton_options(scene), guess=self.ends[0],
        )  # fmt: skip

        def tall(branch: Branch) -> np.ndarray:
            return np.column_stack([branch.amplitude(name) for name in names])

        def is_past_peak(branch: Branch) -> bool:
            return tall(branch).argmax() // len(names) not in (0, len(branch.omega) - 1)

        # friction softens: from above the response is followed over its peak, and jumps behind it if at all
        branch = adaptive.follow(balance, high, low, replace(scan, guess=self.ends[1], jumps=False))
        if not branch.arrived and is_past_peak(branch):
            lower = adaptive.follow(balance, low, branch.omega[-1], replace(scan, jumps=False))
            is_complete = lower.arrived and tall(lower).max() < tall(branch).max()
        else:
            is_complete = branch.arrived and is_past_peak(branch)
        if not is_complete:
            branch = adaptive.follow(balance, low, high, scan)
            if not branch.arrived:
                raise SolveFailed(f"the frequency response {branch.end}")
            if not is_past_peak(branch):
                raise SolveFailed("the response still rises at an end of response.frequency: extend it")
        heights = tall(branch)
        best, blade = highest_peak.highest(balance, branch, names, settings.peak_of(scene))
        if best is None or best.amplitude < (1 - asked_of(self.file).tolerance) * heights.max():
            raise SolveFailed(f"the highest peak, near {_hertz(branch.omega[heights.argmax() // len(names)])}, is lost")
        return best, blade


def asked_of(file: SceneFile) -> Mistuning:
    """The table [mistuning]; raises SceneError for a scene without it."""
    if file.mesh_scene.mistuning is None:
        raise SceneError(f"{file.name} has no [mistuning]: say how far its blades differ, such as frequency = '1 %'")
    return file.mesh_scene.mistuning


def deviating(wheel: wheels.Wheel, body: str | None) -> np.ndarray:
    """The elastic stiffness (n, n) of the reduced sector that deviates: all of it, or that of one body."""
    reduced: ReducedSector = wheel.reduced
    if body is None:
        return wheel.elastic
    bodies = [body_of_mesh.name for body_of_mesh in getattr(wheel.part.mesh, "bodies", ()) if body_of_mesh.name]
    if body not in bodies:
        raise SceneError(unknown_key(f"mistuning.body: {body}", bodies))
    if wheel.part.dependence is not None:
        raise SceneError("mistuning.body: bodies that are glued or tied have no stiffness of their own: leave it out")
    nodes = np.zeros(len(wheel.part.points), bool)
    nodes[find_group(wheel.part.node_sets, body)] = True
    free_dofs = np.flatnonzero(np.repeat(nodes, 3)[wheel.part.free])
    basis = reduced.origin.basis[free_dofs]
    return np.asarray(basis.T @ (wheel.part.system.stiffness[free_dofs][:, free_dofs] @ basis))


def _hertz(omega: float) -> str:
    return f"{omega / (2 * np.pi):.5g} Hz"
