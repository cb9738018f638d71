"""What a scene will model and what it will cost, from its mesh alone: nothing is assembled, factorised or solved.

The costs are rules of thumb, good to a factor of about three: they distinguish seconds from hours."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from math import prod
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import numpy as np

from tribodyn.fem.constraints import find_group, free_dofs
from tribodyn.fem.couplings import Tie
from tribodyn.geometry import parts
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.wear import wear_rule
from tribodyn.hbm.wear.wear_rule import StepCost
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.relative import body_1_dofs
from tribodyn.workflows.run import matrix_model, memory as memory_use, scene_assembly
from tribodyn.workflows.run.modelling import make_mesh
from tribodyn.workflows.run.part_reduction import components, contacts, without_masters
from tribodyn.workflows.run.sanity_checks import check_opening
from tribodyn.workflows.run.settings import check_names
from tribodyn.workflows.scene.matrix_scene import MatrixScene
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import MeshScene, Scene
from tribodyn.workflows.scene.user_files import is_user_file


@dataclass(frozen=True)
class Costs:
    """Rules of thumb, measured on one thread: on the beam scene, and on clamped cubes for the factorisation.

    factor : seconds of a factorisation of N DOFs over N^1.5; back : of a back substitution, for each DOF
    dense : seconds for each cubed coordinate of the reduced model, all eigenvalue problems together
    solve : seconds of a balance solve for each squared contact coordinate and harmonic coefficient
    sparse : the same with residual flexibility, for each DOF and harmonic coefficient
    largest : product of two numbers of elements of a part up to which its mesh is made, in some ten seconds
    harmonics : where a scene leaves the choice"""

    factor: float = 2e-7
    back: float = 1.5e-7
    dense: float = 3e-9
    solve: float = 6e-8
    sparse: float = 1.7e-6
    largest: float = 2e4
    harmonics: tuple[int, ...] = tuple(range(8))


COSTS = Costs()


@dataclass(frozen=True)
class ModelSizes:
    """Numbers of elements, nodes, free DOFs, contact pairs and masters of a scene.

    remarks : on faces that are glued or rub and lie apart"""

    elements: int
    nodes: int
    full_dofs: int
    contact_pairs: int
    masters: int
    remarks: tuple[str, ...] = field(default=(), kw_only=True)


@dataclass(frozen=True)
class Plan(ModelSizes):
    """Sizes, memory [bytes] and time [s] of a scene; wear_steps is None where it is not known, 0 without wear."""

    model_dofs: str
    unknowns: int
    memory: float
    reduction_seconds: float
    response_solves: int
    wear_steps: int | None
    wear_solves: int
    solve_seconds: float
    verdict: bool

    def lines(self) -> list[tuple[str, str]]:
        """The plan as pairs of a name and a readable value."""
        steps = "as many as it takes" if self.wear_steps is None else f"about {self.wear_steps}"
        response, wear = (_time(count * self.solve_seconds) for count in (self.response_solves, self.wear_solves))
        text_of_plan = _time(self.reduction_seconds + (self.response_solves + self.wear_solves) * self.solve_seconds)
        return [
            ("mesh", f"{self.elements} elements, {self.nodes} nodes" if self.elements else "none: matrices"),
            ("full model", f"{self.full_dofs} DOFs"),
            ("contact", f"{self.contact_pairs} node pairs"),
            ("reduced model", f"{self.model_dofs} DOFs without static shapes"),
            ("unknowns", f"{self.unknowns} in each balance solve"),
            ("memory", f"about {self.memory / 1e9:.1g} GB"),
            ("reduction", f"about {_time(self.reduction_seconds)}"),
            ("response", f"{self.response_solves} solves, about {response}"),
            ("wear", f"{steps} steps, about {wear}" if self.wear_solves else "none"),
            ("errors", "measured on a finer model after the run" if self.verdict else "not measured"),
            ("whole run", f"about {text_of_plan} on one core, to a factor of three, without errors"),
            *(("warning", remark) for remark in self.remarks),
        ]


def plan(file: SceneFile) -> Plan:
    """Plan a scene; raises ValueError for what the run would refuse after reading the mesh."""
    scene = file.scene
    check_names(scene, own_files=False)
    groups, sparse = 0, False
    if isinstance(scene, MatrixScene):
        reduced = matrix_model.make(scene, file.folder)
        sizes = ModelSizes(0, 0, reduced.n_full, reduced.interface.n_pair, reduced.system.n_dof)
        modes: int | None = 0
    else:
        built = file.mesh_scene
        largest = _largest_counts(file)
        sizes = _extrapolated(file, largest) if largest > COSTS.largest else _measured(file)
        groups = int(built.geometry is not None and built.geometry.no_turning is not None)
        modes, cutoff = built.reduction.modes, built.reduction.cutoff
        sparse = without_masters(built, sizes.contact_pairs * len(components(scene)), groups > 0)
        if sparse:
            sizes = replace(sizes, masters=LIMITS.clusters * len(components(scene)) + 5)
    full, pairs, masters = sizes.full_dofs, sizes.contact_pairs, sizes.masters
    basis = HarmonicBasis(scene.harmonics.kept or COSTS.harmonics, scene.harmonics.samples)
    n_component = len(components(scene))
    contact = pairs * n_component
    model = masters + (modes if modes is not None else 50) - groups
    memory = (
        200e6  # the program itself
        + memory_use.FACTOR * full
        + 3 * 8.0 * full * model
        + 10 * 8.0 * model**2
        + (0.0 if sparse else 8 * 8.0 * contact**2)
        + 4 * 8.0 * pairs * (n_component * basis.n_coeff) ** 2
    )
    reduction = COSTS.factor * full**1.5 + COSTS.back * full * model + 4 * COSTS.dense * model**3
    steps, solves = _wear(scene)
    return Plan(
        **vars(sizes),
        model_dofs=str(model) if modes is not None else f"{masters} and the modes up to {cutoff:g} Hz",
        unknowns=contact * basis.n_coeff,
        memory=memory,
        reduction_seconds=1.0 + reduction,
        response_solves=scene.response.points,
        wear_steps=steps,
        wear_solves=solves,
        solve_seconds=5e-3 + basis.n_coeff * (COSTS.sparse * full if sparse else COSTS.solve * contact**2),
        verdict=scene.verdict.enabled,
    )


def _measured(file: SceneFile) -> ModelSizes:
    """Sizes of a scene by its mesh."""
    scene = file.mesh_scene
    with tempfile.TemporaryDirectory() as folder:
        mesh, node_sets = make_mesh(file, Path(folder))
    joined = scene_assembly.connections(scene, file.folder)
    remarks = _openings(scene, mesh, node_sets, joined)
    free = free_dofs(3 * mesh.doflocs.shape[1], joined.clamps, node_sets)
    pairs, masters = _contact(scene, mesh, node_sets, free)
    return ModelSizes(int(mesh.nelements), mesh.doflocs.shape[1], len(free), pairs, masters, remarks=tuple(remarks))


def _parts(file: SceneFile) -> Iterator[tuple[str, ModuleType, Any]]:
    """Key of the table, part and its parameters, of every body that is made from a part."""
    scene = file.mesh_scene
    tables = {f"bodies.{name}": table for name, table in scene.bodies.items()}
    for key, table in (tables if scene.geometry is None else {"geometry": scene.geometry}).items():
        if table.part_name is not None:
            part = parts.load(table.part_name)
            yield key, part, part.Parameters(**table.parameters)


def _largest_counts(file: SceneFile) -> float:
    """Largest product of two numbers of elements or nodes that a part takes, about that of columns of its mesh."""
    products = [prod(sorted(getattr(of, n) for n in getattr(part, "MESH", ()))[-2:]) for _, part, of in _parts(file)]
    return float(max(products, default=0))


def _extrapolated(file: SceneFile, largest: float) -> ModelSizes:
    """Sizes of a scene whose mesh is too large to be made for a plan, by a power law through those of two coarser ones.

    largest : see `_largest_counts`"""
    ratios = np.sqrt(COSTS.largest / largest) / np.array([2.0, 4.0])
    coarse = []
    for ratio in ratios:
        texts = [
            f"{key}.{name}={count}"
            for key, part, of in _parts(file)
            for name, count in parts.rescaled(part, of, ratio).items()
            if getattr(of, name) > 2 / ratio  # small counts, such as those through a thickness, stay
        ]
        sizes = _measured(file.changed(*texts))
        coarse.append([getattr(sizes, item.name) for item in fields(ModelSizes)[:-1]])
    first, second = np.maximum(np.array(coarse, float), 1.0)
    power = np.log(first / second) / np.log(ratios[0] / ratios[1])
    remark = "the mesh is too large to be made for a plan: its sizes are extrapolated from two coarser ones"
    elements, nodes, full, pairs, masters = np.rint(first * ratios[0] ** -power).astype(int).tolist()
    return ModelSizes(elements, nodes, full, pairs, masters, remarks=(remark,))


def _openings(
    scene: MeshScene, mesh: Any, node_sets: dict[str, np.ndarray], joined: scene_assembly.Connections
) -> list[str]:
    """Remarks on tied faces, and on those in contact whose gap is that of the geometry, that lie apart.

    Raises  ValueError for constraints that the run refuses"""
    pairs = [
        Tie(f"contacts.{name}", face, contact.opposite, contact.reach)
        for name, contact in scene.joints.items()
        for face in contact.groups
        if contact.opposite is not None and contact.gap is None and (scene.wheel is None or not contact.meets_next)
    ]
    for constraint in joined.constraints:
        constraint.build(mesh, node_sets)
        if isinstance(constraint, Tie):
            pairs.append(constraint)
    remarks = []
    for pair in pairs:
        first, _, shared = pair.meeting(mesh)
        remarks += check_opening(pair.label, shared.gap, first.length)
    return remarks


def _contact(scene: MeshScene, mesh: Any, node_sets: dict[str, np.ndarray], free: np.ndarray) -> tuple[int, int]:
    """Number of contact pairs, and of master DOFs that contacts, point loads and outputs make."""
    loads = [*scene.loads.static.values(), *scene.loads.harmonic.values()]
    points = [
        (group, load.direction)
        for load in loads
        for group in (load.group, load.opposite)
        if load.direction is not None and group
    ]
    points += [(output.group, output.direction) for output in (scene.response, *scene.response.others.values())]
    pairs, masters = 0, []
    for contact in contacts(scene):
        interface, *second = [contact.build(mesh)] if contact.turn is None else contact.halves(mesh)
        pairs += interface.n_pair
        if scene.reduction.relative:
            masters.append(body_1_dofs(interface).ravel())
        else:
            masters += [np.unique(half.indices) for half in (interface.B, *second)]
    masters += [find_group(node_sets, table.group) * 3 + "xyz".index(table.axis) for table in scene.prescribed.values()]
    touched = [(find_group(node_sets, group)[:, None] * 3 + np.flatnonzero(axis)).ravel() for group, axis in points]
    masters += [dofs for dofs in touched if len(dofs) <= LIMITS.point_load]
    return pairs, len(np.intersect1d(np.concatenate([*masters, []]).astype(int), free))


def _wear(scene: Scene) -> tuple[int | None, int]:
    """Wear steps and balance solves to expect."""
    if scene.wear is None or scene.wear.max_steps == 0:
        return 0, 0
    step_limit, cost = scene.wear.max_steps, None
    if not is_user_file(scene.wear.rule):  # a file beside the scene, which a plan does not run, states nothing
        cost = cast("StepCost | None", wear_rule.load(scene.wear.rule_name).Rule.COST)
    share = scene.wear.accuracy_share
    likely = step_limit if share is None or cost is None else round(cost.steps * (share / cost.accuracy) ** cost.power)
    steps = min(step_limit, likely)
    solves = 0
    for place in (duty.at for duty in scene.wear.duties):
        solves += steps if place.peak is None else steps * (cost.at_peak if cost else 1) + scene.response.points
    return (None if share is None else steps), solves


def _time(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.2g} s"
    return f"{seconds / 60:.2g} min" if seconds < 6000 else f"{seconds / 3600:.2g} h"
