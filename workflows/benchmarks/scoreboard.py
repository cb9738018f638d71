"""Verdicts and promises on scenes that nobody has tuned, held against a reference that is finer in every knob.

Scenes are drawn by `scoreboard_scenes`. Each is run and judged as a user gets it; then it is run with more elements,
modes, harmonics, samples, points and wear steps. A row is kept as soon as its scene is done.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np

from tribodyn.geometry import parts
from tribodyn.hbm import threads
from tribodyn.hbm.continuation.operating_point import NoPeak
from tribodyn.hbm.wear.history import WearHistory, cycles_to_preload
from tribodyn.workflows.accuracy import mesh_probe, probes, refinement, verdict
from tribodyn.workflows.accuracy.statement import QUANTITIES
from tribodyn.workflows.accuracy.time_limit import TimeUp, processor_seconds
from tribodyn.workflows.benchmarks.scoreboard_scenes import draw
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import modelling, pipeline, settings, wear_run
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.run.references import free_deflection
from tribodyn.workflows.scene.body import Geometry
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import PartScene
from tribodyn.workflows.scene.structure import Body, StructureScene

ROWS = "rows.jsonl"
ELEMENTS = 2.6  # of the reference along every edge, over those of the scene: three where that has one
OF_PROMISED = 1.75  # the same, over those that a promise was made with, which are finer already
MODES, CUTOFF = 3, 2  # times those of the scene
HARMONICS, LOWEST = 3, 5  # more than the scene's; the highest at the least
STEPS = 3  # wear steps in each of the scene
ROUNDING = 1e-8  # relative difference that says nothing
PROMISED = 7  # every so many scenes a promise is asked for too
WANTED = "20 % of peak frequency, amplitude, energy, preload"

Values = dict[str, float | None]


@dataclass(frozen=True)
class Judged:
    """One quantity of one scene: what the verdict says, and what the reference says.

    error, true : relative; stated : whether the verdict states the value
    """

    quantity: str
    value: float | None
    error: float | None
    dominated_by: str | None
    stated: bool
    reference: float | None
    true: float | None
    reason: str

    @property
    def promised(self) -> bool:
        """Whether there is a stated error and a reference to hold it against."""
        return self.stated and self.error is not None and self.true is not None

    @property
    def broken(self) -> bool:
        """Whether the true error is above the stated one."""
        return self.promised and (self.true or 0.0) > (self.error or 0.0) + ROUNDING


@dataclass(frozen=True)
class Row:
    """One scene. outcome : "measured", or what ended it; seconds : of the processor, of run, verdict and reference."""

    number: int
    seed: int
    family: str
    outcome: str
    n_pair: int
    harmonics: int
    judged: tuple[Judged, ...]
    promise: tuple[Judged, ...]
    contributions: tuple[dict[str, Any], ...]
    seconds: tuple[float, float, float]

    def record(self) -> str:
        """One line of JSON."""
        return json.dumps(asdict(self))


def row_of(line: str) -> Row:
    """A row from its line of JSON."""
    data = json.loads(line)
    for name in ("judged", "promise"):
        data[name] = tuple(Judged(**one) for one in data[name])
    data["contributions"], data["seconds"] = tuple(data["contributions"]), tuple(data["seconds"])
    return Row(**data)


def rows_in(folder: Path) -> list[Row]:
    """The rows that are kept in a folder, as many as were written whole."""
    path = folder / ROWS
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return [row_of(line) for line in lines if line.endswith("}")]


def _torn(folder: Path) -> bool:
    """Whether the last row was not written whole."""
    text = (folder / ROWS).read_text(encoding="utf-8")
    return bool(text) and not text.endswith("\n")


def run(scenes: int, seed: int, folder: Path, seconds: float, say: Callable[[str], None]) -> list[Row]:
    """Draw, run, judge and check scenes, those that `folder` holds of this seed left out; all rows of the seed.

    seconds : of the processor, that the run of a scene may take, and its reference again
    """
    folder.mkdir(parents=True, exist_ok=True)
    kept = [row for row in rows_in(folder) if row.seed == seed]
    done = {row.number for row in kept}
    for number in (n for n in range(scenes) if n not in done):
        row = measured(number, seed, seconds)
        with (folder / ROWS).open("a", encoding="utf-8") as file:
            file.write("\n" * _torn(folder) + row.record() + "\n")
        kept.append(row)
        broken = ", ".join(one.quantity for one in (*row.judged, *row.promise) if one.broken)
        spent = "/".join(f"{one:.0f}" for one in row.seconds)
        say(f"{row.family} {number}: {row.outcome}, {spent} s{f'; BROKEN: {broken}' if broken else ''}")
    return sorted((row for row in kept if row.number < scenes), key=lambda row: row.number)


def measured(number: int, seed: int, seconds: float) -> Row:
    """The row of one scene."""
    row = Row(number, seed, "", "", 0, 0, (), (), (), (0.0, 0.0, 0.0))
    with TemporaryDirectory() as place:
        folder = Path(place)
        try:
            drawn = draw(number, seed, folder)
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
        said = verdict.judge(file, model, result, Progress(), ran)
        clock = process_time()
        truth, outcome = reference(file, seconds)
        referred = process_time() - clock
        return replace(
            row,
            outcome=outcome,
            n_pair=model.balance.contact.n_pair,
            harmonics=max(result.harmonics),
            judged=tuple(_judged(name, said, truth) for name in QUANTITIES),
            promise=_promise(file, seconds) if number % PROMISED == 1 else (),
            contributions=tuple(asdict(part) for part in said.contributions),
            seconds=(ran, said.seconds, referred),
        )


def solved(file: SceneFile) -> tuple[Result, modelling.Model]:
    """The result of a scene that is not judged, and its model."""
    models: list[modelling.Model] = []

    def build(one: SceneFile) -> modelling.Model:
        models.append(modelling.build(one, None, Progress()))
        return models[-1]

    return pipeline.run(file.changed("verdict.enabled=false"), None, Progress(), build=build), models[-1]


def reference(file: SceneFile, seconds: float, elements: float = ELEMENTS) -> tuple[Values, str]:
    """What the scene says with all knobs finer, and "measured" or why there is nothing to say.

    Its peak is found by the search that wear runs begin with, which needs no points of a response. Without wear first;
    then with wear in what is left of the seconds
    """
    fine = file.changed(*finer(file, elements))
    values: Values = dict.fromkeys(QUANTITIES)
    what, end = "its reference", process_time() + seconds
    try:
        with processor_seconds(seconds), threads.limited(1):
            model = modelling.build(fine, None, Progress())
            there, _ = probes.unworn_of(fine, model)
        values |= {name: value for name, value, _ in mesh_probe.compared(there, there)}
        if fine.scene.wears:
            what = "the reference of its wear"
            with processor_seconds(end - process_time()), threads.limited(1):
                worn = _worn(fine, model)
            if worn.ended.failed:
                raise RuntimeError(str(worn.end))
            values["depth"] = float((worn.depth[-1] + worn.worn[-1]).max())
            values["life"] = cycles_to_preload(worn)
    except TimeUp:
        return values, f"{'measured, ' * (what != 'its reference')}{what} is too dear"
    except (NoPeak, ValueError, RuntimeError) as refusal:
        return values, f"{'measured, ' * (what != 'its reference')}{what} is refused: {refusal}"
    return values, "measured"


def _worn(file: SceneFile, model: modelling.Model) -> WearHistory:
    wear = file.scene.wear
    assert wear is not None
    problem = wear_run.wear_problem(file.scene, file.folder, model.balance, wear.lost_below)
    limit = settings.step_limit(file.scene, free_deflection(model.balance), problem.area)
    return wear_run.evolve(problem, wear, limit, wear.max_steps)


def finer(file: SceneFile, elements: float = ELEMENTS) -> Iterator[str]:
    """Overrides that make every knob of a scene finer."""
    scene = file.scene
    tables: dict[str, Geometry | Body] = {}
    if isinstance(scene, PartScene | StructureScene) and scene.geometry is not None:
        tables["geometry"] = scene.geometry
    elif isinstance(scene, StructureScene):
        tables = {f"bodies.{name}": body for name, body in scene.bodies.items()}
    for key, table in tables.items():
        part = parts.load(str(table.part_name))
        more = parts.rescaled(part, part.Parameters(**table.parameters), elements)
        yield from (f"{key}.{name}={count}" for name, count in more.items())
    reduction = getattr(scene, "reduction", None)
    if reduction is not None and reduction.modes is not None:
        yield f"reduction.modes={MODES * reduction.modes}"
    if reduction is not None and reduction.cutoff is not None:
        yield f"reduction.cutoff={CUTOFF * reduction.cutoff!r}"
    top = max(max(scene.harmonics.kept) + HARMONICS, LOWEST)
    yield f"harmonics.kept={list(range(top + 1))}"
    yield f"harmonics.samples={max(2 * scene.harmonics.samples, 16 * top)}"
    yield f"solver.tolerance={0.1 * scene.solver.tolerance!r}"
    wear = scene.wear
    if wear is not None:
        yield f"wear.max_steps={4 * STEPS * wear.max_steps}"
        if wear.rule == "error_controlled" and wear.tolerance is not None:
            yield f"wear.tolerance={wear.tolerance / STEPS!r}"
        elif wear.step is not None and wear.step.share is not None:
            yield f"wear.step={wear.step.share / STEPS!r}"


def _judged(name: str, said: verdict.Verdict, truth: Values) -> Judged:
    one, right = said.statements[name], truth[name]
    true = None if one.value is None or right is None else probes.relative(one.value, right)
    return Judged(name, one.value, one.error, one.dominated_by, one.stated, right, true, one.reason)


def _promise(file: SceneFile, seconds: float) -> tuple[Judged, ...]:
    """What `run --accuracy` promises of the unworn response, against a reference that is finer than its last round."""
    last: list[SceneFile] = []
    start = process_time()

    def round_of(one: SceneFile, number: int) -> Result:
        if process_time() - start > seconds:
            raise RuntimeError(f"the promise takes above {seconds:g} s")
        last.append(one)
        clock = process_time()
        result, model = solved(one)
        said = verdict.judge(one, model, result, Progress(), process_time() - clock)
        return replace(result, verdict=said.dumped())

    try:
        result, promise = refinement.to_accuracy(file, WANTED, round_of, lambda sentence: None)
    except (ValueError, RuntimeError):
        return ()
    truth, _ = reference(last[-1], seconds, OF_PROMISED)
    found = []
    for name, why in promise.reasons.items():
        value, right = refinement.loaded(result.verdict).statements[name].value, truth[name]
        true = None if value is None or right is None else probes.relative(value, right)
        found.append(Judged(name, value, promise.wanted, None, not why, right, true, why))
    return tuple(found)
