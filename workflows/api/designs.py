"""Studies of many runs from Python, as for the command `tribodyn study`."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from tribodyn.workflows.api.scenes import Report, reporter
from tribodyn.workflows.designs import study as studies
from tribodyn.workflows.designs import study_file
from tribodyn.workflows.designs.table import StudyTable


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
    if isinstance(source, Mapping):
        read = study_file.parse(source, "study", Path().resolve())
    else:
        read = study_file.read(Path(source))
    place = Path("results") / read.name if folder is None else Path(folder)
    return studies.run(read, place, reporter(progress), workers, scheduler, resume, retry)
