"""Checkpoints: what is kept of a run on its way, and which kept result a scene can resume."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from filelock import FileLock, Timeout

from tribodyn.hbm.outcome import WearEnd
from tribodyn.refusal import Refusal
from tribodyn.workflows.result import store
from tribodyn.workflows.result.model_facts import ModelFacts
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.scene.fields import DRAW
from tribodyn.workflows.scene.file_digests import digests
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.scene_values import scene_values
from tribodyn.workflows.scene.schema import Scene

_ABSENT = object()


class Clock:
    """Seconds of computing, those of an interrupted run included: on the wall, and of the processor."""

    def __init__(self, earlier: Result | None):
        self._before = ModelFacts() if earlier is None else earlier.facts
        self._start, self._processor = time.perf_counter(), _processor()

    def seconds(self) -> float:
        """Seconds so far."""
        return self._before.seconds + time.perf_counter() - self._start

    def processor_seconds(self) -> float:
        """Seconds of the processor so far, of all threads and processes; other work on the machine changes nothing."""
        return self._before.processor_seconds + _processor() - self._processor


def _processor() -> float:
    """Seconds of the processor of this process and of those that it has ended."""
    ended = os.times()
    return time.process_time() + ended.children_user + ended.children_system


@contextmanager
def alone_in(folder: Path | None) -> Iterator[None]:
    """Keep other runs out of a folder while this one writes into it; raises ValueError where one is at work there."""
    if folder is None:
        yield
        return
    lock = FileLock(folder / ".lock", timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise Refusal(f"another run is writing into {folder}: wait for it, or give another folder") from None
    except OSError as error:
        raise Refusal(f"{folder} cannot be written to: {error.strerror or error}") from None
    try:
        yield
    finally:
        lock.release()


@dataclass(frozen=True)
class Keeper:
    """Writes each new state of the result to its file; without one the result lives in memory alone."""

    path: Path | None
    clock: Clock

    def __call__(self, result: Result) -> Result:
        """Write a result with the seconds it took, and give it back."""
        clock = self.clock
        facts = replace(result.facts, seconds=clock.seconds(), processor_seconds=clock.processor_seconds())
        timed = replace(result, facts=facts)
        if self.path is not None:
            store.save(self.path, timed)
        return timed


def earlier(path: Path, file: SceneFile) -> Result | None:
    """The result at `path` for a scene to resume from, None where there is none yet.

    Raises  ValueError where it is the result of another scene"""
    if not path.exists():
        return None
    result = store.load(path)
    key = same_problem(result.scene, file.scene)
    if key:
        raise Refusal(f"{path} is the result of another scene, {key} differs: run its scene, or without --resume")
    before = store.file_digests(result)
    for name, content_digest in digests(file.scene.model_dump(mode="json"), file.folder).items():
        if before.get(name, content_digest) != content_digest:
            raise Refusal(f"{path} was computed with another content of {name}: run the scene without --resume")
    return result


def is_complete(result: Result, scene: Scene) -> bool:
    """Whether a result holds everything that a scene of the same problem asks for."""
    if not result.finished or scene.wear is None or not scene.wears:
        return result.finished
    stopped = result.wear is None or result.wear.ended is WearEnd.STEPS_DONE
    return not stopped or result.wear_steps >= scene.wear.max_steps


def same_problem(first: Scene, second: Scene) -> str:
    """Empty where one scene's result can be resumed by the other, else the first key that differs.

    What is drawn or reported may differ, and the fields that are marked as resumable."""
    before, after = (
        {entry.key: entry.value for entry in scene_values(scene) if entry.stage < DRAW and not entry.is_resumable}
        for scene in (first, second)
    )
    return next((key for key in before | after if before.get(key, _ABSENT) != after.get(key, _ABSENT)), "")
