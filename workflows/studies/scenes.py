"""Scenes from Python: read, plan, build, run, load. Files and what they hold are as for the command `tribodyn`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tomli_w

from tribodyn.workflows.errors import accuracy as errors
from tribodyn.workflows.errors.accuracy import Bound
from tribodyn.workflows.errors.verdict import with_verdict
from tribodyn.workflows.result import store
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import checkpoint, modelling, pipeline, planning
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.run.progress import CallbackProgress, Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneFile

Source = SceneFile | str | PathLike[str] | Mapping[str, Any]
"""A scene: one that was read, a name that `scene_names` lists, the path of a .toml file, or its tables as a dict."""

Overrides = Sequence[str] | Mapping[str, Any]
"""Changes of keys: ["wear.step=5 %"] or {"wear.step": "5 %"}; None takes a key out."""

Report = Progress | Callable[[str, float | None], None] | None
"""How to tell what goes on: a function (text, share done or None), or nothing."""


def scene_names() -> list[str]:
    """Names of the scenes that come with the program."""
    return scene_file.names()


def read_scene(source: Source, overrides: Overrides = (), *, folder: str | PathLike[str] | None = None) -> SceneFile:
    """Read and check a scene; quantities are numbers in SI units or texts with a unit, such as "20 kN".

    source : name, path of a .toml file, tables as a dict, or a scene that was read before
    overrides : keys to change, on top of those that the scene has
    folder : where relative file names of a dict begin, the current folder by default
    Raises  SceneError: one sentence that names the key and what is expected
    """
    texts = override_texts(overrides)
    if isinstance(source, SceneFile):
        return scene_file.parse(source.text, f"{source.name}.toml", (*source.overrides, *texts), source.folder)
    if isinstance(source, Mapping):
        text = tomli_w.dumps(_plain(source))
        return scene_file.parse(text, "scene.toml", texts, Path(folder or ".").resolve())
    return scene_file.read(str(source), texts)


def plan(source: Source, overrides: Overrides = ()) -> planning.Plan:
    """What a scene will model and what it will cost, without solving anything."""
    return planning.plan(read_scene(source, overrides))


def build(source: Source, overrides: Overrides = (), *, progress: Report = None) -> Model:
    """The nonlinear problem of a scene, reduced and ready to be solved, with the part that it was made from."""
    return modelling.build(read_scene(source, overrides), None, reporter(progress))


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
    Raises  SceneError, ValueError: the scene asks for what cannot be; SolveFailed: folder keeps what was computed
    """
    file = read_scene(source, overrides)
    if folder is None:
        if pictures or resume:
            raise ValueError(f"{'pictures' if pictures else 'resume'} needs a folder: give run a folder")
        return pipeline.run(file, None, reporter(progress), judge=with_verdict)
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
) -> tuple[Result, Bound]:
    """Run a scene with finer and finer settings until its own verdict's errors are below the wanted one.

    accuracy : such as "1 %", "1 % of energy and peak frequency", "1 % of life given harmonics"
    folder : where result.h5 of the last run is kept, and those of all runs in rounds/1, rounds/2, ...
    resume : take the runs that the folder holds already
    Returns the last result and its errors; `met` says whether all are below the bound
    Raises  ValueError: the accuracy or the scene asks for what cannot be; SolveFailed: folder keeps what was computed
    """
    file, report = read_scene(source, overrides), reporter(progress)

    def one(current: SceneFile, number: int) -> Result:
        place = None if folder is None else Path(folder) / "rounds" / str(number)
        return run(current, place, progress=progress, resume=resume and place is not None)

    result, bound = errors.to_accuracy(file, accuracy, one, report.say)
    if folder is not None:
        store.set_aside(Path(folder) / "result.h5")
        store.save(Path(folder) / "result.h5", result)
    return result, bound


def load(path: str | PathLike[str]) -> Result:
    """Read a result: its folder, or the file result.h5 itself. Raises ResultError."""
    return store.load(result_file(Path(path)))


def result_file(path: Path) -> Path:
    """File of a result that is given by its folder or by itself."""
    return path / "result.h5" if path.is_dir() else path


def draw(
    result: Result, folder: Path, formats: Sequence[str] = ("png",), dpi: int | None = None
) -> tuple[list[Path], str]:
    """Draw what the scene of a result wants drawn; curves come first, they need no system libraries.

    formats : of the pictures, "png", "pdf", "svg"; dpi : dots per inch of what has them

    Returns the files, and a sentence where nothing can be rendered on this machine
    """
    from tribodyn.workflows.pictures import plots

    wanted, missing = scene_file.from_json(result.provenance["scene"]).pictures, ""
    folder.mkdir(parents=True, exist_ok=True)
    written = plots.draw(result, folder, formats, dpi) if wanted.plots else []
    if wanted.renders:
        from tribodyn.workflows.pictures import offscreen, render

        try:
            written += render.draw(result, folder, wanted.deformation_scale, wanted.wear_scale, formats, dpi)
        except offscreen.RenderingUnavailable as reason:
            missing = f"no renders: {reason}"
    return written, missing


def animate(
    result: Result,
    folder: Path,
    over: Literal["wear", "cycle"],
    *,
    row: int | None = None,
    formats: Sequence[str] = ("mp4",),
    images: int = 48,
    dpi: int = 100,
) -> list[Path]:
    """Make a film of a result with the factors of exaggeration of its scene, see pictures.film; returns its files.

    Raises  ValueError: the result has nothing of the kind to show; RenderingUnavailable
    """
    from tribodyn.workflows.pictures.film import film

    wanted = scene_file.from_json(result.provenance["scene"]).pictures
    factors = wanted.deformation_scale, wanted.wear_scale
    return film(result, folder, over, row, formats, images, dpi, *factors)


def reporter(progress: Report) -> Progress:
    """A Progress of what a caller gives."""
    if progress is None:
        return Progress()
    return progress if isinstance(progress, Progress) else CallbackProgress(progress)


def override_texts(overrides: Overrides) -> tuple[str, ...]:
    """Changes of keys as the texts "section.key=value" of the command line."""
    if isinstance(overrides, str):
        raise ValueError(f'overrides is "{overrides}": give a list of texts "section.key=value" or a dict')
    if not isinstance(overrides, Mapping):
        return tuple(overrides)
    return tuple(
        f"{key}=" if value is None else f"{key}={_on_one_line(tomli_w.dumps({'v': _plain(value)}).partition('=')[2])}"
        for key, value in overrides.items()
    )


def _on_one_line(toml: str) -> str:
    """An array over several lines as one: results keep a change in each line."""
    return " ".join(line.strip() for line in toml.strip().splitlines())


def _plain(value: Any) -> Any:
    """A value as TOML has it: arrays as lists, paths as texts; keys whose value is None are left out."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return str(value) if isinstance(value, PathLike) else value
