"""Stress in a run: outputs at the places and gauges of a scene, what the material endures there, and whole fields."""

from collections.abc import Mapping
from dataclasses import dataclass, fields as fields_of, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from tribodyn.fem.assembly import Assembly, materials_of
from tribodyn.fem.load_vectors import Heating, Load
from tribodyn.fem.part import Part
from tribodyn.fem.singularities import KINDS, singular_nodes
from tribodyn.fem.stress import (
    COLUMNS,
    COMPONENTS,
    ROWS,
    NodalStress,
    PartPoint,
    locate,
    nodal_stress,
    solids,
    strain_row,
    stress_rows,
)
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation.branch import GAUGE, STRESS
from tribodyn.hbm.fatigue import (
    Strength,
    StressField,
    StressOverCycle,
    StressPlace,
    face_indicators,
    haigh_point,
    over_cycle,
    utilisation,
    von_mises,
)
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.recovery import full_displacement
from tribodyn.reduction.omitted_modes import OmittedModes
from tribodyn.refusal import Refusal
from tribodyn.workflows.result.result import Fields, Stress
from tribodyn.workflows.run import part_reduction
from tribodyn.workflows.run.scene_loads import make_load
from tribodyn.workflows.scene.fields import unknown_key
from tribodyn.workflows.scene.schema import MeshScene
from tribodyn.workflows.scene.stress_tables import FatigueTable

SINGLE = "material"  # name of the material of a scene with [geometry]


@dataclass(frozen=True)
class ObservedRow:
    """An output that is given as a row (3 n_node,) over all displacements."""

    values: np.ndarray

    def vector(self, *_: Any) -> np.ndarray:
        return self.values


def outputs(scene: MeshScene, mesh: Any) -> dict[str, Load]:
    """The six components of stress at every place, and the strain of every gauge, by the names of their outputs."""
    rows, material = dict[str, Load](), part_reduction.material(scene, mesh)
    for name in scene.stress_places:
        at_place, _ = stress_rows(mesh, material, _place(scene, mesh, name))
        rows |= {f"{STRESS}{name}.{c}": ObservedRow(row) for c, row in zip(COMPONENTS, at_place, strict=True)}
    for name, gauge in scene.gauges.items():
        rows[f"{GAUGE}{name}"] = ObservedRow(
            strain_row(mesh, f"gauges.{name}", gauge.point, gauge.direction, gauge.length)
        )
    return rows


def with_stress(scene: MeshScene, part: Part, balance: HarmonicBalance, folder: Path) -> HarmonicBalance:
    """The balance with the places of the scene and the stress of the whole part, which its numbers are computed from.

    folder : of the files of the scene"""
    material, names = part_reduction.material(scene, part.mesh), balance.compliance.output_names
    known = material_names(scene, part.mesh, material)
    for key in scene.fatigue:
        if scene.decks and not any(key in solid for solid in known):
            raise Refusal(unknown_key(f"fatigue.{key}", [f"fatigue.{name}" for solid in known for name in solid]))
    strengths = [
        next((strength_of(scene.fatigue[name]) for name in solid if name in scene.fatigue), None) for solid in known
    ]
    heat, every = temperature(scene, part, folder), list(solids(part.mesh, material))
    places = []
    for name in scene.stress_places:
        place = _place(scene, part.mesh, name)
        held_back = (0.0,) * 6
        if heat is not None:
            held_back = tuple(stress_rows(part.mesh, material, place, heat)[1].tolist())
        first = names.index(f"{STRESS}{name}.{COMPONENTS[0]}")
        at = (piece.node == place.piece.node and place.element in elements for piece, _, _, elements in every)
        strength = strengths[[*at].index(True)]
        change = None if heat is None else heat[place.nodes] @ place.weights
        left = 1.0 if strength is None else float(strength.share(change))
        places.append(StressPlace(name, first, held_back, strength, left))
    nodes = {name: _place(scene, part.mesh, name).nearest for name in scene.stress_places}
    omitted = None if len(part.held_rows) else OmittedModes.of(balance.model, part.system)
    is_searched = scene.stress is None or scene.stress.hot_spots > 0
    stress = PartStress(part, material, heat, tuple(strengths), nodes, omitted, is_searched)
    return replace(balance, places=tuple(places), stress=stress)


@dataclass(frozen=True)
class PartStress:
    """Computes the stress of a whole part in solved states.

    material : as for fem.elasticity.assemble; temperature : (n_node,) change [K] under the static loads, None for none
    strengths : of the materials of all bodies, body by body, None where the scene does not say
    nodes : nearest to the named places; omitted : what the modes left out carry, None where that is not known
    is_searched : whether the largest of the part is asked for"""

    part: Part
    material: Any
    temperature: np.ndarray | None
    strengths: tuple[Strength | None, ...]
    nodes: Mapping[str, int]
    omitted: OmittedModes | None = None
    is_searched: bool = True

    @cached_property
    def kinds(self) -> np.ndarray:
        """What stands at every node, as numbers of fem.singularities.KINDS."""
        return singular_nodes(self.part)

    @cached_property
    def nodes_of_pairs(self) -> csr_matrix:
        """(n_pair, n_node) 1 for the nodes of both faces near a pair; those in the next sector are left out."""
        part, pairs, n_node = self.part, self.part.interface, len(self.part.points)
        moves = csr_matrix(
            (np.ones(len(part.free)), (part.free, np.arange(len(part.free)))), (3 * n_node, len(part.free))
        )
        row, dof = (abs(csr_matrix(pairs.B)) @ abs(moves if part.dependence is None else part.dependence).T).nonzero()
        pair = np.append(row // len(pairs.components), np.arange(pairs.n_pair))
        node = np.append(dof // 3, part.nodes)  # for pairs on a clamp
        distance = np.linalg.norm(part.points[node] - pairs.points[pair], axis=1)
        is_near = distance < 0.05 * np.linalg.norm(np.ptp(part.points, axis=0))
        return csr_matrix((is_near.astype(float), (pair, node)), (pairs.n_pair, n_node)).sign()

    def indicators_of_pairs(self, field: NodalStress, basis: HarmonicBasis) -> tuple[np.ndarray, ...]:
        """Tension, number of Smith, Watson and Topper, and node of each pair (n_pair,), as in StressOverCycle."""
        values, of_node = np.zeros((2, len(self.part.points))), self.nodes_of_pairs.tocsc()
        for number, (_, _, kind, _) in enumerate(solids(self.part.mesh, self.material)):
            rows = np.flatnonzero((field.material == number) & (np.diff(of_node.indptr) > 0)[field.node])
            for at in np.array_split(rows, 1 + len(rows) // 256):
                node = field.node[at]
                frame = self.part.interface.frames[of_node.indices[of_node.indptr[node]]]
                stiffness = kind.tensor(self.part.points[node])[:, ROWS, COLUMNS][:, :, ROWS, COLUMNS]
                numbers = face_indicators(field.tensor[at], frame, np.linalg.inv(stiffness), basis)
                values[:, node] = np.maximum(values[:, node], numbers)
        at_pairs = [csr_matrix(self.nodes_of_pairs.multiply(value)) for value in values]
        return *(each.max(axis=1).toarray().ravel() for each in at_pairs), at_pairs[0].argmax(axis=1).A1

    def singularity(self, where: int | str) -> str:
        """Point of a node or a named place, and what makes the exact stress infinite there; "" where nothing does."""
        node = self.nodes[where] if isinstance(where, str) else where
        x, y, z = 1e3 * self.part.points[node]
        kind = KINDS[self.kinds[node]]
        return f"({x:.4g}, {y:.4g}, {z:.4g}) mm is at {kind}" if kind else ""

    def of_state(self, balance: HarmonicBalance, state: State) -> StressOverCycle:
        """The stress of a solved state."""
        force = state.cycle.force.reshape(state.flat.shape)
        displacement = full_displacement(balance, state.flat, force, state.omega)
        return self.over_cycle(self.part.field(displacement), balance.basis)

    def over_cycle(self, u: np.ndarray, basis: HarmonicBasis) -> StressOverCycle:
        """The stress of a vibration; u : (n_node, 3, n_coeff) displacement [m]."""
        heat = self.temperature if basis.has_static else None
        field = nodal_stress(self.part.mesh, self.material, u, heat)
        n_node = len(self.part.points)
        stress, tensor = np.zeros(n_node), np.zeros((n_node, 2, 6))
        for at in np.array_split(np.arange(len(field.node)), 1 + len(field.node) // 4096):  # memory only
            node, series = field.node[at], over_cycle(field.tensor[at], basis, samples=64)
            course = von_mises(series)
            highest, instant = course.max(axis=1), course.argmax(axis=1)
            np.maximum.at(stress, node, highest)
            shown = np.flatnonzero(highest == stress[node])  # of two materials the one with more stress
            tensor[node[shown]] = np.stack([series.mean(axis=1), series[np.arange(len(at)), instant]], axis=1)[shown]
        use, mean, amplitude = np.full((3, n_node), np.nan)
        for number, strength in enumerate(self.strengths):
            rows = np.flatnonzero(field.material == number)
            if strength is None or not len(rows):
                continue
            for at in np.array_split(rows, 1 + len(rows) // 1024):
                node = field.node[at]
                left = strength.share(None if heat is None else heat[node])[..., None, None]
                point = haigh_point(field.tensor[at] / left, basis, samples=64)  # as far from the limits of no heat
                of_rows = utilisation(field.tensor[at] / left, basis, strength, 64, point)
                shown = np.flatnonzero(~(of_rows <= use[node]))
                use[node[shown]], mean[node[shown]], amplitude[node[shown]] = of_rows[shown], *(x[shown] for x in point)
        return StressOverCycle(stress, use, mean, amplitude, tensor, *self.indicators_of_pairs(field, basis))


def _place(scene: MeshScene, mesh: Any, name: str) -> PartPoint:
    table = scene.stress_places[name]
    return locate(mesh, table.point, f"stress.places.{name}", table.body)


def material_names(scene: MeshScene, mesh: Any, material: Any) -> list[tuple[str, ...]]:
    """Names by which [fatigue] may know each material of all bodies, body by body: its own, then that of the body."""
    names: list[tuple[str, ...]] = []
    for position, (_, of_piece) in enumerate(materials_of(mesh, material)):
        body = mesh.bodies[position].name if isinstance(mesh, Assembly) else ""
        if body not in scene.bodies:
            names += [(body or SINGLE,)] * (len(of_piece) if isinstance(of_piece, Mapping) else 1)
        else:
            material = scene.bodies[body].material
            names += [(name, body) for name in ([material] if isinstance(material, str) else material.values())]
    return names


def strength_of(table: FatigueTable) -> Strength:
    """The strength of a table, surface and size in its endurance limits."""
    values, limits = table.model_dump(), ("endurance_limit", "torsion_limit")
    factor = values.pop("surface_factor") * values.pop("size_factor")
    return Strength(**values | {name: factor * values[name] for name in limits if values[name] is not None})


def temperature(scene: MeshScene, part: Part, folder: Path) -> np.ndarray | None:
    """Change of temperature (n_node,) [K] by the static loads of the scene; None where no load heats."""
    loads = [(load.amplitude, make_load(load, part.mesh, None, folder)) for load in scene.loads.static.values()]
    changes = [value * load.temperature(part.mesh) for value, load in loads if isinstance(load, Heating)]
    return np.sum(changes, axis=0) if changes else None


def stress_state(stress: StressField, points: np.ndarray, fields: Fields, basis: HarmonicBasis, spots: int) -> Stress:
    """The stress of the part in the states of some fields of displacement, and its hot spots.

    points : (n_node, 3) [m]; spots : how many hot spots, by utilisation where it is known, else by stress; each is the
        highest that is farther than a tenth of the size of the part from those before it"""
    states = [stress.over_cycle(u, basis) for u in fields.displacement]
    reach = 0.1 * float(np.linalg.norm(np.ptp(points, axis=0)))
    nodes = []
    for state in states:
        height = np.array(state.utilisation if np.isfinite(state.utilisation).any() else state.largest)
        chosen: list[int] = []
        for _ in range(spots):
            chosen.append(int(np.nanargmax(height)))
            height[np.linalg.norm(points - points[chosen[-1]], axis=1) < reach] = -1.0
        nodes.append(chosen)
    spot = np.array(nodes, int).reshape(len(states), spots)
    numbers = {
        item.name: np.stack([getattr(state, item.name) for state in states]) for item in fields_of(StressOverCycle)
    }
    return Stress(row=fields.row, **numbers, spot=spot, spot_point=points[spot], spot_kind=stress.kinds[spot])
