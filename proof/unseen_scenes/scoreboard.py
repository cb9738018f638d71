"""Stated errors and error bounds on unseen scenes, compared with a reference that is finer in every setting.

Scenes are drawn by `scoreboard_scenes`. Each is run and judged as a user gets it; then it is run with more elements,
modes, harmonics, samples, points and wear steps. A row is kept as soon as its scene is done."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np

from proof import reference
from proof.time_limit import TimeUp, processor_seconds
from proof.unseen_scenes.scoreboard_scenes import draw
from tribodyn.hbm.quantity import names_with_error
from tribodyn.refusal import SolverFailure
from tribodyn.workflows.errors import accuracy, judgement
from tribodyn.workflows.errors.operating_states import relative_change
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.verdict import Verdict
from tribodyn.workflows.run import modelling, pipeline
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile

ROWS = "rows.jsonl"
ROUNDING = 1e-8  # relative difference that says nothing
BOUNDED = 14  # every so many scenes an error bound is asked for too
ACCURACY = "20 % of peak frequency, amplitude, energy, preload"


@dataclass(frozen=True)
class Judged:
    """One quantity of one scene: what the verdict says, and what the reference says.

    error, true : relative; stated : whether the verdict states the value"""

    quantity: str
    value: float | None
    error: float | None
    dominated_by: str | None
    stated: bool
    reference: float | None
    true: float | None
    reason: str

    @property
    def counted(self) -> bool:
        """Whether there is a stated error and a reference to hold it against; not where the scene gives the number."""
        is_comparable = self.stated and self.error is not None and self.true is not None
        return is_comparable and max(self.error or 0.0, self.true or 0.0) > ROUNDING

    @property
    def violated(self) -> bool:
        """Whether the true error is above the stated one."""
        return self.counted and (self.true or 0.0) > (self.error or 0.0) + ROUNDING


@dataclass(frozen=True)
class Row:
    """One scene.

    outcome : "measured", or what ended it; seconds : of the processor, of run, verdict and reference
    kind : that it was drawn as, see `scoreboard_scenes.KINDS`"""

    number: int
    seed: int
    family: str
    outcome: str
    n_pair: int
    harmonics: int
    judged: tuple[Judged, ...]
    bound: tuple[Judged, ...]
    changes: tuple[dict[str, Any], ...]
    seconds: tuple[float, float, float]
    ratio: float | None = None
    kind: str = "parts"

    def record(self) -> str:
        """One line of JSON."""
        return json.dumps(asdict(self))


def row_of(line: str) -> Row:
    """A row from its line of JSON."""
    data = json.loads(line)
    for name in ("judged", "bound"):
        data[name] = tuple(Judged(**record) for record in data[name])
    data["changes"], data["seconds"] = tuple(data["changes"]), tuple(data["seconds"])
    return Row(**data)


def rows_in(folder: Path) -> list[Row]:
    """The rows that are kept in a folder, as many as were written whole."""
    path = folder / ROWS
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return [row_of(line) for line in lines if line.endswith("}")]


def run(
    scenes: int, seed: int, folder: Path, seconds: float, say: Callable[[str], None], kind: str = "parts"
) -> list[Row]:
    """Draw, run, judge and check scenes, those that `folder` holds of this seed left out; all rows of the seed.

    scenes : how many; 0: none, only what `folder` holds
    seconds : of the processor, that the run of a scene may take, and its reference again
    kind : of scenes, see `scoreboard_scenes.KINDS`; an error bound is asked for of some parts"""
    folder.mkdir(parents=True, exist_ok=True)
    rows = [row for row in rows_in(folder) if (row.seed, row.kind) == (seed, kind)]
    done = {row.number for row in rows}
    for number in (n for n in range(scenes) if n not in done):
        row = measured(number, seed, seconds, kind)
        with (folder / ROWS).open("a", encoding="utf-8") as file:
            file.write("\n" + row.record() + "\n")  # the last one may not have been written whole
        rows.append(row)
        violated = ", ".join(entry.quantity for entry in (*row.judged, *row.bound) if entry.violated)
        spent = "/".join(f"{entry:.0f}" for entry in row.seconds)
        say(f"{row.family} {number}: {row.outcome}, {spent} s{f'; VIOLATED: {violated}' if violated else ''}")
    return sorted((row for row in rows if not scenes or row.number < scenes), key=lambda row: row.number)


def measured(number: int, seed: int, seconds: float, kind: str = "parts") -> Row:
    """The row of one scene."""
    row = Row(number, seed, "", "", 0, 0, (), (), (), (0.0, 0.0, 0.0), kind=kind)
    with TemporaryDirectory() as place:
        folder = Path(place)
        try:
            drawn = draw(number, seed, folder, kind)
        except (ValueError, RuntimeError, np.linalg.LinAlgError) as refusal:
            return replace(row, outcome=f"not drawn: {refusal}")
        row = replace(row, family=drawn.family)
        file, clock = drawn.file(folder), process_time()
        try:
            with processor_seconds(seconds):
                result, model = solved(file)
        except TimeUp:
            return replace(row, outcome=f"its run takes above {seconds:g} s", seconds=(seconds, 0.0, 0.0))
        except (ValueError, RuntimeError) as refusal:
            return replace(row, outcome=f"refused: {refusal}", seconds=(process_time() - clock, 0.0, 0.0))
        ran = process_time() - clock
        stated = judgement.judge(file, model, result, Progress())
        clock = process_time()
        truth, outcome = reference.solved(file, seconds)
        referred = process_time() - clock
        return replace(
            row,
            outcome=outcome,
            n_pair=model.balance.contact.n_pair,
            harmonics=max(result.harmonics),
            judged=tuple(_judged(name, stated, truth) for name in names_with_error() if name in stated.statements),
            bound=_bound(file, seconds) if number % BOUNDED == 1 and kind == "parts" else (),
            changes=tuple(asdict(change) for change in stated.changes),
            ratio=stated.ratio,
            seconds=(ran, stated.seconds, referred),
        )


def solved(file: SceneFile) -> tuple[Result, modelling.Model]:
    """The result of a scene that is not judged, and its model."""
    result = pipeline.run(file.changed("verdict.enabled=false"), None, Progress())
    return result, modelling.build(file, Progress(), result.harmonics)


def _judged(name: str, judgement: Verdict, truth: reference.Values) -> Judged:
    statement, right = judgement.statements[name], truth[name]
    true = None if statement.value is None or right is None else relative_change(statement.value, right)
    return Judged(
        name, statement.value, statement.error, statement.dominated_by, statement.stated, right, true, statement.reason
    )


def _bound(file: SceneFile, seconds: float) -> tuple[Judged, ...]:
    """What `run --accuracy` bounds of the unworn response, against a reference that is finer than its last round."""
    start = process_time()

    def round_of(scene_file: SceneFile, number: int) -> Result:
        if process_time() - start > seconds:
            raise SolverFailure(f"the bound takes above {seconds:g} s")
        result, model = solved(scene_file)
        return judgement.with_verdict(scene_file, model, result, Progress())

    try:
        result, bound = accuracy.to_accuracy(file, ACCURACY, round_of, lambda sentence: None)
    except (ValueError, RuntimeError):
        return ()
    truth, _ = reference.solved(file.changed("wear=", *bound.overrides), seconds, reference.FINER.refined_elements)
    stated = result.verdict
    assert stated is not None
    names = [name for name, reason in bound.reasons.items() if not reason]
    return tuple(replace(_judged(name, stated, truth), error=bound.request.error) for name in names)
