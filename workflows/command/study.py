"""The words of the command `tribodyn` that do the many runs of a study: for their table, for lives, for an optimum."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from tribodyn.workflows.command.words import Flag, Json, make_room, quantity

if TYPE_CHECKING:
    from tribodyn.workflows.run.progress import Progress
    from tribodyn.workflows.studies.many.study_file import Study
    from tribodyn.workflows.studies.many.table import StudyTable

TOLD = 5  # runs that are not complete, before the rest is only counted


def study(
    file: Path,
    *,
    workers: int | None = None,
    scheduler: str = "",
    out: Path | None = None,
    resume: Flag = False,
    retry: Flag = False,
    as_json: Json = False,
) -> None:
    """Run a scene many times, over lists of values or drawn from distributions, and leave one table.

    A scene may name Python files beside it: running somebody's study runs his code.

    Parameters
    ----------
    file
        A .toml file with [study] and [vary].
    workers
        Processes; as many as there are cores by default.
    scheduler
        Address of a scheduler of dask.distributed, such as tcp://host:8786, or "local" for one of its own.
    out
        Folder of tables and pictures; results/NAME by default.
    resume
        Take the runs that the folder holds already, and do the others.
    retry
        Resume, and do failed runs again.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.studies.many import study as studies

    read, folder, progress = _begun(file, out, as_json)
    try:
        found = studies.run(read, folder, progress, workers, scheduler, resume, retry)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(_stopped("study", file, folder)) from None
    counts = {status: found.count(status) for status in ("complete", "failed", "refused", "lost")}
    if as_json:
        files = {kind: str(folder / f"study.{kind}") for kind in ("csv", "h5")}
        print(json.dumps({"study": found.name, "runs": counts, "influence": found.influence(), **files}, indent=2))
        return
    print("runs: " + ", ".join(f"{count} {status}" for status, count in counts.items() if count))
    for line in troubles(found):
        print(line)
    for number, by_key in found.influence().items():
        if number.endswith("_first") or number in ("life_cycles", "depth_max_m"):
            told = ", ".join(f"{key} {rank:+.2f}" for key, rank in sorted(by_key.items(), key=lambda i: -abs(i[1])))
            print(f"{number:14} rank correlation with {told}")
    print(folder / "study.csv", folder / "study.h5", sep="\n")


def troubles(found: StudyTable) -> list[str]:
    """The first runs that are not complete, with their sentences."""
    columns = found.columns
    bad = [i for i, status in enumerate(columns["status"]) if status != "complete"]
    told = [f"run {columns['run'][i]} {columns['status'][i]}: {columns['sentence'][i]}" for i in bad[:TOLD]]
    return told + ([f"... and {len(bad) - TOLD} more, in the table"] if len(bad) > TOLD else [])


def lives(
    file: Path,
    *,
    rare: str | None = None,
    workers: int | None = None,
    scheduler: str = "",
    out: Path | None = None,
    resume: Flag = False,
    as_json: Json = False,
) -> None:
    """Say what life a share of the parts outlives, how sure that is, and what to measure next.

    Parameters
    ----------
    file
        The .toml file of a study that draws from distributions; its table [lives] says what is wanted.
    rare
        Share of the parts whose value is wanted as well, such as 1e-4.
    workers
        Processes; as many as there are cores by default.
    scheduler
        Address of a scheduler of dask.distributed, or "local" for one of its own.
    out
        Folder of lives.json, lives.png and the study's tables; results/NAME by default.
    resume
        Take the runs that the folder holds already, and do the others.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.studies.many import lives as distributions

    share = None if rare is None else quantity("--rare", rare, "")
    read, folder, progress = _begun(file, out, as_json)
    try:
        found = distributions.run(read, folder, progress, workers, scheduler, resume, share)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(_stopped("lives", file, folder)) from None
    if as_json:
        print(json.dumps(found.record(), indent=2))
        return
    print(*troubles(found.table), *found.lines(), folder / "lives.json", folder / "lives.png", sep="\n")


def optimise(
    file: Path,
    *,
    workers: int | None = None,
    scheduler: str = "",
    out: Path | None = None,
    resume: Flag = False,
    as_json: Json = False,
) -> None:
    """Look for the best designs: least amplitude and longest life, or other aims, over ranges of any keys.

    Parameters
    ----------
    file
        The .toml file of a study that draws from ranges; its table [optimise] says what is wanted.
    workers
        Processes; as many as there are cores by default.
    scheduler
        Address of a scheduler of dask.distributed, or "local" for one of its own.
    out
        Folder of optimum.json, optimum.png and the study's tables; results/NAME by default.
    resume
        Take the runs that the folder holds already, and do the others.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.studies.many import optimum

    read, folder, progress = _begun(file, out, as_json)
    try:
        found = optimum.run(read, folder, progress, workers, scheduler, resume)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(_stopped("optimise", file, folder)) from None
    if as_json:
        print(json.dumps(found.record(), indent=2))
        return
    print(*troubles(found.table), *found.lines(), folder / "optimum.json", folder / "optimum.png", sep="\n")


def _begun(file: Path, out: Path | None, as_json: bool) -> tuple[Study, Path, Progress]:
    """A study, the folder that it leaves its tables in, and who is told how far it is."""
    from tribodyn.workflows.run.progress import Progress, console_progress
    from tribodyn.workflows.studies.many import study_file

    make_room(out)
    read = study_file.read(file)
    return read, out or Path("results") / read.name, Progress() if as_json else console_progress()


def _stopped(word: str, file: Path, folder: Path) -> str:
    again = shlex.join(["tribodyn", word, str(file), "--out", str(folder), "--resume"])
    return f"stopped; what was finished is kept in {folder}: resume with {again}"


COMMANDS = (study, lives, optimise)
