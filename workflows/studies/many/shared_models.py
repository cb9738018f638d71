"""Meshes and reductions that runs of a study share, each made once for all processes, in files beside its rows."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from tribodyn.workflows.studies.many.task import Task

NAME = "models"


@contextmanager
def shared(
    tasks: Sequence[Task], folder: Path, workers: int, scheduler: str
) -> Iterator[tuple[list[Task], Callable[[int], None]]]:
    """The runs with the files through which they share what they are made of, and a function to call as a run ends.

    A file is named by a hash of all that its content is made of, and removed with the last run that reads it. A study
    that is killed leaves its files to the one that resumes it. One process alone shares nothing.
    """
    if workers == 1 and not scheduler:
        yield list(tasks), lambda number: None
        return
    key_of = {task.number: task.early_key for task in tasks if task.early}
    readers = Counter(key_of.values())
    room = folder.resolve() / NAME
    room.mkdir(exist_ok=True)

    def ready(task: Task) -> Task:
        key = key_of.get(task.number, "")
        return replace(task, store=room / f"{key}.pickle") if readers[key] > 1 else task

    def end(number: int) -> None:
        key = key_of.get(number, "")
        readers[key] -= 1
        if not readers[key]:
            (room / f"{key}.pickle").unlink(missing_ok=True)

    yield [ready(task) for task in tasks], end
    shutil.rmtree(room, ignore_errors=True)
