"""The wheel of a scene, reduced once: any engine order, range of frequencies and speed, or all sectors at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from tribodyn.fem.cyclic_symmetry import Sector
from tribodyn.fem.modes import StaticDivergence
from tribodyn.fem.part import Part
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import adaptive
from tribodyn.hbm.linear.travelling_wave import on_wheel
from tribodyn.reduction.sector_reduction import ReducedSector, nodal_diameters
from tribodyn.reduction.wave_model import travelling_wave, wheel_model
from tribodyn.refusal import SolveFailed
from tribodyn.workflows.run import joints, modelling, sector as sectors
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneError, SceneFile
from tribodyn.workflows.scene.schema import MeshScene, has_wheel
from tribodyn.workflows.scene.wheel_scene import WheelScene
from tribodyn.workflows.scene.wheel_tables import WheelTable

MAX_POINTS = 1000  # of a response


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
        turning = self.table.model_copy(update={"speed": speed, "sweep": None})
        scene = self.scene.model_copy(update={"wheel": turning})
        part = modelling.make_part(scene, self.part.mesh, dict(self.part.node_sets), self.file.folder)
        return assembled(replace(self.file, scene=scene), part)


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


def campbell(
    wheel: Wheel, highest: float, count: int, orders: Sequence[int], families: int = 2
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Speeds (n_speed,), and frequencies (n_speed, n_order, families) of each engine order's wave, free and stuck [Hz].

    highest : speed [Hz]; count : speeds from rest to it"""
    speeds = np.linspace(0.0, highest, count)
    frequencies: dict[str, list[np.ndarray]] = {"free": [], "stuck": []}
    for speed in speeds:
        spinning = wheel.at_speed(float(speed))
        for state, rows in frequencies.items():
            rows.append(spinning.diagram(orders, families, state == "stuck"))
    return speeds, {state: np.array(rows) for state, rows in frequencies.items()}


def critical_speeds(speeds: np.ndarray, frequency: np.ndarray, order: int) -> list[float]:
    """Speeds [Hz] at which an engine order meets a frequency (n_speed,) of its wave [Hz]."""
    miss = frequency - abs(order) * speeds
    cross = np.flatnonzero((miss[:-1] > 0) != (miss[1:] > 0))
    return [float(speeds[i] + (speeds[i + 1] - speeds[i]) * miss[i] / (miss[i] - miss[i + 1])) for i in cross]
