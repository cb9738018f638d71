"""From a scene to a result, stage by stage: mesh, part, reduced model, harmonic balance, response, wear."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from tribodyn.fem import part as fem_part
from tribodyn.fem.constraints import Clamp, NoMeanRotation
from tribodyn.fem.interface import COMPONENTS
from tribodyn.fem.loads import Centrifugal, Couple, Load, NodalForce, Pressure
from tribodyn.fem.part import Part
from tribodyn.fem.springs import Spring
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.geometry import mesh as mesh_reader
from tribodyn.geometry import parts
from tribodyn.hbm import continuation, error_controlled_rule, law, thesis_rule, wear_law
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.branch import CONVERGED, Branch
from tribodyn.hbm.contact_stiffness import rectangular_punch
from tribodyn.hbm.evolution import Duty, WearProblem
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonic_choice import HarmonicChoice
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.joint import Joint
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.operating_point import AtFrequency, AtPeak, BesidePeak
from tribodyn.hbm.wear_history import WearHistory, WearRow, history, rows_to_go_on
from tribodyn.hbm.wear_law import JointWear
from tribodyn.reduction.damping import modal_damping, rayleigh
from tribodyn.reduction.held import hold
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.accuracy.budget import with_budget
from tribodyn.workflows.result import store
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import curve, matrix_model, part_reduction, references, worn_responses
from tribodyn.workflows.run.checkpoint import Clock, Keeper
from tribodyn.workflows.run.contact_surfaces import surface_gap
from tribodyn.workflows.run.description import described
from tribodyn.workflows.run.fields import with_shown
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.matrices import MatrixScene
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import CENTRIFUGAL, HIGHEST, PartScene, Scene, StaticLoad, unknown_key
from tribodyn.workflows.scene.wear import Place, Wear

OUTPUT = "response"
NO_GAP = 1e-12  # [m], rounding of node positions
TOLERANCE = 0.01  # of the response, where a scene leaves the choice of harmonics


class SolveFailed(RuntimeError):
    """A solve did not converge; the message says where and why, and the result file holds what came before."""


@dataclass(frozen=True)
class Model:
    """The nonlinear problem of a scene with what it was made from; no part where it came as matrices.

    choice : of harmonics, where the scene leaves it
    """

    part: Part | None
    reduced: ReducedModel
    balance: HarmonicBalance
    choice: HarmonicChoice | None = None


def run(file: SceneFile, folder: Path | None, progress: Progress, earlier: Result | None = None) -> Result:
    """Compute everything that a scene asks for, and keep it in `folder`/result.h5 while it grows.

    folder : None keeps nothing on disk
    earlier : an unfinished result of the same scene to go on from
    Raises  ValueError: the scene asks for what cannot be, SolveFailed: after what was computed is kept
    """
    scene, clock = file.scene, Clock(earlier)
    check_names(scene, file.folder)
    keep = Keeper(None if folder is None else folder / "result.h5", clock)
    with threadpool_limits(scene.solver.threads), TemporaryDirectory() as scratch:
        model = build(file, folder or Path(scratch), progress, () if earlier is None else earlier.harmonics)
        result = earlier or described(file, model.part, model.balance, model.choice)
        if scene.wears and result.patch is not None:
            step_limit(scene, result.patch.free_deflection, result.patch.area)  # raises before anything long is begun
        previous = None if earlier or keep.path is None else store.set_aside(keep.path)
        if previous:
            progress.say(f"the result that was here is now {previous}")
        keep(result)
        if result.response is None:
            with progress.track("frequency response") as advance:
                frf = follow_response(scene, model.balance, advance)
            with progress.stage("linear references"):
                low, high = scene.response.references or scene.response.frequency
                linear = references.linear_references(model.balance, OUTPUT, 2 * np.pi * low, 2 * np.pi * high)
            result = keep(replace(result, response=frf, references=linear, state="response computed"))
        check_branch(result.response)
        result = keep(judged(scene, model.balance, result, progress))
        if scene.wears:
            with progress.track("wear") as advance:
                result = wear_down(file, model, result, keep, advance)
        if scene.wear is not None and scene.wear.responses and result.wear_steps:
            with progress.track("responses of the worn contact") as advance:

                def again(worn: HarmonicBalance) -> Branch:
                    return follow_response(scene, worn, lambda done, text: None)

                count = scene.wear.responses
                curves = worn_responses.curves(result, model.balance, count, again, advance)
                result = keep(replace(result, worn=curves))
        with progress.stage("error budget"):
            result = with_budget(file, model.balance, result)
        state = "complete" if result.wear is None else f"complete: {result.wear.end}"
        return keep(replace(result, state=state))


def judged(scene: Scene, balance: HarmonicBalance, result: Result, progress: Progress) -> Result:
    """The result with what the scene asks about its response curve and is not there yet."""
    frf = result.response
    assert frf is not None
    if scene.response.stability and result.stability is None:
        with progress.stage("stability"):
            result = replace(result, stability=curve.stability_of(balance, frf))
    if scene.response.bounds and result.bounds is None:
        with progress.track("bounds of residual shear") as advance:
            bounds = curve.shear_bounds(balance, frf, OUTPUT, newton_options(scene), advance)
            result = replace(result, bounds=bounds)
    return result


def build(file: SceneFile, folder: Path, progress: Progress, chosen: tuple[int, ...] = ()) -> Model:
    """The nonlinear problem of a scene, stage by stage; a mesh that is made is kept in `folder`.

    chosen : harmonics of an earlier run, for a scene that leaves the choice
    """
    scene = file.scene
    part = None
    if isinstance(scene, MatrixScene):
        with progress.stage("matrices"):
            reduced = damped(scene, matrix_model.make(scene, file.folder))
    else:
        with progress.stage("mesh"):
            mesh, node_sets = make_mesh(file, folder)
        with progress.stage("mass and stiffness"):
            part = make_part(file.part_scene, mesh, node_sets)
        part, repairs = with_surfaces(file.part_scene, part, file.folder)
        for sentence in repairs:
            progress.say(sentence)
        with progress.stage("reduction"):
            reduced = reduce_part(file.part_scene, part)
    with progress.stage("choice of harmonics" if scene.harmonics.automatic and not chosen else "contact compliance"):
        model = make_model(scene, part, reduced, chosen)
    if model.choice is not None:
        progress.say(model.choice.outcome)
    return model


def check_names(scene: Scene, folder: Path) -> None:
    """Raise ValueError where a scene names a law or a method that does not exist, before anything is built."""
    law.check_components(law.load(scene.contact.law), scene.contact.components)
    response_options(scene)
    if scene.wear is not None:
        wear_law.load(law_of(scene, folder))


def law_of(scene: Scene, folder: Path) -> str:
    """Name of the wear law of a scene that stands in `folder`, or path of its file."""
    assert scene.wear is not None
    name = scene.wear.law
    return str(folder / name) if name.endswith(".py") else name


def make_mesh(file: SceneFile, folder: Path) -> tuple[Any, dict[str, np.ndarray]]:
    """The mesh with its node sets: read from the scene's file, or built from the part and kept in `folder`."""
    geometry = file.part_scene.geometry
    if geometry.mesh is not None:
        return mesh_reader.read(file.folder / geometry.mesh)
    assert geometry.part is not None
    part, path = parts.load(geometry.part), folder / "mesh.msh"
    part.build(part.Parameters(**geometry.parameters), path)
    return mesh_reader.read(path)


def make_part(scene: PartScene, mesh: Any, node_sets: dict[str, np.ndarray]) -> Part:
    """Mass, stiffness, loads, outputs and contact of the mesh, held where the scene says."""
    loads = {name: make_load(load) for name, load in {**scene.loads.static, **scene.loads.harmonic}.items()}
    if scene.wheel is not None and scene.wheel.speed:
        loads[CENTRIFUGAL] = Centrifugal(scene.wheel.axis)
    return fem_part.build(
        mesh,
        node_sets,
        part_reduction.material(scene),
        clamps(scene),
        part_reduction.contacts(scene, alone=scene.wheel is not None),
        loads,
        {
            name: NodalForce(output.group, output.direction)
            for name, output in {OUTPUT: scene.response, **scene.response.others}.items()
        },
        springs=springs(scene),
        held=[] if scene.geometry.no_turning is None else [NoMeanRotation(scene.geometry.no_turning)],
    )


def with_surfaces(scene: PartScene, part: Part, folder: Path) -> tuple[Part, tuple[str, ...]]:
    """The part with the waviness of measured faces in its gap, and a sentence for each repair of a height map."""
    if scene.surfaces is None:
        return part, ()
    measured = surface_gap(scene.surfaces, part.interface, folder)
    return replace(part, interface=replace(part.interface, gap=part.interface.gap + measured.gap)), measured.repairs


def clamps(scene: PartScene) -> list[Clamp]:
    """What holds the part, whole groups or along some axes."""
    geometry = scene.geometry
    return [*(Clamp(group) for group in geometry.fixed), *(Clamp(*item) for item in geometry.fixed_axes.items())]


def springs(scene: PartScene) -> list[Spring]:
    """Joints that give way."""
    return [Spring(s.group, s.direction, s.stiffness, s.opposite) for s in scene.springs.values()]


def make_load(load: StaticLoad) -> Load:
    """A force at the nodes of a group, a couple of two forces, or a pressure on a face."""
    if load.direction is None:
        return Pressure(load.group)
    if load.opposite is not None:
        return Couple(load.group, load.opposite, load.direction)
    return NodalForce(load.group, load.direction)


def reduce_part(scene: PartScene, part: Part) -> ReducedModel:
    """The part on its contact and load nodes and a few modes, damped and held as the scene says."""
    reduced = damped(scene, hold(part_reduction.reduce(scene, part), part.held))
    return part_reduction.with_prescribed(scene, part, reduced)


def damped(scene: Scene, reduced: ReducedModel) -> ReducedModel:
    """The model with the scene's damping; raises ValueError where its files hold another one."""
    if reduced.system.damping is None:
        return reduced.with_damping(partial(damping_matrix, scene, contact_stiffness(scene, reduced)))
    if scene.damping.given:
        raise ValueError("the files of the model hold a damping matrix: leave [damping] out, or the matrix")
    return reduced


def damping_matrix(scene: Scene, springs: np.ndarray, system: SecondOrderSystem, B: np.ndarray) -> np.ndarray | None:
    """Damping matrix (n, n) [N s/m] of a system with its contact map and springs, None where the scene has none."""
    damping = scene.damping
    if damping.modal is not None:
        if damping.state == "stuck":
            system = replace(system, stiffness=stuck_stiffness(system.stiffness, B, springs))
        return modal_damping(system, damping.modal)
    if damping.mass is not None or damping.stiffness is not None:
        return rayleigh(system, damping.mass or 0.0, damping.stiffness or 0.0)
    return None


def contact_stiffness(scene: Scene, reduced: ReducedModel) -> np.ndarray:
    """Contact springs (n_pair, n_component) [N/m]; those of a punch in shear along t1 serve both tangents."""
    if isinstance(scene, PartScene) and scene.contact.punch is not None:
        body = (scene.material.young, scene.material.poisson)
        normal, tangential = rectangular_punch(*scene.contact.punch, *body, *body)
        return reduced.interface.stiffness(tangential, normal)
    return reduced.interface.stiffness(scene.contact.tangential_stiffness or 0.0, scene.contact.normal_stiffness or 0.0)


def make_model(scene: Scene, part: Part | None, reduced: ReducedModel, chosen: tuple[int, ...] = ()) -> Model:
    """The harmonic balance of the scene; harmonics are those it names, else `chosen`, else chosen here."""
    contact, harmonics = scene.contact, scene.harmonics
    parameters = law.ContactParameters.of(
        contact.components,
        contact_stiffness(scene, reduced),
        friction=contact.friction or 0.0,
        gap=reduced.interface.gap,
    )

    def balance(kept: tuple[int, ...]) -> HarmonicBalance:
        basis = HarmonicBasis(kept, harmonics.samples, harmonics.transitions)
        if not basis.has_static and np.any(np.abs(parameters.gap) > NO_GAP):
            raise ValueError("the contact has gaps, which act in harmonic 0: keep it in harmonics.kept")
        base = ground_motion(scene, part, basis) if isinstance(scene, PartScene) and part is not None else None
        joint = Joint("contact", contact.law, parameters)
        return HarmonicBalance.of(reduced, joint, basis, excite(scene, base), response_range(scene)[1])

    choice = None
    if harmonics.automatic and not chosen:
        first = balance(tuple(sorted({0, 1} | {load.harmonic for load in scene.loads.harmonic.values()})))
        choice = curve.choose_harmonics(
            first, peak_of(scene), harmonics.tolerance or TOLERANCE, harmonics.highest or HIGHEST, newton_options(scene)
        )
        chosen = choice.harmonics
    return Model(part, reduced, balance(harmonics.kept or chosen), choice)


def excite(scene: Scene, base: np.ndarray | None) -> Excitation:
    """The loads of the scene, F cos(h w t + phase) as amplitude F exp(i phase), and the motion of the ground."""
    loads: dict[tuple[int, str], complex] = {(0, name): load.amplitude for name, load in scene.loads.static.items()}
    if isinstance(scene, PartScene):
        loads |= {(0, name): given.displacement for name, given in scene.prescribed.items()}
        if scene.wheel is not None and scene.wheel.speed:
            loads[0, CENTRIFUGAL] = (2 * np.pi * scene.wheel.speed) ** 2
    for name, load in scene.loads.harmonic.items():
        loads[load.harmonic, name] = load.amplitude * np.exp(1j * load.phase)
    return Excitation(loads, base)


def ground_motion(scene: PartScene, part: Part, basis: HarmonicBasis) -> np.ndarray | None:
    """Motion of the ground (n_pair * n_component, n_coeff) [m] along the contact components, None where it rests.

    Raises  ValueError where a face has no contact or a harmonic is not kept
    """
    if not scene.motion:
        return None
    i = part.interface
    amplitudes = np.zeros((i.n_pair, len(i.components), len(basis.harmonics)), complex)
    for face, motion in scene.motion.items():
        if face not in part.pairs:
            raise ValueError(f'motion.{face}: "{face}" is no contact face, the contact has {", ".join(part.pairs)}')
        rows = i.frames[part.pairs[face]][:, [COMPONENTS.index(c) for c in i.components]]
        for h, value in ((0, motion.static), (1, motion.harmonic * np.exp(1j * motion.phase))):
            if value != 0 and h not in basis.harmonics:
                raise ValueError(f"motion.{face} moves in harmonic {h}: keep it in harmonics.kept")
            if h in basis.harmonics:
                amplitudes[part.pairs[face], :, basis.harmonics.index(h)] = value * (rows @ np.array(motion.direction))
    return basis.to_real(amplitudes).reshape(-1, basis.n_coeff)


def follow_response(scene: Scene, balance: HarmonicBalance, advance: Callable[[float, str], None]) -> Branch:
    """The response curve of the unworn contact by the scene's continuation method."""
    method, options = continuation.load(scene.response.method), response_options(scene)
    return method.follow(balance, *response_range(scene), options, lambda done, wanted: advance(done / wanted, ""))


def response_options(scene: Scene) -> Any:
    """Options of the scene's continuation method; raises ValueError for one that it does not have."""
    kind, given = continuation.load(scene.response.method).Options, scene.response.options
    known = {option.name: option.type for option in fields(kind) if option.name not in ("newton", "guess", "bounds")}
    for key, value in given.items():
        if key not in known:
            raise ValueError(unknown_key(f"response.options.{key}", list(known)))
        whole = known[key] in (int, "int")
        if type(value) not in ((int,) if whole else (int, float)):
            expected = "a whole number" if whole else "a number"
            raise ValueError(f"response.options.{key}: expected {expected}, got {value!r}")
    points = {"n_points": scene.response.points} if "n_points" in known else {}
    return kind(**{**points, "newton": newton_options(scene), **given})


def response_range(scene: Scene) -> tuple[float, float]:
    """Lowest and highest frequency of the response [rad/s]."""
    low, high = scene.response.frequency
    return 2 * np.pi * low, 2 * np.pi * high


def newton_options(scene: Scene) -> NewtonOptions:
    """How exactly every balance is solved."""
    return NewtonOptions(tolerance=scene.solver.tolerance, krylov=scene.solver.krylov)


def check_branch(branch: Branch | None) -> None:
    """Raise SolveFailed where a response curve did not come to its end."""
    if branch is not None and (branch.outcome[-1] != CONVERGED or branch.end.startswith("ended at")):
        raise SolveFailed(f"the frequency response {branch.end}")


def wear_down(
    file: SceneFile, model: Model, result: Result, keep: Keeper, advance: Callable[[float, str], None]
) -> Result:
    """Wear until contact is lost; every step is kept as soon as it is done."""
    scene = file.scene
    assert scene.wear is not None
    assert result.patch is not None
    patch, wear = result.patch, scene.wear
    rows = rows_to_go_on(result.wear)
    to_wear = float(patch.area @ patch.free_deflection)

    def on_row(row: WearRow) -> None:
        rows.append(row)
        keep(replace(result, wear=history(rows, "unfinished"), state=f"unfinished: {len(rows)} wear steps are done"))
        done = float(patch.area @ (row.depth + row.worn)) / to_wear if to_wear > 0 else 0.0
        advance(done, f"step {len(rows)}, {row.cycles + row.cycles_in_step:.3g} cycles, {row.preload:.4g} N")

    problem = wear_problem(scene, file.folder, model.balance, wear.lost_below, wear.end_at == "at_rest")
    limit = step_limit(scene, patch.free_deflection, patch.area)
    worn = evolve(problem, wear, limit, wear.max_steps, on_row, result.wear)
    result = with_shown(scene, replace(result, wear=worn), model.balance.with_load(problem.mission[0].load), model.part)
    if worn.end.startswith("solve failed"):
        keep(replace(result, state=worn.end))
        raise SolveFailed(f"wear step {len(worn.cycles)}: {worn.end}")
    return result


def wear_problem(
    scene: Scene, folder: Path, balance: HarmonicBalance, lost_below: float = 0.0, at_rest: bool = False
) -> WearProblem:
    """What a scene wears, by its law and mission; folder : of the scene.

    lost_below : share of the first preload at which the run ends, of that at rest where `at_rest`
    """
    assert scene.wear is not None
    law, area = law_of(scene, folder), balance.model.interface.area
    vibrating, resting = (0.0, lost_below) if at_rest else (lost_below, None)
    return WearProblem(balance, mission(scene), JointWear(law, scene.wear.coefficient), area, vibrating, resting)


def evolve(
    problem: WearProblem,
    wear: Wear,
    limit: float,
    max_steps: int,
    on_row: Callable[[WearRow], None] | None = None,
    resume: WearHistory | None = None,
) -> WearHistory:
    """Wear by the rule that a scene asks for; limit : of `step_limit` [m], the rest as for hbm.thesis_rule."""
    if wear.rule == "thesis":
        return thesis_rule.evolve(problem, limit, max_steps, on_row, resume)
    tolerance = error_controlled_rule.Tolerance(wear.tolerance, limit)
    return error_controlled_rule.evolve(problem, tolerance, max_steps, on_row, resume)


def peak_of(scene: Scene) -> AtPeak:
    """The resonance peak within the range of the response."""
    return AtPeak(OUTPUT, *response_range(scene), scene.response.points, newton=newton_options(scene))


def mission(scene: Scene) -> tuple[Duty, ...]:
    """Where the cycles that wear are taken: the scene's one place, or the duties of its mission."""
    assert scene.wear is not None
    if not scene.wear.mission:
        return (Duty(site_of(scene, scene.wear.at)),)
    return tuple(Duty(site_of(scene, duty.at), duty.share, duty.load) for duty in scene.wear.mission)


def site_of(scene: Scene, place: Place) -> AtFrequency | AtPeak | BesidePeak:
    """A place of the scene's response."""
    if place.frequency is not None:
        return AtFrequency(OUTPUT, 2 * np.pi * place.frequency, newton_options(scene))
    assert place.peak is not None
    return peak_of(scene) if place.peak == 1.0 else BesidePeak(peak_of(scene), place.peak)


def step_limit(scene: Scene, approach: np.ndarray, area: np.ndarray) -> float:
    """Largest depth of one wear step by the thesis's rule, or delta_max that the other rule measures errors by [m].

    approach : (n_pair,) by which the static loads press the faces into each other without contact [m]; area : [m2]
    Raises  ValueError where delta_max is needed and the scene has none
    """
    assert scene.wear is not None
    step = scene.wear.step
    if scene.wear.rule == "thesis" and step is not None and step.depth is not None:
        return step.depth
    delta_max = references.delta_max(scene, approach, area)
    if not (np.isfinite(delta_max) and delta_max > 0):
        raise ValueError(
            "wear.step: a share of delta_max needs static loads that press the contact of a part held without it; "
            'give a depth such as "50 um" and rule = "thesis"'
        )
    share = step.share if scene.wear.rule == "thesis" and step is not None else None
    return delta_max if share is None else share * delta_max
