"""Studies of a whole scene from Python, as the commands of the same names make them: each returns its numbers.

A scene is named as on the command line, by its name or the path of its .toml file; `overrides` are as for `run`.
Frequencies are in Hz, all else is in SI units. `progress` is called with a sentence and the share done, or None.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Literal

from tribodyn.fem.material import Material
from tribodyn.workflows.errors import converge as grids
from tribodyn.workflows.errors import trade as settings
from tribodyn.workflows.errors.converge import Study as GridStudy
from tribodyn.workflows.errors.trade_table import Trade
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.studies import inspection, verification, worn_in_time, worn_states
from tribodyn.workflows.studies.curves import folds as fold_study
from tribodyn.workflows.studies.curves import tracking
from tribodyn.workflows.studies.curves.folds import FoldsFound
from tribodyn.workflows.studies.curves.tracking import Track
from tribodyn.workflows.studies.fits import fit_file
from tribodyn.workflows.studies.fits.identification import Identification
from tribodyn.workflows.studies.fits.posterior import Posterior
from tribodyn.workflows.studies.inspection import Inspection
from tribodyn.workflows.studies.scenes import (
    Overrides,
    Report,
    Source,
    load,
    override_texts,
    read_scene,
    reporter,
    result_file,
)
from tribodyn.workflows.studies.verification import Comparison
from tribodyn.workflows.studies.worn_in_time import LifeInTime
from tribodyn.workflows.studies.worn_states import WornState

Place = str | PathLike[str]


def verify(
    result: Result | Place,
    at: float | None = None,
    *,
    row: int | None = None,
    steps: int | None = None,
    overrides: Overrides = (),
    progress: Report = None,
) -> Comparison:
    """Hold a result against time integration of the same reduced model with the same contact law.

    at : frequency [Hz], the peak of the response or the frequency of the row by default
    row : wear row whose depth the contact has, unworn by default; steps : per period, 256 or 32 a harmonic by default
    Returns both motions and their difference; `found.outcome` says whether the integrated motion became periodic
    """
    held = result if isinstance(result, Result) else load(result)
    omega = None if at is None else 2 * math.pi * at
    return verification.compare(held, omega, row, override_texts(overrides), steps, reporter(progress))


def verify_wear(
    result: Result | Place,
    states: int,
    *,
    steps: int | None = None,
    overrides: Overrides = (),
    progress: Report = None,
) -> list[WornState]:
    """Hold so many states of a wear run, spread over its cycles, against time integration; the rest as for `verify`."""
    held = result if isinstance(result, Result) else load(result)
    return worn_states.compare(held, states, override_texts(overrides), steps, reporter(progress))


def wear_in_time(
    result: Result | Place,
    rows: Place,
    *,
    steps: int | None = None,
    overrides: Overrides = (),
    progress: Report = None,
) -> LifeInTime:
    """Wear the contact of a wear run along its motion in time, at the frequencies of the run.

    The motion is marched on while the contact wears, with mean wear rates where it does not repeat itself.
    rows : .csv file that takes every wear step as soon as it is done; steps : per period, as for `verify`
    Raises  ValueError where there is no wear run, or no motion in time, as of a travelling wave
    """
    held = result if isinstance(result, Result) else load(result)
    return worn_in_time.compare(held, override_texts(overrides), steps, Path(rows), reporter(progress))


def track(
    source: Source,
    against: Literal["load", "gap", "stiffness", "friction", "wear"],
    start: float,
    stop: float,
    *,
    fold: int | None = None,
    points: int | None = None,
    worn: Place | None = None,
    overrides: Overrides = (),
    progress: Report = None,
) -> Track:
    """Follow the resonance peak, or a fold of the response, while one number of the scene goes from start to stop.

    against : factor on harmonic loads, contact springs or friction; opening [m] added to every gap; share of the depth
        of the result `worn`
    fold : number of the fold, 1 for that of the highest frequency; the peak by default
    points : values of the peak, 21 by default, or the most that a line of folds may have, 500 by default
    """
    most = points if points is not None else (21 if fold is None else 500)
    place = None if worn is None else Path(worn)
    file = read_scene(source, overrides)
    return tracking.follow(file, against, start, stop, fold, most, place, reporter(progress))


def folds(source: Source, within: float = 0.02, *, overrides: Overrides = (), progress: Report = None) -> FoldsFound:
    """The folds of a scene's response by harmonic balance, and where the same branches end in time integration.

    within : relative distance to a fold within which its end in time is looked for
    """
    return fold_study.find(read_scene(source, overrides), reporter(progress), within)


def trade(
    scene: Place,
    parameters: Sequence[str] = (),
    *,
    most: int = 99,
    overrides: Overrides = (),
    progress: Report = None,
    keep: Callable[[Trade], None] = lambda trade: None,
    earlier: Trade | None = None,
) -> Trade:
    """What each parameter of a scene costs and what it is worth, against where it tends to on the same scene.

    parameters : all that the scene has by default; most : settings of each parameter, the finest ones
    keep : called with what is there after each parameter; earlier : table whose other parameters are taken over
    """
    texts = override_texts(overrides)
    return settings.run(fspath(scene), parameters, texts, reporter(progress).say, most, keep, earlier)


def converge(
    scene: Place, *, most: float = 99, overrides: Overrides = (), progress: Report = None
) -> tuple[GridStudy, ...]:
    """Refine contact grid and mesh of a scene that has a study of its grids, up to `most` nodes along the patch."""
    return grids.run(fspath(scene), override_texts(overrides), most, reporter(progress).say)


def fit(
    scene: Place, task: Place | Mapping[str, Any], *, overrides: Overrides = (), progress: Report = None
) -> tuple[Identification, list[str]]:
    """Fit named numbers of a scene to measured ones, as `tribodyn identify`.

    task : file of the fit, or its tables as a dict
    Returns what was found with its errors, and the overrides that put it into the scene
    """
    asked = fit_file.parse(task) if isinstance(task, Mapping) else fit_file.read(Path(task))
    return fit_file.run(fspath(scene), override_texts(overrides), asked, reporter(progress).say)


def posterior(
    scene: Place,
    task: Place | Mapping[str, Any],
    *,
    trials: int = 100,
    seed: int = 0,
    overrides: Overrides = (),
    progress: Report = None,
) -> Posterior:
    """What measured numbers with their errors leave of numbers of a scene, as `tribodyn identify --posterior`.

    task : file of the fit, or its tables as a dict; trials : of the scene, at most
    Raises  SceneError, ValueError: what is asked for cannot be; SolveFailed: most trials fail
    """
    asked = fit_file.parse(task) if isinstance(task, Mapping) else fit_file.read(Path(task))
    return fit_file.sample(fspath(scene), override_texts(overrides), asked, reporter(progress).say, trials, seed)


def inspect(
    what: Place, *, unit: str = "m", material: Material | None = None, modes: int = 0, overrides: Overrides = ()
) -> Inspection:
    """Say what a mesh, a deck, a CAD file or a scene holds: size, mass, bodies, groups, worst element, gaps, checks.

    unit : of length of a file that is no scene; material : of its bodies where the file gives none
    modes : how many natural frequencies are wanted, free of contact
    """
    return inspection.inspect(fspath(what), override_texts(overrides), unit, material, modes)


def export(
    result: Result | Place, to: Sequence[str], folder: str | PathLike[str], mesh_ending: str = ".xdmf"
) -> list[Path]:
    """Write a result in the formats of other programs, each into a folder of its name; the files written.

    to : of vtk, csv, parquet, mat, uff, mesh, npz, mtx, abaqus; mesh_ending : format of the mesh
    """
    from tribodyn.workflows.export import formats

    held = result if isinstance(result, Result) else load(result)
    return list(formats.write(held, to, Path(folder), mesh_ending))


def report(results: Sequence[Place], path: str | PathLike[str]) -> Path:
    """Write one HTML file that shows results and opens anywhere, without a network; its path.

    results : folders or files; several are shown side by side, with differences from the first
    """
    from tribodyn.workflows.report import page

    if not results:
        raise ValueError("report: give the folder or file of a result")
    given = [Path(one) for one in results]
    files, loaded = [result_file(one) for one in given], [load(one) for one in given]
    names = [str(one.provenance["scene_name"]) for one in loaded]
    if len(set(names)) < len(names):
        names = [file.parent.name or str(one) for file, one in zip(files, given, strict=True)]
    if len(set(names)) < len(names):
        names = [str(file) for file in files]
    return page.write(list(zip(names, loaded, files, strict=True)), Path(path))
