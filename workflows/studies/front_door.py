"""Scenes from Python: read, plan, build, run, load. Files and what they hold are as for the command `tribodyn`."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from tribodyn.consent import asks_consent
from tribodyn.extras import package
from tribodyn.output_file import set_aside
from tribodyn.refusal import Refusal
from tribodyn.workflows.errors import accuracy as errors
from tribodyn.workflows.errors.accuracy import ErrorBound
from tribodyn.workflows.errors.judgement import with_verdict
from tribodyn.workflows.result import store
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.store import ResultSource
from tribodyn.workflows.run import checkpoint, modelling, pipeline, planning
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.run.progress import Progress, Report, reporter
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import AnyPath, Overrides, SceneFile, Source, read_scene


def scene_names() -> list[str]:
    """Names of the scenes that come with the program."""
    return scene_file.names()


@asks_consent
def plan(source: Source, overrides: Overrides = (), *, allow_scripts: bool = False) -> planning.Plan:
    """What a scene will model and what it will cost, without solving anything.

    allow_scripts : run a Python file or a drawing (.geo) that makes the part"""
    return planning.plan(read_scene(source, overrides))


@asks_consent
def picture(source: Source, path: AnyPath, overrides: Overrides = (), *, allow_scripts: bool = False) -> Path:
    """Draw a scene before it is run: bodies, contacts in colour, what is held, loads as arrows; its path.

    allow_scripts : as for `plan`
    Raises  SceneError: the scene has no mesh, or asks for what cannot be; RenderingUnavailable"""
    from tribodyn.workflows.pictures import groups

    file = read_scene(source, overrides)
    return groups.draw_scene(file.mesh_scene, modelling.part_of(file, Progress()), Path(path))


def build(source: Source, overrides: Overrides = (), *, progress: Report = None) -> Model:
    """The nonlinear problem of a scene, reduced and ready to be solved, with the part that it was made from."""
    return modelling.build(read_scene(source, overrides), reporter(progress))


def run(
    source: Source,
    folder: str | PathLike[str] | None = None,
    *,
    overrides: Overrides = (),
    pictures: bool = False,
    progress: Report = None,
    resume: bool = False,
) -> Result:
    """Run a scene.

    folder : where result.h5 is kept while it grows, and the pictures; in memory alone where None
    pictures : draw what the scene wants drawn into folder/pictures
    progress : function (text, share): a sentence with None, or a stage with the share of it that is done
    resume : continue an unfinished result in the folder
    Raises  Refusal: the scene asks for what cannot be; SolveFailed: folder keeps what was computed"""
    file = read_scene(source, overrides)
    if folder is None:
        if pictures or resume:
            raise Refusal(f"{'pictures' if pictures else 'resume'} needs a folder: give run a folder")
        return pipeline.run(file, None, reporter(progress), judge=with_verdict)
    if pictures:
        package("matplotlib")  # before long work
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    path = place / "result.h5"
    earlier = checkpoint.earlier(path, file) if resume else None
    if earlier is not None and checkpoint.is_complete(earlier, file.scene):
        reporter(progress).say(f"{path} is complete already")
        result = earlier
    else:
        result = pipeline.run(file, place, reporter(progress), earlier, judge=with_verdict)
    if pictures:
        draw(result, place / "pictures")
    return result


def run_to_accuracy(
    source: Source,
    accuracy: str,
    folder: str | PathLike[str] | None = None,
    *,
    overrides: Overrides = (),
    progress: Report = None,
    resume: bool = False,
) -> tuple[Result, ErrorBound]:
    """Run a scene with finer and finer settings until its own verdict's errors are below the wanted one.

    accuracy : such as "1 %", "1 % of energy and peak frequency"
    folder : where result.h5 of the last run is kept, and those of all runs in rounds/1, rounds/2, ...
    resume : take the runs that the folder holds already
    Returns the last result and its errors; `is_satisfied` says whether all are below the bound
    Raises  Refusal: the accuracy or the scene asks for what cannot be; SolveFailed: folder keeps what was computed"""
    file, report = read_scene(source, overrides), reporter(progress)

    def run_round(current: SceneFile, number: int) -> Result:
        place = None if folder is None else Path(folder) / "rounds" / str(number)
        return run(current, place, progress=progress, resume=resume and place is not None)

    result, bound = errors.to_accuracy(file, accuracy, run_round, report.say)
    if folder is not None:
        set_aside(Path(folder) / "result.h5")
        store.save(Path(folder) / "result.h5", result)
    return result, bound


def draw(
    result: Result, folder: Path, formats: Sequence[str] = ("png",), dpi: int | None = None
) -> tuple[list[Path], str]:
    """Draw what the scene of a result wants drawn; curves come first, they need no system libraries.

    formats : of the pictures, "png", "pdf", "svg"; dpi : dots per inch of what has them

    Returns the files, and a sentence where nothing can be rendered on this machine"""
    from tribodyn.workflows.pictures import plots

    settings, missing = result.scene.pictures, ""
    folder.mkdir(parents=True, exist_ok=True)
    written = plots.draw(result, folder, formats, dpi) if settings.plots else []
    if settings.renders:
        from tribodyn.workflows.pictures import offscreen, render

        try:
            written += render.draw(result, folder, settings.deformation_scale, settings.wear_scale, formats, dpi)
        except offscreen.RenderingUnavailable as reason:
            missing = f"no renders: {reason}"
    return written, missing


@asks_consent
def export(
    result: ResultSource, to: Sequence[str], folder: AnyPath, mesh_ending: str = ".xdmf", *, allow_scripts: bool = False
) -> list[Path]:
    """Write a result in the formats of other programs, each into a folder of its name; the files written.

    to : of vtk, csv, mat, uff, mesh, npz, matlab; mesh_ending : format of the mesh
    allow_scripts : run Python files and drawings that the scene names, for matrices"""
    from tribodyn.workflows.export import formats

    return list(formats.write(store.result_of(result), to, Path(folder), mesh_ending))


def report(results: Sequence[AnyPath], path: AnyPath) -> Path:
    """Write one HTML file that shows results and opens anywhere, without a network; its path.

    results : folders or files; several are shown side by side, with differences from the first"""
    from tribodyn.workflows.report import page

    if not results:
        raise Refusal("report: give the folder or file of a result")
    paths = [Path(item) for item in results]
    files, loaded = [store.result_file(item) for item in paths], [store.load(item) for item in paths]
    names = [str(item.provenance["scene_name"]) for item in loaded]
    if len(set(names)) < len(names):
        names = [file.parent.name or str(item) for file, item in zip(files, paths, strict=True)]
    if len(set(names)) < len(names):
        names = [str(file) for file in files]
    return page.write(list(zip(names, loaded, files, strict=True)), Path(path))
