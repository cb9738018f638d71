"""Run a study: read its file, solve the runs that its folder lacks, write its table."""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import tomli_w

from tribodyn.hbm.threads import limited, usable
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import model_cache
from tribodyn.workflows.run.checkpoint import alone_in
from tribodyn.workflows.run.progress import Progress, Report, reporter
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import AnyPath, SceneError
from tribodyn.workflows.studies.files import write_picture
from tribodyn.workflows.studies.many import parameter_space, pool, study_file, study_pictures
from tribodyn.workflows.studies.many.pool import Work
from tribodyn.workflows.studies.many.run_task import RunRow, StudyRun, solve
from tribodyn.workflows.studies.many.study_file import ParameterStudy
from tribodyn.workflows.studies.many.study_table import Journal, StudyTable, table, write


@dataclass(frozen=True)
class Runner:
    """How and where the runs of a study are done.

    folder : of rows, tables and pictures; workers : processes, as many as there are cores where None
    scheduler : see pool.on_cluster, none where empty; fresh : do again what `folder` holds; retry : failed runs"""

    folder: Path
    progress: Progress
    workers: int | None = None
    scheduler: str = ""
    fresh: bool = False
    retry: bool = False

    def __post_init__(self) -> None:
        if self.workers is not None and self.workers < 1:
            raise Refusal(f"workers {self.workers}: give at least 1")


def grid(
    study: AnyPath | Mapping[str, Any],
    folder: AnyPath | None = None,
    *,
    workers: int | None = None,
    scheduler: str = "",
    fresh: bool = False,
    retry: bool = False,
    progress: Report = None,
) -> StudyTable:
    """Run a scene many times, over lists of values or drawn from distributions, and leave one table.

    A scene may name Python files beside it: running somebody's study runs his code. A script needs
    `if __name__ == "__main__":` around the call.

    study : a .toml file with [study] and [vary], or its tables as a dict
    folder : folder of tables and pictures; results/NAME by default
    workers : processes; as many as there are cores by default
    scheduler : address of a scheduler of dask.distributed, such as tls://host:8786, or "local": processes here
    fresh : do again the runs that the folder holds already; retry : do failed runs again
    Raises  Refusal: the study asks for what cannot be; SolveFailed: the scheduler was lost"""
    plan = study_file.read(study)
    return run(plan, Runner(place(plan, folder), reporter(progress), workers, scheduler, fresh, retry))


def place(study: ParameterStudy, folder: AnyPath | None) -> Path:
    """The folder that a study leaves its tables in."""
    return Path("results") / study.name if folder is None else Path(folder)


def run(
    study: ParameterStudy,
    runner: Runner,
    added: Sequence[dict[str, Any]] = (),
    drawn: bool = True,
    inside: bool = False,
) -> StudyTable:
    """Do the runs of a study, and leave its tables and pictures in a folder.

    added : values of runs beyond those of the design; drawn : whether pictures are wanted
    inside : one worker is this process itself, where few runs are done at a time and starting another would cost more
    Raises  Refusal: the study asks for what cannot be; SolveFailed: the scheduler was lost"""
    if not (runner.scheduler or inside):
        pool.prepared()  # imports while the runs are read
    folder, varied = runner.folder, [*parameter_space.runs(study), *added]
    tasks, refused = _tasks(study, varied)
    folder.mkdir(parents=True, exist_ok=True)
    with alone_in(folder):
        rows = dict(refused)
        try:
            finish(tasks, runner, rows, solve, inside=inside)
        finally:
            if rows:
                write(study_table := table(study.name, varied, rows, folder), folder)
        if drawn and study_pictures.shown(study_table):
            write_picture(study_table.plot, folder / "study.png")
    return study_table


def finish(
    tasks: Sequence[Work],
    runner: Runner,
    rows: dict[int, RunRow],
    solve: Callable[[Work], RunRow],
    noun: str = "runs",
    inside: bool = False,
) -> None:
    """Do what the folder does not hold already: every row is on disk, and in `rows`, as it comes; see `run`."""
    progress, scheduler = runner.progress, runner.scheduler
    journal, refused = Journal(runner.folder), len(rows)
    earlier, repeated = (
        {} if runner.fresh else journal.rows(),
        ("lost", *(("failed", "defect") if runner.retry else ())),
    )
    finished_rows = [replace(earlier[task.key], run=task.number) for task in tasks if task.key in earlier]
    finished_rows = [row for row in finished_rows if row.status not in repeated]
    rows |= {row.run: row for row in finished_rows}
    # rows that are not asked for now stay too: a study that is larger may
    previous = journal.begin((earlier | {row.key: row for row in finished_rows}).values(), runner.fresh)
    if previous:
        progress.say(f"the rows that were here are now {previous}")
    if finished_rows:
        progress.say(f"{len(finished_rows)} of {len(tasks) + refused} {noun} are done already; --fresh does them again")
    remaining = [task for task in tasks if task.number not in rows]
    count = runner.workers or usable(sys.maxsize)
    elsewhere = scheduler not in ("", pool.LOCAL)
    if remaining:
        where = f"the workers of {scheduler}" if elsewhere else f"{min(count, len(remaining))} processes"
        progress.say(f"{len(remaining)} {noun} on {where}, one thread for each")
    with progress.track(f"{len(remaining)} {noun}") as advance:
        if not remaining:
            coming: Iterator[RunRow] = iter(())
        elif elsewhere:
            coming = pool.on_cluster(remaining, scheduler, solve)
        else:
            coming = (
                _in_this_process(remaining, solve) if inside and count == 1 else pool.finished(remaining, count, solve)
            )
        for done, row in enumerate(coming, 1):
            journal.add(row)
            rows[row.run] = row
            bad = sum(finished_row.status != "complete" for finished_row in rows.values())
            advance(done / len(remaining), f"{done} of {len(remaining)}{f', {bad} not complete' if bad else ''}")


def _in_this_process(tasks: Sequence[Work], solve: Callable[[Work], RunRow]) -> Iterator[RunRow]:
    with limited(1), model_cache.memory_cache():
        yield from map(solve, tasks)


def task_at(study: ParameterStudy, values: Mapping[str, Any]) -> StudyRun:
    """One run of a study by itself, with a verdict on what it finds."""
    base = scene_file.read(study.scene, always := ("solver.threads=1", *study.settings.set))
    return StudyRun(1, base.name, base.text, (*always, *_overrides(study, values)), base.folder)


def _overrides(study: ParameterStudy, values: Mapping[str, Any]) -> list[str]:
    values_by_key = {**values, **{copy: values[original] for copy, original in study.settings.same.items()}}
    return [f"{key}={tomli_w.dumps({'v': value}).partition('=')[2].strip()}" for key, value in values_by_key.items()]


def _tasks(study: ParameterStudy, varied: Sequence[dict[str, Any]]) -> tuple[list[StudyRun], dict[int, RunRow]]:
    """The runs, and rows for those whose scene is refused; raises SceneError where every one is."""
    always = ["solver.threads=1", *([] if study.settings.verdict else ["verdict.enabled=false"]), *study.settings.set]
    base = scene_file.read(study.scene, always)
    slopes = tuple(dict.fromkeys((*study.varied, *study.settings.same))) if study.settings.derivatives else ()
    tasks, refused = [], {}
    for number, values in enumerate(varied, 1):
        task = StudyRun(number, base.name, base.text, (*always, *_overrides(study, values)), base.folder, slopes)
        try:
            task.scene()
        except SceneError as error:
            refused[number] = RunRow(number, "", "refused", str(error))
        else:
            tasks.append(task)
    if not tasks:
        raise SceneError(f"every run is refused, the first: {refused[1].sentence}")
    return tasks, refused
