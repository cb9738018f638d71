"""Studies of many runs from Python, as for the commands `tribodyn study`, `tribodyn lives` and `tribodyn optimise`."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from tribodyn.workflows.studies.many import lives as distributions
from tribodyn.workflows.studies.many import optimum as designs
from tribodyn.workflows.studies.many import study as studies
from tribodyn.workflows.studies.many import study_file
from tribodyn.workflows.studies.many.lives import Lives
from tribodyn.workflows.studies.many.optimum import Optimum
from tribodyn.workflows.studies.many.study_file import Study
from tribodyn.workflows.studies.many.table import StudyTable
from tribodyn.workflows.studies.scenes import Report, reporter


def study(
    source: str | PathLike[str] | Mapping[str, Any],
    folder: str | PathLike[str] | None = None,
    *,
    workers: int | None = None,
    scheduler: str = "",
    resume: bool = False,
    retry: bool = False,
    progress: Report = None,
) -> StudyTable:
    """Run a scene many times, over lists of values or drawn from distributions.

    source : path of the .toml file of a study, or its tables as a dict
    folder : of tables and pictures; results/NAME by default, NAME that of the file, or "study"
    workers : processes, as many as there are cores by default; a script needs `if __name__ == "__main__":` around this
    scheduler : address of a scheduler of dask.distributed, or "local" for one of its own
    resume : take the runs that the folder holds already, and do the others; retry : and those that failed
    Raises  SceneError, ValueError: the study asks for what cannot be; SolveFailed: the scheduler was lost
    """
    read, place = _begun(source, folder)
    return studies.run(read, place, reporter(progress), workers, scheduler, resume, retry)


def lives(
    source: str | PathLike[str] | Mapping[str, Any],
    folder: str | PathLike[str] | None = None,
    *,
    rare: float | None = None,
    workers: int | None = None,
    scheduler: str = "",
    resume: bool = False,
    progress: Report = None,
) -> Lives:
    """The distribution of a life, or of another number, over what a study draws; its table [lives] says which.

    source, folder, workers, scheduler, resume : as of `study`
    rare : a share whose value is wanted too, such as 1e-4
    Raises  SceneError, ValueError: what is asked for cannot be; SolveFailed: no run has the number, a lost scheduler
    """
    read, place = _begun(source, folder)
    return distributions.run(read, place, reporter(progress), workers, scheduler, resume, rare)


def optimise(
    source: str | PathLike[str] | Mapping[str, Any],
    folder: str | PathLike[str] | None = None,
    *,
    workers: int | None = None,
    scheduler: str = "",
    resume: bool = False,
    progress: Report = None,
) -> Optimum:
    """The best designs over the ranges of a study: least amplitude and longest life, or what its [optimise] says.

    source, folder, workers, scheduler, resume : as of `study`
    Raises  SceneError, ValueError: what is asked for cannot be; SolveFailed: no run keeps the limits, a lost scheduler
    """
    read, place = _begun(source, folder)
    return designs.run(read, place, reporter(progress), workers, scheduler, resume)


def _begun(source: str | PathLike[str] | Mapping[str, Any], folder: str | PathLike[str] | None) -> tuple[Study, Path]:
    """The study of a file or of its tables, and the folder that it leaves its tables in."""
    if isinstance(source, Mapping):
        read = study_file.parse(source, "study", Path().resolve())
    else:
        read = study_file.read(Path(source))
    return read, Path("results") / read.name if folder is None else Path(folder)
