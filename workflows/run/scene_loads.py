"""The loads of a scene and of its decks on the mesh."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from tribodyn.fem.elements import coordinates
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
