"""The loads of a scene and of its decks on the mesh, and the motion that a scene gives to the ground."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.fem.elements import coordinates
from tribodyn.fem.interface import COMPONENTS
from tribodyn.fem.load_vectors import (
    BodyForce,
    Centrifugal,
    Heating,
    Load,
    Moment,
    NodalForce,
    Pressure,
    Sum,
    temperature_at,
)
from tribodyn.fem.part import Part
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import part_reduction
from tribodyn.workflows.run.scene_assembly import Connections
from tribodyn.workflows.scene.load_tables import StaticLoad
from tribodyn.workflows.scene.schema import CENTRIFUGAL, MeshScene


def loads_on(scene: MeshScene, mesh: Any, folder: Path, joined: Connections) -> dict[str, Load]:
    """The loads of a scene and of its decks by name, but for those of bolts."""
    material = part_reduction.material(scene, mesh)
    tables = {**scene.loads.static, **scene.loads.harmonic}
    loads = {name: make_load(table, mesh, material, folder) for name, table in tables.items()}
    if scene.wheel is not None and scene.wheel.speed:
        loads[CENTRIFUGAL] = Centrifugal(scene.wheel.axis)
    return loads | joined.loads


def make_load(load: StaticLoad, mesh: Any, material: Any, folder: Path) -> Load:
    """The load of a table of a scene, per unit of its amplitude; its file is in `folder`."""
    if load.pressure is not None:
        return Pressure(load.group)
    if load.direction is None:
        values = None if load.field is None else temperature_at(folder / load.field, coordinates(mesh))
        return Heating(material, load.bodies, values)
    if load.acceleration is not None or load.base_acceleration is not None:
        sign = 1.0 if load.acceleration is not None else -1.0
        return BodyForce([sign * c for c in load.direction])
    if load.speed is not None:
        return Centrifugal(load.direction, load.point)
    if load.moment is not None:
        return Moment(load.group, load.direction)
    force = NodalForce(load.group, load.direction, load.shared)
    if load.opposite is not None:  # a couple
        return Sum(((force, 1.0), (replace(force, nodes=load.opposite), -1.0)))
    return force


def ground_motion(scene: MeshScene, part: Part, basis: HarmonicBasis) -> np.ndarray | None:
    """Motion of the ground (n_pair * n_component, n_coeff) [m] along the contact components, None where it rests.

    Raises  Refusal where a face has no contact or a harmonic is not kept"""
    if not scene.motion:
        return None
    i = part.interface
    amplitudes = np.zeros((i.n_pair, len(i.components), len(basis.harmonics)), complex)
    for face, motion in scene.motion.items():
        if face not in part.pairs:
            raise Refusal(f'motion.{face}: "{face}" is no contact face, the contact has {", ".join(part.pairs)}')
        rows = i.frames[part.pairs[face]][:, [COMPONENTS.index(c) for c in i.components]]
        for h, value in ((0, motion.static), (1, motion.harmonic * np.exp(1j * motion.phase))):
            if value != 0 and h not in basis.harmonics:
                raise Refusal(f"motion.{face} moves in harmonic {h}: keep it in harmonics.kept")
            if h in basis.harmonics:
                amplitudes[part.pairs[face], :, basis.harmonics.index(h)] = value * (rows @ np.array(motion.direction))
    return basis.to_real(amplitudes).reshape(-1, basis.n_coeff)
