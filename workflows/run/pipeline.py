"""From a scene to a result: model, response, what the scene asks about it, wear, worn responses."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.outcome import BranchEnd
from tribodyn.hbm.stability.branch_stability import stability_along
from tribodyn.hbm.threads import limited
from tribodyn.output_file import set_aside
from tribodyn.workflows.result.model_facts import Stage
from tribodyn.workflows.result.number_format import measured
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import modelling, references, response_curve, sanity_checks, settings, wear_run
from tribodyn.workflows.run.checkpoint import Clock, Keeper, alone_in
from tribodyn.workflows.run.description import described
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.full_fields import with_shown
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import Scene

Judge = Callable[[SceneFile, modelling.Model, Result, Progress], Result]


def run(
    file: SceneFile,
    folder: Path | None,
    progress: Progress,
    earlier: Result | None = None,
    row_only: bool = False,
    judge: Judge | None = None,
) -> Result:
    """Compute everything that a scene asks for, and keep it in `folder`/result.h5 while it grows.

    folder : None keeps nothing on disk
    earlier : an unfinished result of the same scene to resume
    row_only : without linear references and notes of progress, which the row of a study does not hold
    judge : measures the errors of the finished result, where the scene wants them
    Raises  ValueError: the scene asks for what cannot be, SolveFailed: after what was computed is kept"""
    scene, clock = file.scene, Clock(earlier)
    settings.check_names(scene)
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
        if scene.wear is not None and scene.wear.responses and result.wear_steps:
            with progress.track("responses of the worn contact") as advance:

                def follow_worn(worn: HarmonicBalance) -> Branch:
                    return response_curve.follow_response(scene, worn, folds=False)

                count = scene.wear.responses
                curves = response_curve.worn_responses(result, model.balance, count, follow_worn, advance)
                result = keep(replace(result, worn=curves))
        if judge is not None and scene.verdict.enabled and scene.response.control == "force":
            result = judge(file, model, result, progress)
        return keep(replace(result, stage=Stage.COMPLETE))


def judged(scene: Scene, balance: HarmonicBalance, result: Result, frf: Branch, progress: Progress) -> Result:
    """The result with what the scene asks about its response curve and is not there yet."""
    if scene.response.stability and result.stability is None:
        with progress.track("stability") as advance:
            marks = stability_along(balance, frf, on_point=lambda done, of: advance(done / of, ""))
            result = replace(result, stability=marks)
    if scene.response.bounds and result.bounds is None and balance.contact.n_pair:
        with progress.track("bounds of residual shear") as advance:
            bounds = response_curve.shear_bounds(balance, frf, settings.OUTPUT, settings.newton_options(scene), advance)
            result = replace(result, bounds=bounds)
    return result


def check_branch(branch: Branch) -> None:
    """Raise SolveFailed where a response curve did not come to its end."""
    if not branch.converged[-1] or branch.ended is BranchEnd.ENDED:
        raise SolveFailed(f"the frequency response {branch.end}")
