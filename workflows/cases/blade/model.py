"""The bladed disk of a scene, reduced once: any engine order, any load and speed, or all of its sectors at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from tribodyn.fem.cyclic import Sector
from tribodyn.fem.part import Part
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.branch import Branch
from tribodyn.hbm.continuation import adaptive
from tribodyn.hbm.travelling_wave import on_wheel
from tribodyn.reduction.cyclic import ReducedSector, nodal_diameters, travelling_wave, wheel_model
from tribodyn.workflows.run import modelling, part_reduction
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.scene.scene_file import SceneError, SceneFile
from tribodyn.workflows.scene.schema import PartScene

MAX_POINTS = 1000  # of a response


@dataclass(frozen=True)
class Blade:
    """full, reduced : the sector of the scene's wheel before and after reduction; part : its mesh and DOFs."""

    file: SceneFile
    part: Part
    full: Sector
    reduced: ReducedSector

    @property
    def scene(self) -> PartScene:
        """The scene."""
        return self.file.part_scene

    @property
    def springs(self) -> np.ndarray:
        """(n_pair, n_component) stuck, closed contact [N/m]."""
        wave = travelling_wave(self.reduced, 0)
        return modelling.contact_stiffness(self.scene, wave)

    def diagram(self, diameters: Sequence[int], families: int, stuck: bool, full: bool = False) -> np.ndarray:
        """Frequencies (n_diameter, families) [Hz], of the reduced or of the full sector."""
        sector = self.full if full else self.reduced.sector
        return nodal_diameters(sector, diameters, families, self.springs if stuck else None)

    def wave(self, engine_order: int | None = None, frequency: tuple[float, float] | None = None) -> HarmonicBalance:
        """The balance under a wave; engine order and range of frequencies [Hz] are the scene's unless told."""
        scene = self.asked(engine_order, frequency)
        assert scene.wheel is not None
        reduced = modelling.damped(scene, travelling_wave(self.reduced, scene.wheel.engine_order))
        return modelling.make_model(scene, self.part, reduced).balance

    def asked(self, engine_order: int | None = None, frequency: tuple[float, float] | None = None) -> PartScene:
        """The scene with another engine order and range of frequencies."""
        wheel, response = self.scene.wheel, self.scene.response
        assert wheel is not None
        if engine_order is not None:
            wheel = wheel.model_copy(update={"engine_order": engine_order})
        if frequency is not None:
            response = response.model_copy(update={"frequency": frequency, "references": None})
        return self.scene.model_copy(update={"wheel": wheel, "response": response})

    def whole_wheel(self, stiffness: Sequence[float] | None = None) -> HarmonicBalance:
        """The balance of all sectors at once, outputs and loads named "<name>@<sector>".

        stiffness : (n_sectors,) factor on the stiffness of each blade: what a travelling wave of one blade cannot say
        """
        one = self.wave()
        n_sectors, wheel = self.reduced.sector.n_sectors, self.scene.wheel
        assert wheel is not None
        springs = np.tile(one.contact.stiffness, (n_sectors, 1))
        whole = wheel_model(self.reduced, stiffness)
        whole = whole.with_damping(partial(modelling.damping_matrix, self.scene, springs))
        load = on_wheel(one.excitation, wheel.engine_order, n_sectors)
        return HarmonicBalance.of(whole, one.contact.repeated(n_sectors), one.basis, load, one.omega_max)

    def at_speed(self, speed: float) -> Blade:
        """The same blade on a wheel that turns at a speed [Hz]: stiffened by its stress, softened by its frame."""
        wheel = self.scene.wheel
        assert wheel is not None
        scene = self.scene.model_copy(update={"wheel": wheel.model_copy(update={"speed": speed})})
        file = replace(self.file, scene=scene)
        return assembled(file, self.part.mesh, dict(self.part.node_sets))


def follow(balance: HarmonicBalance, frequency: tuple[float, float], tolerance: float) -> Branch:
    """The response over a range [Hz], its points as dense as the tolerance of the curve between them asks.

    Raises  SolveFailed where the curve does not come to the end of the range
    """
    low, high = (2 * np.pi * hertz for hertz in frequency)
    branch = adaptive.follow(balance, low, high, adaptive.Options(tolerance=tolerance, max_points=MAX_POINTS))
    if not branch.end.startswith("reached"):
        raise SolveFailed(f"the frequency response {branch.end}")
    return branch


def build(file: SceneFile) -> Blade:
    """Mesh, assemble and reduce the sector of a scene; raises SceneError for a scene without a wheel."""
    scene = file.part_scene
    if scene.wheel is None:
        raise SceneError(f"{file.name} has no [wheel]: this study is for a sector of one")
    with TemporaryDirectory() as folder:
        mesh, node_sets = modelling.make_mesh(file, Path(folder))
    return assembled(file, mesh, node_sets)


def assembled(file: SceneFile, mesh: Any, node_sets: dict[str, np.ndarray]) -> Blade:
    """Assemble and reduce the sector of a scene with a wheel from its mesh."""
    scene = file.part_scene
    part = modelling.make_part(scene, mesh, node_sets)
    full = part_reduction.sector(scene, part)
    return Blade(file, part, full, part_reduction.reduced_from(scene, full))
