"""The wheel of a scene, reduced once: any engine order, range of frequencies and speed, or all sectors at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from tribodyn.fem.cyclic_symmetry import Sector
from tribodyn.fem.modes import StaticDivergence
from tribodyn.fem.part import Part
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import adaptive
from tribodyn.hbm.linear.travelling_wave import on_wheel
from tribodyn.reduction.sector_reduction import ReducedSector, nodal_diameters
from tribodyn.reduction.wave_model import Crossing, Crossings, harmonic_index, travelling_wave, wheel_model
from tribodyn.refusal import SolveFailed
from tribodyn.workflows.run import joints, modelling, sector as sectors
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.run.sanity_checks import TYPICAL
from tribodyn.workflows.scene.scene_file import SceneError, SceneFile
from tribodyn.workflows.scene.schema import MeshScene, has_wheel
from tribodyn.workflows.scene.wheel_scene import WheelScene
from tribodyn.workflows.scene.wheel_tables import WheelTable

MAX_POINTS = 1000  # of a response
Wave = Callable[[float], np.ndarray]
"""Frequencies (families,) [Hz] of a wave at a speed [Hz]."""
Waves = dict[str, dict[int, Wave]]
"""State of the contact, "free" or "stuck" -> harmonic index -> its wave."""


@dataclass(frozen=True)
class Wheel:
    """full, reduced : the sector of the scene's wheel before and after reduction; part : its mesh and DOFs."""

    file: SceneFile
    part: Part
    full: Sector
    reduced: ReducedSector

    @property
    def scene(self) -> MeshScene:
        """The scene."""
        return self.file.mesh_scene

    @property
    def table(self) -> WheelTable:
        """The table [wheel] of the scene."""
        return wheel_scene(self.file).wheel

    @property
    def n_sectors(self) -> int:
        """Number of sectors."""
        return self.reduced.sector.n_sectors

    @property
    def elastic(self) -> np.ndarray:
        """(n, n) stiffness of the reduced sector without that of its stress at speed and spin softening [N/m]."""
        if self.full.prestress is None:
            return np.asarray(self.reduced.sector.system.stiffness)
        basis = self.reduced.origin.basis
        return np.asarray(basis.T @ (self.part.system.stiffness @ basis))

    @property
    def springs(self) -> np.ndarray:
        """(n_pair, n_component) stuck, closed contact [N/m]."""
        return joints.contact_stiffness(self.scene, travelling_wave(self.reduced, 0))

    def diagram(self, diameters: Sequence[int], families: int, stuck: bool, full: bool = False) -> np.ndarray:
        """Frequencies (n_diameter, families) [Hz] of nodal diameters, of the reduced or of the full sector.

        nan where the contact is open and rotation carries away what only it holds"""
        sector = self.full if full else self.reduced.sector
        try:
            return nodal_diameters(sector, diameters, families, self.springs if stuck else None)
        except StaticDivergence:
            if stuck:
                raise
            return np.full((len(diameters), families), np.nan)

    def wave(self, engine_order: int | None = None, frequency: tuple[float, float] | None = None) -> HarmonicBalance:
        """The balance under a travelling wave; engine order and range of frequencies [Hz] default to the scene's."""
        scene = self.scene_for(engine_order, frequency)
        order = self.table.engine_order if engine_order is None else engine_order
        reduced = modelling.damped(scene, travelling_wave(self.reduced, order))
        return modelling.make_model(scene, self.part, reduced).balance

    def scene_for(self, engine_order: int | None = None, frequency: tuple[float, float] | None = None) -> MeshScene:
        """The scene with another engine order or range of frequencies [Hz]; raises SceneError along the speed."""
        wheel, response = self.table, self.scene.response
        if wheel.along_speed:
            raise SceneError(
                'wheel.sweep = "speed": this study is at one speed; give --set wheel.sweep=frequency '
                f'--set "wheel.speed={60 * wheel.speed:.6g} rpm" and a range in response.frequency'
            )
        if engine_order is not None:
            wheel = wheel.model_copy(update={"engine_order": engine_order})
        if frequency is not None:
            response = response.model_copy(update={"frequency": frequency, "references": None})
        return self.scene.model_copy(update={"wheel": wheel, "response": response})

    def whole_wheel(self, stiffness: Sequence[float] | None = None) -> HarmonicBalance:
        """The balance of all sectors at once, outputs and loads named "<name>@<sector>".

        stiffness : (n_sectors,) factor on the elastic stiffness of each sector, such as blades that differ: what a
            travelling wave of one sector cannot say"""
        wave = self.wave()
        springs = np.tile(wave.contact.stiffness, (self.n_sectors, 1))
        model = wheel_model(self.reduced, stiffness, self.elastic)
        model = model.with_damping(partial(modelling.damping_matrix, self.scene, springs))
        load = on_wheel(wave.excitation, self.table.engine_order, self.n_sectors)
        return HarmonicBalance.of(model, wave.contact.repeat(self.n_sectors), wave.basis, load, wave.omega_max)

    def at_speed(self, speed: float) -> Wheel:
        """The same wheel turning at a speed [Hz]: stiffened by its stress, softened by its frame; not meshed again."""
        part, turning = self.part_at(speed)
        return assembled(turning, part)

    def part_at(self, speed: float) -> tuple[Part, SceneFile]:
        """Its part, not meshed again, and its scene at a speed [Hz]."""
        turning = self.table.model_copy(update={"speed": speed, "sweep": None})
        scene = self.scene.model_copy(update={"wheel": turning})
        part = modelling.make_part(scene, self.part.mesh, dict(self.part.node_sets), self.file.folder)
        return part, replace(self.file, scene=scene)


def follow(balance: HarmonicBalance, frequency: tuple[float, float], tolerance: float) -> Branch:
    """The response over a range [Hz], its points as dense as the tolerance of the curve between them asks.

    Raises  SolveFailed where the curve does not come to the end of the range"""
    low, high = (2 * np.pi * hertz for hertz in frequency)
    options = adaptive.Options(tolerance=tolerance, max_points=MAX_POINTS)
    branch = adaptive.follow(balance, low, high, options)
    if not branch.arrived:
        raise SolveFailed(f"the frequency response {branch.end}")
    return branch


def build(file: SceneFile) -> Wheel:
    """Mesh, assemble and reduce the sector of a scene; raises SceneError for a scene without a wheel."""
    return assembled(file, modelling.part_of(file, Progress()))


def wheel_scene(file: SceneFile) -> WheelScene:
    """The scene of a wheel; raises SceneError for another one."""
    scene = file.mesh_scene
    if not has_wheel(scene):
        raise SceneError(f"{file.name} has no [wheel]: this study is for a sector of one")
    return scene


def assembled(file: SceneFile, part: Part) -> Wheel:
    """Reduce the sector of a scene with a wheel."""
    scene = wheel_scene(file)
    full = sectors.sector(scene, part)
    return Wheel(file, part, full, sectors.reduced(scene, full))


def waves_over_speeds(wheel: Wheel, highest: float, indices: Iterable[int], families: int) -> tuple[Waves, float]:
    """Waves of some harmonic indices, below 0 against the rotation, from rest to a speed [Hz].

    A free wave that rotation carries away has no frequencies, nan
    Returns them, and their relative error between the speeds at which the stress was computed"""
    part, turning = wheel.part_at(highest)
    line, error, _ = sectors.speed_line(wheel_scene(turning), part, highest, 0.0, 3, TYPICAL.line_error)
    waves: Waves = {"free": {}, "stuck": {}}
    for index in sorted({abs(index) for index in indices}):
        for state, computed in waves.items():
            try:
                both = line.wave(index, families, state == "stuck")
            except StaticDivergence:
                if state == "stuck":
                    raise

                def both(speed: float, is_opposite: bool = False) -> np.ndarray:
                    return np.full(families, np.nan)

            computed[index] = cache(both)
            computed[-index] = cache(partial(both, is_opposite=True)) if index else computed[0]
    return waves, error


def critical_speeds(wave: Wave, order: int, slow: float, fast: float, count: int = 16) -> list[tuple[int, float]]:
    """Family and speed [Hz] wherever an engine order meets a frequency of its wave between two speeds [Hz].

    count : speeds at which the wave is looked at, between which a family is met once at the most"""

    def miss(speed: float, family: int) -> float:
        return float(wave(speed)[family]) - abs(order) * speed

    return sorted(
        (family, float(brentq(miss, low, high, (family,), rtol=1e-9)))
        for low, high in pairwise(np.linspace(slow, fast, count).tolist())
        for family in np.flatnonzero((wave(low) > abs(order) * low) & (wave(high) <= abs(order) * high)).tolist()
    )


def crossings(waves: Waves, n_sectors: int, orders: Iterable[int], slow: float, fast: float) -> Crossings:
    """Modes that engine orders, above 0 with the rotation, meet in a range of speeds [Hz]."""
    index_of = {order: harmonic_index(order, n_sectors) for order in orders}
    return {
        state: [
            Crossing(order, abs(index), family, speed, abs(order) * speed)
            for order, index in index_of.items()
            for family, speed in critical_speeds(of[index], order, slow, fast)
        ]
        for state, of in waves.items()
    }


def campbell(
    wheel: Wheel, highest: float, count: int, orders: Sequence[int], families: int = 2, waves: Waves | None = None
) -> tuple[np.ndarray, dict[str, np.ndarray], Crossings]:
    """Speeds (n_speed,), frequencies (n_speed, n_order, families) of each engine order's wave, free and stuck [Hz], and
    where it meets these.

    highest : speed [Hz]; count : speeds from rest to it; waves : `waves_over_speeds` up to it, if computed already"""
    speeds, n = np.linspace(0.0, highest, count), wheel.n_sectors
    indices = [harmonic_index(order, n) for order in orders]
    waves = waves or waves_over_speeds(wheel, highest, set(indices), families)[0]
    frequencies = {
        state: np.array([[of[index](speed)[:families] for index in indices] for speed in speeds.tolist()])
        for state, of in waves.items()
    }
    return speeds, frequencies, crossings(waves, n, orders, 0.0, highest)
