"""From a scene to a result, stage by stage: mesh, part, reduced model, harmonic balance, response, wear."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from threadpoolctl import threadpool_limits

import fem.part
from fem.constraints import Clamp
from fem.loads import NodalForce
from fem.material import Material
from fem.part import Part
from geometry import mesh as mesh_reader
from geometry import parts
from geometry.numbering import REFERENCE_POINTS, permutation
from hbm import continuation, error_controlled_rule, law, thesis_rule, wear_law
from hbm.balance import HarmonicBalance
from hbm.branch import CONVERGED, Branch
from hbm.evolution import Duty, WearProblem
from hbm.excitation import Excitation
from hbm.harmonics import HarmonicBasis
from hbm.newton import NewtonOptions
from hbm.operating_point import AtFrequency, AtPeak
from hbm.wear_history import WearRow, history
from reduction.craig_bampton import craig_bampton
from reduction.damping import modal_damping, rayleigh
from reduction.model import ReducedModel
from workflows import store
from workflows.fields import displacement_fields, hysteresis_loops
from workflows.progress import Progress
from workflows.references import free_deflection, linear_references
from workflows.result import PartMesh, Patch, Result
from workflows.scene import Damping, HarmonicLoad, Scene, StaticLoad
from workflows.scene_file import SceneFile

OUTPUT = "response"
VTK_KIND = {27: ("hexahedron27", "triquadratic_hexahedron"), 10: ("tetra10", "quadratic_tetra")}
PACKAGES = ("tribodyn", "numpy", "scipy", "numba", "scikit-fem", "gmsh", "meshio", "h5py", "pydantic")
SEED = 0  # of every random start vector and probe in the packages used


class SolveFailed(RuntimeError):
    """A solve did not converge; the message says where and why, and the result file holds what came before."""


@dataclass(frozen=True)
class Model:
    """The nonlinear problem of a scene with what it was made from."""

    part: Part
    reduced: ReducedModel
    balance: HarmonicBalance


def run(file: SceneFile, folder: Path, progress: Progress, earlier: Result | None = None) -> Result:
    """Compute everything that a scene asks for, and keep it in `folder`/result.h5 while it grows.

    earlier : an unfinished result of the same scene to go on from
    Raises  ValueError: the scene asks for what cannot be, SolveFailed: after what was computed is kept
    """
    scene, clock = file.scene, Clock(earlier)
    check_names(scene)
    keep = Keeper(folder / "result.h5", clock)
    with threadpool_limits(scene.solver.threads):
        with progress.stage("mesh"):
            mesh, node_sets = make_mesh(file, folder)
        with progress.stage("mass and stiffness"):
            part = make_part(scene, mesh, node_sets)
        with progress.stage("reduction"):
            reduced = reduce_part(scene, part)
        with progress.stage("contact compliance"):
            model = make_model(scene, part, reduced)
        result = earlier or described(file, model)
        previous = None if earlier else store.set_aside(keep.path)
        if previous:
            progress.say(f"the result that was here is now {previous}")
        keep(result)
        if result.frf is None:
            with progress.track("frequency response") as advance:
                frf = follow_response(scene, model.balance, advance)
            with progress.stage("linear references"):
                references = linear_references(model.balance, OUTPUT, *response_range(scene))
            result = keep(replace(result, frf=frf, references=references, state="response computed"))
        check_branch(result.frf)
        if scene.wear is not None:
            with progress.track("wear") as advance:
                result = wear_down(scene, model, result, keep, advance)
        state = "complete" if result.wear is None else f"complete: {result.wear.end}"
        return keep(replace(result, state=state))


def check_names(scene: Scene) -> None:
    """Raise ValueError where a scene names a law or a method that does not exist, before anything is built."""
    law.check_components(law.load(scene.contact.law), scene.contact.components)
    continuation.load(scene.response.method)
    if scene.wear is not None:
        wear_law.load(scene.wear.law)


def make_mesh(file: SceneFile, folder: Path) -> tuple[Any, dict[str, np.ndarray]]:
    """The mesh with its node sets: read from the scene's file, or built from the part and kept in `folder`."""
    geometry = file.scene.geometry
    if geometry.mesh is not None:
        return mesh_reader.read(file.folder / geometry.mesh)
    assert geometry.part is not None
    part, path = parts.load(geometry.part), folder / "mesh.msh"
    part.build(part.Parameters(**geometry.parameters), path)
    return mesh_reader.read(path)


def make_part(scene: Scene, mesh: Any, node_sets: dict[str, np.ndarray]) -> Part:
    """Mass, stiffness, loads, output and contact of the mesh, held where the scene says."""
    contact, response = scene.contact, scene.response
    loads: dict[str, StaticLoad | HarmonicLoad] = {**scene.loads.static, **scene.loads.harmonic}
    return fem.part.build(
        mesh,
        node_sets,
        Material(scene.material.young, scene.material.poisson, scene.material.density),
        [Clamp(group) for group in scene.geometry.fixed],
        [
            fem.part.Contact(
                contact.group, contact.t1, contact.opposite, contact.components, contact.gap, contact.vertices_only
            )
        ],
        {name: NodalForce(load.group, load.direction) for name, load in loads.items()},
        {OUTPUT: NodalForce(response.group, response.direction)},
    )


def reduce_part(scene: Scene, part: Part) -> ReducedModel:
    """The part on its contact and load nodes and a few modes, with the scene's damping."""
    reduced = craig_bampton(part.system, part.interface, scene.reduction.modes, scene.reduction.cutoff)
    return reduced.with_damping(damping_matrix(scene.damping, reduced))


def damping_matrix(damping: Damping, reduced: ReducedModel) -> np.ndarray | None:
    """Damping matrix (n, n) [N s/m] of the reduced model, None where the scene has no damping."""
    if damping.modal is not None:
        return modal_damping(reduced.system, damping.modal)
    if damping.mass is not None or damping.stiffness is not None:
        return rayleigh(reduced.system, damping.mass or 0.0, damping.stiffness or 0.0)
    return None


def make_model(scene: Scene, part: Part, reduced: ReducedModel) -> Model:
    """The harmonic balance of the scene."""
    contact = scene.contact
    stiffness = reduced.interface.stiffness(contact.tangential_stiffness, contact.normal_stiffness)
    parameters = law.ContactParameters.of(
        contact.components, stiffness, friction=contact.friction, gap=reduced.interface.gap
    )
    basis = HarmonicBasis(scene.harmonics.kept, scene.harmonics.samples)
    balance = HarmonicBalance(reduced, contact.law, parameters, basis, excite(scene), response_range(scene)[1])
    return Model(part, reduced, balance)


def excite(scene: Scene) -> Excitation:
    """The loads of the scene: F cos(h w t + phase) is the complex amplitude F exp(i phase)."""
    loads: dict[tuple[int, str], complex] = {(0, name): load.value for name, load in scene.loads.static.items()}
    for name, load in scene.loads.harmonic.items():
        loads[load.harmonic, name] = load.value * np.exp(1j * load.phase)
    return Excitation(loads)


def follow_response(scene: Scene, balance: HarmonicBalance, advance: Callable[[float, str], None]) -> Branch:
    """The response curve of the unworn contact by the scene's continuation method."""
    method, response = continuation.load(scene.response.method), scene.response
    options = {"n_points": response.points, "newton": newton_options(scene), **response.options}
    try:
        chosen = method.Options(**options)
    except TypeError as error:
        raise ValueError(f"response.options: method {response.method} does not take them ({error})") from None
    return method.follow(balance, *response_range(scene), chosen, lambda done, wanted: advance(done / wanted, ""))


def response_range(scene: Scene) -> tuple[float, float]:
    """Lowest and highest frequency of the response [rad/s]."""
    low, high = scene.response.frequency
    return 2 * np.pi * low, 2 * np.pi * high


def newton_options(scene: Scene) -> NewtonOptions:
    """How exactly every balance is solved."""
    return NewtonOptions(tolerance=scene.solver.tolerance)


def check_branch(branch: Branch | None) -> None:
    """Raise SolveFailed where a response curve did not come to its end."""
    if branch is not None and branch.outcome[-1] != CONVERGED:
        raise SolveFailed(f"the frequency response {branch.end}")


def wear_down(
    scene: Scene, model: Model, result: Result, keep: Keeper, advance: Callable[[float, str], None]
) -> Result:
    """Wear until contact is lost; every step is kept as soon as it is done."""
    assert scene.wear is not None
    assert result.patch is not None
    balance, patch, wear = model.balance, result.patch, scene.wear
    newton = newton_options(scene)
    site = (
        AtPeak(OUTPUT, *response_range(scene), scene.response.points, newton=newton)
        if isinstance(wear.at, str)
        else AtFrequency(OUTPUT, 2 * np.pi * wear.at, newton)
    )
    rows = [] if result.wear is None else result.wear.rows()
    to_wear = float(patch.area @ patch.free_deflection)

    def on_row(row: WearRow) -> None:
        rows.append(row)
        keep(replace(result, wear=history(rows, "unfinished"), state=f"unfinished: {len(rows)} wear steps are done"))
        done = float(patch.area @ (row.depth + row.worn)) / to_wear
        advance(done, f"step {len(rows)}, {row.cycles + row.cycles_in_step:.3g} cycles, {row.preload:.4g} N")

    problem = WearProblem(balance, (Duty(site),), wear.law, wear.coefficient, patch.area, wear.lost_below)
    if wear.rule == "thesis":
        worn = thesis_rule.evolve(problem, step_depth(scene, patch), wear.max_steps, on_row, result.wear)
    else:
        tolerance = error_controlled_rule.Tolerance(wear.tolerance, depth_scale(patch))
        worn = error_controlled_rule.evolve(problem, tolerance, wear.max_steps, on_row, result.wear)
    result = with_pictures_of(replace(result, wear=worn), model)
    if worn.end.startswith("solve failed"):
        keep(replace(result, state=worn.end))
        raise SolveFailed(f"wear step {len(worn.cycles)}: {worn.end}")
    return result


def step_depth(scene: Scene, patch: Patch) -> float:
    """Largest depth of one wear step [m]; raises ValueError where it is a share of a deflection that is not finite."""
    assert scene.wear is not None
    step = scene.wear.step
    if step.depth is not None:
        return step.depth
    assert step.share is not None
    return step.share * depth_scale(patch)


def depth_scale(patch: Patch) -> float:
    """delta_max, the largest deflection of the patch without the contact [m]; raises ValueError where there is none."""
    delta_max = float(patch.free_deflection.max())
    if not (np.isfinite(delta_max) and delta_max > 0):
        raise ValueError(
            "wear: a share of delta_max needs static loads that press the contact of a part held without it; "
            'give wear.step as a depth such as "50 um"'
        )
    return delta_max


def with_pictures_of(result: Result, model: Model) -> Result:
    """The result with displacement fields and hysteresis loops of the rows that pictures show."""
    assert result.wear is not None
    if not result.wear_steps:
        return result
    rows, numbers = result.wear.rows(), replace(result, fields=None).shown_rows()
    return replace(
        result,
        fields=displacement_fields(model.balance, model.part, rows, numbers),
        loops=hysteresis_loops(model.balance, rows, numbers),
    )


def described(file: SceneFile, model: Model) -> Result:
    """The result before anything was solved: where it comes from and what is modelled."""
    part, reduced = model.part, model.reduced
    nodes = cKDTree(part.points).query(reduced.interface.points)[1]
    i = reduced.interface
    patch = Patch(i.components, nodes, i.points, i.frames, i.area, i.gap, i.faces, free_deflection(model.balance))
    facts: dict[str, str | int | float | np.ndarray] = {
        "elements": int(part.mesh.nelements),
        "nodes": len(part.points),
        "full_dofs": part.system.n_dof,
        "model_dofs": reduced.system.n_dof,
        "retained_modes": int(str(reduced.info["n_modes"])),
        "first_omitted_hz": float(str(reduced.info["first_omitted_frequency"])),
        "free_hz": np.asarray(reduced.info["free_frequency"]),
        "contact_pairs": i.n_pair,
        "unknowns": model.balance.n_unknown,
        "delta_max_m": float(patch.free_deflection.max()),
        "scaled_jacobian": mesh_reader.quality(part.mesh).scaled_jacobian,
        "factorisation": str(reduced.info["factorisation"]),
        "compliance_error": model.balance.compliance.error,
    }
    return Result(provenance(file), facts, "model built", patch=patch, part=part_mesh(part))


def provenance(file: SceneFile) -> dict[str, str]:
    """Where a result comes from, as texts."""
    return {
        "scene_name": file.name,
        "scene_text": file.text,
        "overrides": "\n".join(file.overrides),
        "scene": file.scene.model_dump_json(),
        "versions": ", ".join(f"{name} {package_version(name)}" for name in PACKAGES),
        "seed": str(SEED),
        "threads": str(file.scene.solver.threads),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def package_version(name: str) -> str:
    """Version of an installed package; a source tree that is run without being installed has none."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def part_mesh(part: Part) -> PartMesh:
    """The mesh of a part in the node order of VTK."""
    cells = part.mesh.dofs.element_dofs.T
    reference, kind = VTK_KIND[cells.shape[1]]
    to_vtk = permutation(part.mesh.elem.doflocs, REFERENCE_POINTS[reference])
    return PartMesh(kind, part.points, cells[:, to_vtk])


class Clock:
    """Seconds of computing, those of an interrupted run included."""

    def __init__(self, earlier: Result | None):
        self._before = 0.0 if earlier is None else float(earlier.facts["seconds"])
        self._start = time.perf_counter()

    def seconds(self) -> float:
        """Seconds so far."""
        return self._before + time.perf_counter() - self._start


@dataclass(frozen=True)
class Keeper:
    """Writes each new state of the result to its file."""

    path: Path
    clock: Clock

    def __call__(self, result: Result) -> Result:
        """Write a result with the seconds it took, and give it back."""
        timed = replace(result, facts={**result.facts, "seconds": self.clock.seconds()})
        store.save(self.path, timed)
        return timed


def same_problem(first: Scene, second: Scene) -> str:
    """Empty where one scene's result can be gone on from by the other, else the first key that differs.

    What is drawn, how many wear steps are wanted and how many threads work may differ.
    """
    ignored: dict[str, Any] = {"scene": True, "pictures": True, "solver": {"threads"}, "wear": {"max_steps"}}
    return _difference(first.model_dump(exclude=ignored), second.model_dump(exclude=ignored))


def _difference(first: Any, second: Any) -> str:
    if isinstance(first, dict) and isinstance(second, dict):
        for key in [*first, *(k for k in second if k not in first)]:
            below = _difference(first.get(key), second.get(key))
            if below:
                return f"{key}.{below}".rstrip(".")
        return ""
    return "" if first == second else "."
