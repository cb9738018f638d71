"""From a scene to a result: model, response, what the scene asks about it, wear.

A result holds provenance, sizes, patch and mesh before anything is solved."""

import json
import platform
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from tribodyn.fem.assembly import pieces
from tribodyn.fem.part import Part
from tribodyn.geometry import mesh as mesh_reader
from tribodyn.geometry.numbering import REFERENCE_POINTS, permutation
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.harmonic_choice import HarmonicChoice
from tribodyn.hbm.outcome import BranchEnd
from tribodyn.hbm.stability.branch_stability import stability_along
from tribodyn.hbm.threads import limited, usable
from tribodyn.hbm.time import compile_ahead
from tribodyn.output_file import set_aside
from tribodyn.reduction.model import ReductionBasis
from tribodyn.refusal import SolveFailed
from tribodyn.version import package_version
from tribodyn.workflows.result.model_facts import Around, ModelFacts, Stage
from tribodyn.workflows.result.number_format import measured
from tribodyn.workflows.result.result import PartMesh, Patch, Result
from tribodyn.workflows.run import modelling, references, response_curve, sanity_checks, settings, wear_run
from tribodyn.workflows.run.checkpoint import Clock, Keeper, alone_in
from tribodyn.workflows.run.full_fields import with_shown
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.run.references import delta_max, free_deflection
from tribodyn.workflows.scene.file_digests import digests
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import MeshScene, Scene

Judge = Callable[[SceneFile, modelling.Model, Result, Progress], Result]


def run(
    file: SceneFile, folder: Path | None, progress: Progress, earlier: Result | None = None, row_only: bool = False,
    judge: Judge | None = None,
) -> Result:  # fmt: skip
    """Compute everything that a scene asks for, and keep it in `folder`/result.h5 while it grows.

    folder : None keeps nothing on disk
    earlier : an unfinished result of the same scene to resume
    row_only : without linear references and notes of progress, which the row of a study does not hold
    judge : measures the errors of the finished result, where the scene wants them
    Raises  ValueError: the scene asks for what cannot be, SolveFailed: after what was computed is kept"""
    scene, clock = file.scene, Clock(earlier)
    settings.check_names(scene)
    if scene.verdict.enabled and not row_only:
        compile_ahead.start()
    keep = Keeper(None if folder is None else folder / "result.h5", clock)
    with alone_in(folder), limited(scene.solver.threads):
        model = modelling.build(file, progress, () if earlier is None else earlier.harmonics)
        for line in () if progress.silent else sanity_checks.lines(file, model):
            progress.detail(line)
        notes = () if row_only else tuple(sanity_checks.remarks(file, model))
        for note in notes:
            progress.say(f"warning: {note}")
        result = earlier or described(file, model.part, model.balance, model.choice, notes)
        if scene.wears:
            # raises before anything long is begun
            settings.depth_scale(scene, result.patch.free_deflection, result.patch.area)
        previous = None if earlier or keep.path is None else set_aside(keep.path)
        if previous:
            progress.say(f"the result that was here is now {previous}")
        keep(result)
        if result.response is None:
            with progress.track("frequency response") as advance:
                frf = response_curve.follow_response(scene, model.balance, None if row_only else advance)
            linear = None
            if not row_only:
                with progress.stage("linear references"):
                    start, stop = (2 * np.pi * f for f in scene.response.references or scene.response.range)
                    linear = references.linear_references(model.balance, settings.OUTPUT, start, stop)
            result = keep(replace(result, response=frf, references=linear, stage=Stage.RESPONSE))
        if (branch := result.response) is not None:
            check_branch(branch)
            if scene.wears and (peak := branch.peak(settings.OUTPUT)) is not None:
                at, height = branch.omega[peak] / (2 * np.pi), float(branch.amplitude(settings.OUTPUT)[peak])
                progress.say(f"response: peak {measured(at, 'Hz', 4)}, {measured(height, 'm')}, unworn")
            result = keep(judged(scene, model.balance, result, branch, progress))
        if scene.wears:
            with progress.track("wear") as advance:
                result = wear_run.wear_down(file, model, result, keep, advance)
        else:
            result = with_shown(scene, result, model.balance, model.part)
        if judge is not None and scene.verdict.enabled:
            result = judge(file, model, result, progress)
        return keep(replace(result, stage=Stage.COMPLETE))


def judged(scene: Scene, balance: HarmonicBalance, result: Result, frf: Branch, progress: Progress) -> Result:
    """The result with what the scene asks about its response curve and is not there yet."""
    if scene.response.stability and result.stability is None:
        with progress.track("stability") as advance:
            marks = stability_along(balance, frf, on_point=lambda done, of: advance(done / of, ""))
            result = replace(result, stability=marks)
    return result


def check_branch(branch: Branch) -> None:
    """Raise SolveFailed where a response curve did not come to its end."""
    if not branch.converged[-1] or branch.ended is BranchEnd.ENDED:
        raise SolveFailed(f"the frequency response {branch.end}")


# nodes of an element -> points in whose order VTK has them, of which it has the first; VTK's name
VTK_KIND = {
    27: ("hexahedron27", "triquadratic_hexahedron"),
    10: ("tetra10", "quadratic_tetra"),
    8: ("hexahedron27", "hexahedron"),
}
PACKAGES = ("tribodyn", "numpy", "scipy", "numba", "scikit-fem", "gmsh", "meshio", "h5py", "pydantic")
SHOWN = 6  # modes with the contact stuck that a result keeps
SEED = 0  # of every random start vector and probe in the packages used


def described(
    file: SceneFile,
    part: Part | None,
    balance: HarmonicBalance,
    choice: HarmonicChoice | None = None,
    notes: tuple[str, ...] = (),
) -> Result:
    """The result before anything was solved: where it comes from and what is modelled; part None for matrices.

    notes : what of the scene is to be doubted"""
    reduced, i = balance.model, balance.model.interface
    nodes = np.full(i.n_pair, -1) if part is None else part.nodes
    wears = file.scene.wear is not None
    free = free_deflection(balance) if wears else np.full(i.n_pair, np.nan)
    patch = Patch(i.components, nodes, i.points, i.frames, i.area, i.gap, i.faces, free)
    facts = ModelFacts(
        full_dofs=reduced.n_full,
        model_dofs=reduced.system.n_dof,
        contact_pairs=i.n_pair,
        unknowns=balance.n_unknown,
        harmonics=tuple(balance.basis.harmonics),
        open_frequencies=reduced.free_frequency,
        stuck_frequencies=balance.compliance.stuck_frequencies(next(filter(None, balance.basis.harmonics)))[:SHOWN],
        compliance_error=balance.compliance.error,
        prestress_residual=reduced.accuracy().get("prestress_residual"),
        prestress_rotation=reduced.accuracy().get("prestress_rotation"),
        notes=notes,
        places=balance.places,
    )
    if part is not None:
        worst = min(mesh_reader.quality(piece.mesh).scaled_jacobian for piece in pieces(part.mesh))
        facts = replace(facts, elements=int(part.mesh.nelements), nodes=len(part.points), scaled_jacobian=worst)
    origin = reduced.origin
    if isinstance(origin, ReductionBasis):
        facts = replace(
            facts,
            retained_modes=origin.n_modes,
            first_omitted_frequency=origin.first_omitted_frequency,
            factorisation=origin.factorisation,
            interface_modes=origin.n_interface_modes or None,
        )
    if isinstance(file.scene, MeshScene) and file.scene.contacts:
        pairs = {name: slice(0, i.n_pair) for name in file.scene.contacts}  # a single joint has them all
        pairs |= {joint.name: joint.pairs for joint in balance.contact.joints if isinstance(joint.pairs, slice)}
        pairs |= {name: scene_text for name, scene_text in reduced.joints.items() if name in pairs}
        facts = replace(facts, joints=pairs)
    if file.scene.wear is not None:
        depth = delta_max(file.scene, free, i.area)  # none where nothing holds the part without its contact
        facts = replace(facts, delta_max=depth if np.isfinite(depth) else None, wear_split=file.scene.wear.split)
    if isinstance(file.scene, MeshScene) and (wheel := file.scene.wheel) is not None:
        facts = replace(facts, around=Around(wheel.sectors, wheel.engine_order, np.array(wheel.axis)))
    if choice is not None:
        facts = replace(facts, harmonics_error=choice.estimate.error, harmonics_choice=choice.outcome)
    mesh = part_mesh(part) if part is not None and file.scene.pictures.renders else None
    return Result(provenance(file), file.scene, facts, Stage.BUILT, patch=patch, part=mesh)


def provenance(file: SceneFile) -> dict[str, str]:
    """Where a result comes from, as texts."""
    return {
        "scene_name": file.name,
        "scene_text": file.text,
        "overrides": "\n".join(file.overrides),
        "folder": str(file.folder),
        "files": json.dumps(digests(file.scene.model_dump(mode="json"), file.folder)),
        "versions": ", ".join(f"{name} {package_version(name)}" for name in PACKAGES),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "seed": str(SEED),
        "threads": str(usable(file.scene.solver.threads)),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def part_mesh(part: Part) -> PartMesh | None:
    """The mesh of a part in the node order of VTK; None where its bodies are of different elements."""
    fields = []
    for piece in pieces(part.mesh):
        cells = piece.mesh.dofs.element_dofs.T
        reference, kind = VTK_KIND[cells.shape[1]]
        to_vtk = permutation(piece.mesh.elem.doflocs, REFERENCE_POINTS[reference][: cells.shape[1]])
        fields.append((kind, piece.node + cells[:, to_vtk]))
    if len({kind for kind, _ in fields}) > 1:
        return None
    return PartMesh(fields[0][0], part.points, np.concatenate([cells for _, cells in fields]))
