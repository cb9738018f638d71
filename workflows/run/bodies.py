"""From the bodies of a scene to one assembly: meshes, places, materials, and what joins and holds them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.fem.assembly import Assembly, Body, Materials
from tribodyn.fem.constraints import Clamp, Constraint, named
from tribodyn.fem.couplings import DistributedCoupling, RigidCoupling, Tie
from tribodyn.fem.cyclic import rotation
from tribodyn.fem.material import AnyMaterial, Material, Orthotropic
from tribodyn.fem.springs import Mass
from tribodyn.fem.surface import surface
from tribodyn.geometry import mesh as mesh_reader
from tribodyn.geometry import parts, placing
from tribodyn.workflows.scene import structure
from tribodyn.workflows.scene.schema import Geometry
from tribodyn.workflows.scene.structure import AXES, SolidMaterial, StructureScene


def part_mesh(part: str, parameters: Mapping[str, int | float], path: Path) -> tuple[Any, dict[str, np.ndarray]]:
    """The mesh of a parametric part, which is kept at `path`."""
    kind = parts.load(part)
    kind.build(kind.Parameters(**parameters), path)
    return mesh_reader.read(path)


def geometry_mesh(geometry: Geometry, folder: Path, scratch: Path) -> tuple[Any, dict[str, np.ndarray]]:
    """The mesh of [geometry]: read from a file in `folder`, or built and kept in `scratch`."""
    if geometry.mesh is not None:
        return mesh_reader.read(folder / geometry.mesh)
    assert geometry.part_name is not None
    return part_mesh(geometry.part_name, geometry.parameters, scratch / "mesh.msh")


def assembly(scene: StructureScene, folder: Path, scratch: Path) -> Assembly:
    """All bodies of a scene in place, with the points of its couplings; files are read in `folder`, kept in `scratch`.

    Raises  ValueError, naming the body, for a mesh that cannot be read or a volume it lacks
    """
    if scene.geometry is not None:
        assert scene.material is not None
        mesh, node_sets = geometry_mesh(scene.geometry, folder, scratch)
        one = scene.material
        bodies = [Body("", mesh, node_sets, Material(one.young, one.poisson, one.density, one.expansion))]
    else:
        bodies = []
        for name, table in scene.bodies.items():
            try:
                mesh, node_sets = _placed(table, folder, scratch / f"mesh_{name}.msh")
                bodies.append(Body(name, mesh, node_sets, _material(table, scene.materials)))
            except ValueError as trouble:
                raise ValueError(f"bodies.{name}: {trouble}") from None
    whole = Assembly(bodies)
    if not scene.couplings:
        return whole
    return Assembly(bodies, {name: _middle(whole, table) for name, table in scene.couplings.items()})


def _placed(table: structure.Body, folder: Path, path: Path) -> tuple[Any, dict[str, np.ndarray]]:
    if table.mesh is not None:
        mesh, node_sets = mesh_reader.read(folder / table.mesh)
    else:
        assert table.part_name is not None
        mesh, node_sets = part_mesh(table.part_name, table.parameters, path)
    if table.volume is not None:
        mesh, node_sets = placing.taken(mesh, node_sets, table.volume)
    turn, shift = np.eye(3), np.zeros(3)
    for one in table.turns:
        R, point = rotation(one.axis, one.angle), np.array(one.point)
        turn, shift = R @ turn, R @ (shift - point) + point
    return placing.placed(mesh, table.unit, turn, shift + np.array(table.translation)), node_sets


def _material(table: structure.Body, materials: Mapping[str, SolidMaterial]) -> Materials:
    if isinstance(table.material, str):
        return solid(materials[table.material])
    return {volume: solid(materials[name]) for volume, name in table.material.items()}


def solid(table: SolidMaterial) -> AnyMaterial:
    """The material of a table of a scene."""
    if isinstance(table.young, tuple):
        assert isinstance(table.poisson, tuple)
        assert table.shear is not None
        axes = table.axes or ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        along = table.expansion if isinstance(table.expansion, tuple) else (table.expansion,) * 3
        return Orthotropic(table.young, table.poisson, table.shear, table.density, axes, along)
    assert isinstance(table.poisson, float)
    assert isinstance(table.expansion, float)
    return Material(table.young, table.poisson, table.density, table.expansion)


def _middle(whole: Assembly, table: structure.Coupling) -> list[float]:
    if table.point is not None:
        return list(table.point)
    if table.face in whole.boundaries:
        face = surface(whole, whole.boundaries[table.face], vertices_only=True)
        middle = face.area @ face.points / face.area.sum()
    else:
        middle = whole.doflocs.T[named(whole.node_sets, table.face)].mean(axis=0)
    return [float(c) for c in middle]


def clamps(scene: StructureScene) -> list[Clamp]:
    """What holds the bodies and the points of couplings."""
    found = []
    if scene.geometry is not None:
        found += [Clamp(group) for group in scene.geometry.fixed]
        found += [Clamp(*item) for item in scene.geometry.fixed_axes.items()]
    for name, body in scene.bodies.items():
        found += [Clamp(f"{name}.{group}") for group in body.fixed]
        found += [Clamp(f"{name}.{group}", axes) for group, axes in body.fixed_axes.items()]
    for name, table in scene.couplings.items():
        for point, axes in ((name, AXES[:3]), (f"{name}.turn", AXES[3:])):
            held = "".join(axis[-1] for axis in axes if axis in table.fixed)
            found += [Clamp(point, held)] if held else []
    return found


def constraints(scene: StructureScene) -> list[Constraint]:
    """Ties and couplings."""
    found: list[Constraint] = [Tie(f"ties.{name}", t.first, t.second, t.reach) for name, t in scene.ties.items()]
    for name, table in scene.couplings.items():
        kind = RigidCoupling if table.kind == "rigid" else DistributedCoupling
        found.append(kind(name, table.face))
    return found


def masses(scene: StructureScene) -> list[Mass]:
    """Lumped masses."""
    return [Mass(table.at, table.mass, table.inertia) for table in scene.masses.values()]
