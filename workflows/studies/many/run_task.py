"""One run of a study, in any process, and its row in the table."""

import hashlib
import threading
import time
import tomllib
import traceback
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.version import __version__
from tribodyn.workflows.errors.judgement import with_verdict
from tribodyn.workflows.result.answers import answers_of
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import pipeline
from tribodyn.workflows.run.parameter_variation import ParameterVariation
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.file_digests import digests
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.studies import derivatives_at_points

Status = Literal["complete", "failed", "refused", "defect", "lost"]
RUN = "run"  # the column of their numbers
UNDRAWN = ("pictures.plots=false", "pictures.renders=false")


@dataclass(frozen=True)
class StudyRun:
    """One run: a scene by its text, so that another process or machine needs no file of it.

    number : of the run, from 1; overrides : of the scene, those of the run last; folder : of the files it names
    slopes : keys by which the numbers of its first state and its life have derivatives too, as far as these are exact
    """

    number: int
    name: str
    text: str
    overrides: tuple[str, ...]
    folder: Path
    slopes: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """Hash of all that the row depends on: scene, overrides, contents of the files that they name, version."""
        content = hashlib.sha256(repr((__version__, self.text, self.overrides, self.slopes)).encode())
        tables = [tomllib.loads(self.text), *(override.partition("=")[2].strip(" \"'") for override in self.overrides)]
        content.update(repr(digests(tables, self.folder)).encode())
        return content.hexdigest()

    def scene(self) -> SceneFile:
        """The scene of the run, which draws nothing; raises SceneError."""
        return scene_file.parse(self.text, f"{self.name}.toml", (*UNDRAWN, *self.overrides), self.folder)


@dataclass(frozen=True)
class RunRow:
    """Row of one run in the table of a study.

    key : of the task; sentence : how it ended; numbers : by column, SI units, what there is none of is left out
    status : complete, failed in a solve, refused as a scene, stopped by a defect, or lost with its process"""

    run: int
    key: str
    status: Status
    sentence: str
    numbers: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0


_one_at_a_time = threading.Lock()  # workers may have several threads, Gmsh and the threads of BLAS are of a process


def solve(task: StudyRun) -> RunRow:
    """Do one run; an exception in it becomes its row."""
    start = time.perf_counter()

    def ended(status: Status, sentence: object, numbers: dict[str, float] | None = None) -> RunRow:
        text = " ".join(str(sentence).split())
        return RunRow(task.number, task.key, status, text, numbers or {}, time.perf_counter() - start)

    with _one_at_a_time:
        try:
            file = task.scene()
            result = pipeline.run(file, None, Progress(), row_only=True, judge=with_verdict)
            numbers = numbers_of(result)
            if task.slopes and not numbers.get("peak_at_end"):
                slopes = derivatives_at_points.of_summary(ParameterVariation(file, Progress()), result, task.slopes)
                numbers |= {slope_column(*of): slope for of, slope in slopes.items()}
        except Exception as error:  # the other runs go on
            return ended(*outcome_of(error))
        frf = result.response
        reason = frf.no_peak(frf.output_names[0]) if frf is not None and numbers.get("peak_at_end") else ""
        return ended("complete", f"{result.state}; no peak: {reason}" if reason else result.state, numbers)


def outcome_of(error: Exception) -> tuple[Status, str]:
    """How a run ended by an exception: refused as bad input, failed in a solve, or stopped by a defect of the program.

    The sentence of a defect has its type and place."""
    if isinstance(error, (Refusal, OSError)):
        return "refused", str(error)
    if isinstance(error, MemoryError):
        return "failed", str(error) or "the memory of this machine is not enough"
    if isinstance(error, (SolverFailure, np.linalg.LinAlgError)):
        return "failed", str(error)
    place = traceback.extract_tb(error.__traceback__)[-1]
    return "defect", f"{type(error).__name__}: {error} ({Path(place.filename).name}, line {place.lineno})"


def slope_column(number: str, key: str) -> str:
    """The column of the derivative of a number by a key."""
    return f"d {number} / d {key}"


def numbers_of(result: Result) -> dict[str, float]:
    """The numbers of a result by column: those of its summary, and of its verdict where it has one.

    A response that is highest at an end of its range, or whose peak was not found, has no peak."""
    numbers: dict[str, float | None] = {
        answer.column: answer.value for answer in answers_of(result) if answer.is_peak and answer.value is not None
    }
    numbers["peak_at_end"] = result.summary()["peak_at_end"]
    if result.wear is not None and result.wear.ended.survived:
        numbers["survives"] = 1.0
    statements = {} if result.verdict is None else result.verdict.statements
    for name, statement in statements.items():
        numbers |= {f"{name}_error": statement.error, f"{name}_stated": statement.stated}
    return {name: float(value) for name, value in numbers.items() if value is not None}
