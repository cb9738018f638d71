"""From a scene to its nonlinear problem, stage by stage: mesh, part, reduced model, harmonic balance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tribodyn.fem import part as fem_part
from tribodyn.fem.constraints import NoMeanRotation
from tribodyn.fem.load_vectors import Load, NodalForce, Sum
from tribodyn.fem.part import Part, unbalanced_load
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.joint import Joint, joint_transitions
from tribodyn.hbm.continuation.harmonic_choice import ChoiceOptions, HarmonicChoice
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.expansion import SingularStuckSystem, UnbalancedLoad
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.model import ReducedModel, ReductionBasis
from tribodyn.reduction.prescribed import hold
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import (
    joints,
    matrix_model,
    memory,
    model_cache,
    part_reduction,
    response_curve,
    scene_assembly,
    scene_loads,
    settings,
)
from tribodyn.workflows.run.contact_surfaces import mapped_gap, surface_gap
from tribodyn.workflows.run.damping_matrices import damping_matrix
from tribodyn.workflows.run.preloaded_state import preloaded
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.run.sanity_checks import check_size
from tribodyn.workflows.scene.matrix_scene import MatrixScene
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import MeshScene, Scene, has_wheel

if TYPE_CHECKING:
    from tribodyn.fem.bolts import Bolt

Kind = TypeVar("Kind", bound=ReducedModel)


@dataclass(frozen=True)
class Model:
    """The nonlinear problem of a scene with what it was made from; no part where it came as matrices.

    choice : of harmonics, where the scene leaves it"""

    part: Part | None
    reduced: ReducedModel
    balance: HarmonicBalance
    choice: HarmonicChoice | None = None


def build(file: SceneFile, progress: Progress, chosen: tuple[int, ...] = ()) -> Model:
    """The nonlinear problem of a scene, stage by stage.

    chosen : harmonics of an earlier run, for a scene that leaves the choice"""
    scene = file.scene
    part = None
    if isinstance(scene, MatrixScene):
        with progress.stage("matrices"):
            reduced = damped(scene, matrix_model.make(scene, file.folder))
    else:
        part, repairs = with_surfaces(file, part_of(file, progress))
        for sentence in repairs:
            progress.say(sentence)
        with progress.stage("reduction"):
            plain = plain_of(file, part)
            reduced = part_reduction.with_prescribed(file.mesh_scene, part, damped(scene, plain))
    with progress.stage("choice of harmonics" if scene.harmonics.automatic and not chosen else "contact compliance"):
        try:
            model = make_model(scene, part, reduced, chosen, file.folder)
        except UnbalancedLoad as unbalanced:
            if part is None or reduced.is_wave or not isinstance(reduced.origin, ReductionBasis):
                raise
            force = joints.excite(scene, None).force(0, part.system.loads, len(part.free)).real
            raise Refusal(unbalanced_load(force, part, reduced.origin.basis @ unbalanced.shapes)) from None
        except SingularStuckSystem as singular:
            remarks = [] if part is None else check_size(np.ptp(part.points, axis=0), "give its numbers a unit")
            raise Refusal("; ".join([str(singular), *remarks])) from None
    if model.choice is not None:
        progress.detail(model.choice.outcome)
    return model


def part_of(file: SceneFile, progress: Progress) -> Part:
    """The part of a scene, without the gap of measured faces; made once on a machine, see kept."""

    def made() -> Part:
        with progress.stage("mesh"), TemporaryDirectory() as folder:
            mesh, node_sets = make_mesh(file, Path(folder))
            memory.check(3 * mesh.doflocs.shape[1], file.mesh_scene.reduction.solver)
        with progress.stage("mass and stiffness"):
            return make_part(file.mesh_scene, mesh, node_sets, file.folder)

    return model_cache.cached_part(file, made)


def plain_of(file: SceneFile, part: Part) -> ReducedModel:
    """The reduction of a part, not damped and with nothing prescribed; made once on a machine, see kept."""

    def made() -> ReducedModel:
        options, contact = file.mesh_scene.reduction, part.interface
        shapes = min(LIMITS.clusters, contact.n_pair) * len(contact.components)
        memory.check(part.system.n_dof, options.solver, shapes + (options.modes or 0))
        return plain_model(file.mesh_scene, part)

    return model_cache.cached_reduction(file, part, made)


def make_mesh(file: SceneFile, folder: Path) -> tuple[Any, dict[str, np.ndarray]]:
    """The mesh with its node sets: read from the scene's file, or built from the part and kept in `folder`."""
    mesh = scene_assembly.assembly(file.mesh_scene, file.folder, folder)
    return mesh, mesh.node_sets


def make_part(scene: MeshScene, mesh: Any, node_sets: dict[str, np.ndarray], folder: Path | None = None) -> Part:
    """Mass, stiffness, loads, outputs and contact of the mesh, held as the scene asks; its files are in `folder`."""
    if has_wheel(scene):
        from tribodyn.workflows.run import sector  # only wheels need it

        sector.check_faces(scene, mesh, node_sets)
    joined = scene_assembly.connections(scene, folder or Path())
    loads = scene_loads.loads_on(scene, mesh, folder or Path(), joined)
    rods = shanks(scene, mesh, node_sets)
    if rods:
        from tribodyn.workflows.run.bolt_tightening import heated  # only bolts need it

        loads = {name: heated(load, rods, mesh, node_sets) for name, load in loads.items()}
    loads |= rods
    turning = None if scene.geometry is None else scene.geometry.no_turning
    if joined.masses and scene.wheel is not None and scene.wheel.speed:
        raise Refusal(
            f"wheel.speed: there is a lumped mass at {joined.masses[0].at}, whose spin softening and Coriolis forces "
            "are not modelled: make it a body, or leave wheel.speed out"
        )
    stress_rows = dict[str, Load]()
    if scene.stress_places or scene.gauges:
        from tribodyn.workflows.run import stresses  # only scenes that ask for stress need it

        stress_rows = stresses.outputs(scene, mesh)
    return fem_part.build(
        mesh,
        node_sets,
        part_reduction.material(scene, mesh),
        joined.clamps,
        part_reduction.contacts(scene),
        loads,
        {
            name: NodalForce(output.group, output.direction)
            for name, output in {settings.OUTPUT: scene.response, **scene.response.others}.items()
        }
        | stress_rows
        | {f"{part_reduction.BOLTS}{name}": Sum(((rod, -1.0),)) for name, rod in rods.items()},
        springs=[*joined.springs, *(rod for rod in rods.values() if rod.stiffness)],
        held_motions=[] if turning is None else [NoMeanRotation(turning)],
        constraints=joined.constraints,
        masses=joined.masses,
    )


def shanks(scene: MeshScene, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> dict[str, Bolt]:
    """The shanks of the bolts of a scene, which are loads, springs and outputs."""
    if not scene.bolts:
        return {}
    from tribodyn.workflows.run import bolt_tightening  # only bolts need it

    return bolt_tightening.rods(scene, mesh, node_sets)


def with_surfaces(file: SceneFile, part: Part) -> tuple[Part, tuple[str, ...]]:
    """The part with the waviness of measured faces in its gap, and a sentence for each repair of a height map."""
    scene = file.mesh_scene
    for name, contact in scene.joints.items():
        rows = contact.opening(file.folder)
        if rows is not None:
            pairs = part.joints[name]
            gap = np.array(part.interface.gap, float)
            gap[pairs] += mapped_gap(rows, part.interface, pairs)
            part = replace(part, interface=replace(part.interface, gap=gap))
    if scene.surfaces is None:
        return part, ()
    gap, repairs = surface_gap(file, part.interface)
    return replace(part, interface=replace(part.interface, gap=part.interface.gap + gap)), repairs


def plain_model(scene: MeshScene, part: Part) -> ReducedModel:
    """The part on its contact and load nodes and a few modes, not damped, nothing prescribed; of a wheel one wave."""
    if has_wheel(scene):
        from tribodyn.workflows.run import sector  # only wheels need it

        return sector.along_speed(scene, part) if scene.wheel.along_speed else sector.at_one_speed(scene, part)
    reduced = hold(part_reduction.reduce(scene, part), part.held_rows)
    return replace(reduced, joints=dict(part.joints))


def damped(scene: Scene, reduced: Kind) -> Kind:
    """The model with the scene's damping; raises Refusal where its files hold another one."""
    if reduced.system.damping is None:
        return reduced.with_damping(partial(damping_matrix, scene, joints.contact_stiffness(scene, reduced)))
    if scene.damping.given:
        raise Refusal("the files of the model hold a damping matrix: leave [damping] out, or the matrix")
    return reduced


@dataclass(frozen=True)
class Problem:
    """What the balance of a scene is made of, whatever harmonics it keeps.

    bolts : force that each bolt is tightened by [N]"""

    scene: Scene
    part: Part | None
    reduced: ReducedModel
    joints: list[Joint]
    bolts: Mapping[str, float]

    @classmethod
    def of(cls, scene: Scene, part: Part | None, reduced: ReducedModel) -> Problem:
        """The problem of a scene, its bolts tightened."""
        joints_of_scene, bolts = joints.make_joints(scene, reduced), {}
        if isinstance(scene, MeshScene) and scene.bolts and part is not None:
            from tribodyn.workflows.run import bolt_tightening  # only bolts need it

            bolts_alone = bolt_tightening.BoltsAlone(
                reduced, joints_of_scene, scene.harmonics.samples, settings.highest_frequency(scene)
            )
            rods = shanks(scene, part.mesh, part.node_sets)
            remarks = bolt_tightening.leaning(scene, rods, part.mesh, part.node_sets)
            bolts = bolt_tightening.tightened(scene, rods, bolts_alone, remarks)
        return cls(scene, part, reduced, joints_of_scene, bolts)

    def balance(self, harmonics: tuple[int, ...], previous: HarmonicBalance | None = None) -> HarmonicBalance:
        """The balance of some harmonics, see `of`; raises Refusal where harmonic 0 is needed and left out."""
        scene, options, gap = self.scene, self.scene.harmonics, self.reduced.interface.gap
        auto = options.transitions == "auto"
        basis = HarmonicBasis(
            harmonics, options.samples, joint_transitions(self.joints) if auto else options.transitions
        )
        rounding = 1e-12  # of node positions [m]
        if not basis.has_static and np.any(np.abs(gap) > rounding):
            raise Refusal("the contact has gaps, which act in harmonic 0: keep it in harmonics.kept")
        base = None
        if isinstance(scene, MeshScene) and self.part is not None:
            base = scene_loads.ground_motion(scene, self.part, basis)
        excitation = joints.excite(scene, base)
        bolts = {(0, name): force for name, force in self.bolts.items()}
        excitation = replace(excitation, loads={**excitation.loads, **bolts})
        top = settings.highest_frequency(scene)
        bare = HarmonicBalance.of(self.reduced, self.joints, basis, excitation, top, previous=previous)
        return preloaded(scene, self.reduced, bare) if scene.preload.frictionless else bare

    def choice(self) -> HarmonicChoice | None:
        """Harmonics chosen at the resonance and where the contact wears; None without a contact or a solution there."""
        scene, harmonics = self.scene, self.scene.harmonics
        options = ChoiceOptions(highest=harmonics.top, newton=settings.newton_options(scene))
        if harmonics.tolerance is not None:
            options = replace(options, tolerance=harmonics.tolerance)
        if not self.reduced.interface.n_pair:
            return None
        duties = () if scene.wear is None else scene.wear.duties
        worn_at = [2 * np.pi * duty.at.frequency for duty in duties if duty.at.frequency is not None]
        return response_curve.choose_harmonics(
            self.balance(self.loaded_harmonics), settings.peak_of(scene), options, worn_at
        )

    @property
    def loaded_harmonics(self) -> tuple[int, ...]:
        """Those of the loads, with 0 and 1."""
        return tuple(sorted({0, 1} | {load.harmonic for load in self.scene.loads.harmonic.values()}))


def make_model(
    scene: Scene, part: Part | None, reduced: ReducedModel, chosen: tuple[int, ...] = (), folder: Path | None = None
) -> Model:
    """The harmonic balance of the scene; harmonics are those it names, else `chosen`, else chosen here.

    folder : of the files of the scene"""
    problem = Problem.of(scene, part, reduced)
    choice = problem.choice() if scene.harmonics.automatic and not chosen else None
    harmonics = scene.harmonics.kept or chosen or (choice.harmonics if choice else problem.loaded_harmonics)
    final = model_cache.cached_balance(lambda previous: problem.balance(harmonics, previous))
    if part is not None and isinstance(scene, MeshScene) and scene.stress is not None:
        from tribodyn.workflows.run import stresses  # only scenes that ask for stress need it

        final = stresses.with_stress(scene, part, final, folder or Path())
    if part is not None and isinstance(scene, MeshScene) and scene.other_speeds:
        final = replace(final, at_speed=_at_speeds(scene, part, harmonics))
    return Model(part, final.model, final, choice)


def _at_speeds(scene: MeshScene, part: Part, harmonics: tuple[int, ...]) -> dict[float, HarmonicBalance]:
    """The problem at every other speed of the wheel that the mission of the scene has."""
    balances = {}
    assert scene.wheel is not None
    for speed in scene.other_speeds:
        at_speed = scene.model_copy(update={"wheel": scene.wheel.model_copy(update={"speed": speed}), "wear": None})
        balances[speed] = make_model(at_speed, part, damped(at_speed, plain_model(at_speed, part)), harmonics).balance
    return balances
