"""From the bodies of a scene to one assembly: meshes, places, materials, and what joins and holds them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.fem.assembly import Assembly, Body, Materials
from tribodyn.fem.constraints import Clamp, Constraint, find_group
from tribodyn.fem.couplings import DistributedCoupling, Link, RigidCoupling, Tie
from tribodyn.fem.load_vectors import Load
from tribodyn.fem.material import AnyMaterial, Material, Orthotropic
from tribodyn.fem.part import StiffnessElement
from tribodyn.fem.springs import Mass, Spring
from tribodyn.fem.surface import surface
from tribodyn.geometry import mesh as mesh_reader, parts, placement, subdivision
from tribodyn.geometry.placement import overlap, rotation
from tribodyn.geometry.sources import cad, face_rules
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import decks
from tribodyn.workflows.scene import structure_tables
from tribodyn.workflows.scene.load_tables import SpringTable
from tribodyn.workflows.scene.part_tables import Meshed, SolidMaterial
from tribodyn.workflows.scene.schema import MeshScene
from tribodyn.workflows.scene.structure_tables import AXES

MeshWithNotes = tuple[Any, dict[str, np.ndarray], tuple[str, ...]]
"""A mesh, its node sets, and sentences on what was done to its file and is not used of it."""


def _read(table: Meshed, folder: Path, path: Path, sizes: cad.Sizes | None = None) -> MeshWithNotes:
    """The mesh that a table gives: of a file in `folder`, or of a part, which is kept at `path`."""
    if table.mesh is not None:
        return mesh_reader.read_with_notes(folder / table.mesh, sizes)
    assert table.part_name is not None
    part = parts.load(table.part_name)
    part.build(part.Parameters(**table.parameters), path)
    return *mesh_reader.read(path), ()


def assembly(scene: MeshScene, folder: Path, scratch: Path) -> Assembly:
    """All bodies of a scene in place, with the points of its couplings; files are read in `folder`, kept in `scratch`.

    Raises  ValueError, naming the body, for a mesh that cannot be read or a volume it lacks"""
    if scene.geometry is not None and scene.material is not None:
        mesh, node_sets, notes = _read(scene.geometry, folder, scratch / "mesh.msh")
        mesh, node_sets = subdivision.subdivide(mesh, node_sets, scene.geometry.halved)
        bodies = [Body("", mesh, node_sets, make_material(scene.material), notes)]
    else:
        bodies = []
        for name, table in scene.bodies.items():
            try:
                mesh, node_sets, notes = _placed_mesh(table, folder, scratch / f"mesh_{name}.msh")
                remarks = tuple(f"bodies.{name}: {note}" for note in notes)
                bodies.append(Body(name, mesh, node_sets, _material(table, scene.materials), remarks))
            except Refusal as trouble:
                raise Refusal(f"bodies.{name}: {trouble}") from None
        for sentence in overlaps(bodies):
            raise Refusal(f"bodies.{sentence}")
    brought = carried_decks(scene, folder)
    bodies += [body for deck in brought.values() for body in deck.bodies]
    points = {name: list(place) for deck in brought.values() for name, place in deck.points.items()}
    structure = Assembly(bodies)
    for name, coupling in scene.couplings.items():
        if name in points:
            raise Refusal(f"couplings.{name} has the name of a point of a deck: give it another")
        points[name] = _middle(structure, coupling)
    return Assembly(bodies, points) if points else structure


def overlaps(bodies: Sequence[Body]) -> Iterator[str]:
    """A sentence on each body that lies in another one."""
    overlapping: set[frozenset[str]] = set()
    for body, other in permutations(bodies, 2):
        pair = frozenset((body.name, other.name))
        if pair in overlapping or (overlap_at := overlap(body.mesh, other.mesh)) is None:
            continue
        overlapping.add(pair)
        share, (x, y, z) = overlap_at
        yield (
            f"{body.name} overlaps {other.name}: {share:.0%} of its elements lie in it, about "
            f"({x:.4g}, {y:.4g}, {z:.4g}) m: move one of them, or correct its unit"
        )


def carried_decks(scene: MeshScene, folder: Path) -> dict[str, decks.CarriedDeck]:
    """What the decks of a scene bring, by their names; raises ValueError as `decks.structure` does."""
    materials = {name: make_material(table) for name, table in scene.materials.items()} if scene.decks else {}
    return {name: decks.structure(name, table, materials, folder) for name, table in scene.decks.items()}


def _placed_mesh(table: structure_tables.BodyTable, folder: Path, path: Path) -> MeshWithNotes:
    mesh, node_sets, notes = _read(table, folder, path, _sizes(table))
    if table.volume is not None:
        mesh, node_sets = placement.extract_volume(mesh, node_sets, table.volume)
    mesh = placement.place(mesh, table.unit, np.eye(3), np.zeros(3))
    mesh, node_sets = face_rules.add_faces(mesh, node_sets, {name: face.rule for name, face in table.faces.items()})
    mesh, node_sets = subdivision.subdivide(mesh, node_sets, table.halved)
    turn, shift = np.eye(3), np.zeros(3)
    for turn_table in table.turns:
        R, point = rotation(turn_table.axis, turn_table.angle), np.array(turn_table.point)
        turn, shift = R @ turn, R @ (shift - point) + point
    return placement.place(mesh, 1.0, turn, shift + np.array(table.translation)), node_sets, notes


def _sizes(table: structure_tables.BodyTable) -> cad.Sizes | None:
    """Sizes of elements in the unit of a CAD file, of which only the body's own solid is meshed; None for others.

    Raises  ValueError where sizes are asked of a file that is a mesh already"""
    if table.mesh is None:
        return None
    if Path(table.mesh).suffix.lower() not in cad.ENDINGS:
        if table.size is not None or table.face_sizes:
            raise Refusal(f"size and face_sizes are for CAD files, '{table.mesh}' is meshed already: leave them out")
        return None
    faces = {int(name.removeprefix("face ")): size / table.unit for name, size in table.face_sizes.items()}
    return cad.Sizes(table.size and table.size / table.unit, faces=faces, solid=table.volume)


def _material(table: structure_tables.BodyTable, materials: Mapping[str, SolidMaterial]) -> Materials:
    if isinstance(table.material, str):
        return make_material(materials[table.material])
    return {volume: make_material(materials[name]) for volume, name in table.material.items()}


def make_material(table: SolidMaterial) -> AnyMaterial:
    """The material of a table of a scene."""
    if isinstance(table.young, tuple):
        assert isinstance(table.poisson, tuple)
        assert table.shear is not None
        axes = table.axes or ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        along = table.expansion if isinstance(table.expansion, tuple) else (table.expansion,) * 3
        return Orthotropic(table.young, table.poisson, table.shear, table.density, axes, along)
    assert isinstance(table.poisson, float)
    assert isinstance(table.expansion, float)
    form = table.elements if table.elements == "linear_reduced" else ""
    return Material(table.young, table.poisson, table.density, table.expansion, form)


def _middle(structure: Assembly, table: structure_tables.CouplingTable) -> list[float]:
    if table.point is not None:
        return list(table.point)
    if table.face in structure.boundaries:
        face = surface(structure, structure.boundaries[table.face], vertices_only=True)
        middle = face.area @ face.points / face.area.sum()
    else:
        middle = structure.doflocs.T[find_group(structure.node_sets, table.face)].mean(axis=0)
    return [float(c) for c in middle]


@dataclass
class Connections:
    """What holds, joins and weighs the bodies of a scene: its own, and what its decks bring, these with their loads."""

    clamps: list[Clamp] = field(default_factory=list)
    constraints: list[Constraint] = field(default_factory=list)
    springs: list[StiffnessElement] = field(default_factory=list)
    masses: list[Mass] = field(default_factory=list)
    loads: dict[str, Load] = field(default_factory=dict)


def connections(scene: MeshScene, folder: Path) -> Connections:
    """What holds and joins the bodies of a scene, whose files are in `folder`; raises Refusal as `carried_decks`."""
    result = Connections(springs=[make_spring(table) for table in scene.springs.values()])
    meshed: dict[str, Meshed] = {} if scene.geometry is None else {"": scene.geometry}
    meshed |= {f"{name}.": body for name, body in scene.bodies.items()}
    _of_structure(scene, result)
    for name, deck in carried_decks(scene, folder).items():
        result.clamps += deck.clamps
        result.constraints += deck.constraints
        result.springs += deck.springs
        result.masses += deck.masses
        result.loads[decks.load_name(name)] = deck.load
    for before, table in meshed.items():
        result.clamps += [Clamp(f"{before}{group}") for group in table.fixed]
        result.clamps += [Clamp(f"{before}{group}", axes) for group, axes in table.fixed_axes.items()]
    return result


def make_spring(table: SpringTable) -> Spring:
    """The spring of a table of a scene."""
    return Spring(table.group, table.direction, table.stiffness, table.opposite)


def _of_structure(scene: MeshScene, result: Connections) -> None:
    """Ties, couplings with what of their points is held, links and lumped masses."""
    result.constraints += [Tie(f"ties.{name}", t.first, t.second, t.reach) for name, t in scene.ties.items()]
    coupled: dict[str, RigidCoupling | DistributedCoupling] = {}
    for name, table in scene.couplings.items():
        kind = RigidCoupling if table.kind == "rigid" else DistributedCoupling
        coupled[name] = kind(name, table.face)
        for point, axes in ((name, AXES[:3]), (f"{name}.turn", AXES[3:])):
            axes_held = "".join(axis[-1] for axis in axes if axis in table.fixed)
            result.clamps += [Clamp(point, axes_held)] if axes_held else []
    result.constraints += coupled.values()
    for name, link in scene.links.items():
        free = [AXES.index(axis) for axis in link.free]
        result.constraints.append(Link(f"links.{name}", coupled[link.first], coupled[link.second], free))
    result.masses += [Mass(table.at, table.mass, table.inertia) for table in scene.masses.values()]
