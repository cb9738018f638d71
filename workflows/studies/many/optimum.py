"""The best designs of a scene: runs of a study where they promise most, the best trades, and these solved finer."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tribodyn.workflows.result.verdict import QUANTITIES
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.scene_file import SceneError
from tribodyn.workflows.scene.source import AnyPath
from tribodyn.workflows.studies.many import study as studies
from tribodyn.workflows.studies.many import study_file, trade_picture
from tribodyn.workflows.studies.many.distributions import Marginal, si
from tribodyn.workflows.studies.many.proposal import Known, chebyshev, ends, propose
from tribodyn.workflows.studies.many.space import Space
from tribodyn.workflows.studies.many.study import Runner
from tribodyn.workflows.studies.many.study_file import LISTED, Aim, Limit, Study
from tribodyn.workflows.studies.many.table import LIFE, RUN, SENTENCE, STATUS, StudyTable

PROPOSED = "proposed.json"
FINER = "finer"
OF_VERDICT = {
    "peak_hz_first": "peak_frequency", "peak_m_first": "amplitude", "preload_N_first": "preload",
    "energy_J": "energy", "depth_max_m": "depth", "life_cycles": "life",
}  # fmt: skip


@dataclass(frozen=True)
class Checked:
    """One of the best runs, solved again with finer settings or judged by its verdict.

    values : number of an aim -> value of the run; again : value with finer settings, None where that has none
    errors : number -> relative error by the verdict, None where it is not known; empty where finer settings were given
    sentence : how the run with finer settings ended, empty where it is complete
    keeps : whether all limits are kept there too, None where not known
    """

    run: int
    role: str
    values: dict[str, float]
    again: dict[str, float | None]
    errors: dict[str, float | None]
    sentence: str
    keeps: bool | None


@dataclass(frozen=True)
class Optimum:
    """What an optimisation came to.

    table : of all runs; front : rows of the table that no other allowed one beats in all aims, by the first aim
    best : row of the one nearest to the best of every aim, each between its ends on the front; the best of one aim
    only : by aim, rows of which only a lower bound is known, such as lives that did not end
    checked : the ends of the front and `best`, again
    """

    name: str
    aims: tuple[Aim, ...]
    table: StudyTable
    front: tuple[int, ...]
    best: int
    only: dict[str, tuple[int, ...]]
    checked: tuple[Checked, ...]

    def values(self, row: int) -> dict[str, float]:
        """Values of the aims in a row of the table; lower bounds count as values."""
        return {aim.number: float(self.table.values_of(aim.number)[0][row]) for aim in self.aims}

    def keys(self, row: int) -> dict[str, Any]:
        """Values of the keys that vary in a row of the table, numbers in SI units."""
        return {key: self.table.columns[key][row] for key in self.table.varied}

    def _record(self, row: int) -> dict[str, Any]:
        least = [number for number, rows in self.only.items() if row in rows]
        return {"run": int(self.table.columns[RUN][row]), "keys": self.keys(row), **self.values(row), "at_least": least}

    def record(self) -> dict[str, Any]:
        """Plain data for machines."""
        return {
            "name": self.name,
            "aims": [aim.model_dump() for aim in self.aims],
            "runs": len(self.table.columns[RUN]),
            "complete": self.table.count("complete"),
            "best": self._record(self.best),
            "front": [self._record(row) for row in self.front],
            "checked": [vars(one) for one in self.checked],
        }

    def lines(self) -> list[str]:
        """For people."""
        wanted = ", ".join(f"{aim.number} {aim.want}" for aim in self.aims)
        said = [f"{len(self.table.columns[RUN])} runs, {self.table.count('complete')} complete; wanted: {wanted}"]
        if len(self.aims) > 1:
            said.append(f"best trades, {len(self.front)} runs that no other one beats:")
        for row in self.front:
            mark = "  <- nearest to the best of every aim" if row == self.best and len(self.front) > 1 else ""
            said.append(f"  {self._told(row)}{mark}")
        return (
            self.table.troubles() + said + [f"run {one.run}, {one.role}, again: {_again(one)}" for one in self.checked]
        )

    def _told(self, row: int) -> str:
        keys = ", ".join(f"{key} {_short(value)}" for key, value in self.keys(row).items())
        values = ", ".join(
            f"{number} {'at least ' if row in self.only[number] else ''}{value:.4g}"
            for number, value in self.values(row).items()
        )
        return f"run {self.table.columns[RUN][row]}: {values}   with {keys}"

    @property
    def files(self) -> list[Path]:
        """What it left beside the study's tables."""
        folder = self.table.folder
        return [] if folder is None else [folder / "optimum.json", folder / "optimum.png"]

    def plot(self) -> Figure:
        """The trade of the first two aims, or how the one aim got better, and where in their ranges the keys lie."""
        return trade_picture.picture(self)


def optimise(
    study: AnyPath | Mapping[str, Any],
    folder: AnyPath | None = None,
    *,
    workers: int | None = None,
    scheduler: str = "",
    resume: bool = False,
    progress: Report = None,
) -> Optimum:
    """Look for the best designs: least amplitude and longest life, or other aims, over ranges of any keys.

    study : the .toml file of a study that draws from ranges, or its tables; its table [optimise] has what is wanted
    folder : folder of optimum.json, optimum.png and the study's tables; results/NAME by default
    workers : processes; as many as there are cores by default
    scheduler : address of a scheduler of dask.distributed, or "local" for one of its own
    resume : take the runs that the folder holds already, and what was proposed, and do the others
    Raises  SceneError, ValueError: what is asked for cannot be; SolveFailed: no run keeps the limits, a lost scheduler
    """
    asked = study_file.read(study)
    runner = Runner(studies.place(asked, folder), reporter(progress), workers, scheduler, resume)
    return _search(asked, runner)


def _search(study: Study, runner: Runner) -> Optimum:
    """Runs where they promise most, until there are as many as are wanted, then the best ones again."""
    folder, resume = runner.folder, runner.resume
    wanted, space = study.optimise, _space(study)
    proposed = folder / PROPOSED
    shares = (
        [np.asarray(place, float) for place in json.loads(proposed.read_text())] if resume and proposed.exists() else []
    )
    shares = [place for place in shares if len(place) == len(space.keys)]
    first = study.settings.runs or 0
    shares = shares[: max(wanted.evaluations - first, 0)]
    table = None
    while True:
        more = [space.run_of(point) for point in space.values(np.array(shares))] if shares else []
        again = replace(runner, resume=resume or table is not None)
        table = studies.run(study, again, more=more, drawn=False, inside=True)
        known = _known(study, space, table)
        left = wanted.evaluations - len(known.share)
        if left <= 0:
            break
        if known.solved.sum() == 0:
            raise SolveFailed(f"no run has all numbers; the first: {table.columns[SENTENCE][0]}")
        shares += list(
            propose(known, lambda share: _coordinates(space, share), min(wanted.batch, left), study.settings.seed)
        )
        proposed.write_text(json.dumps([place.tolist() for place in shares]), encoding="utf-8")
        runner.progress.say(
            f"{len(known.front)} best trades of {len(known.share)} runs, {int(known.allowed.sum())} allowed"
        )
    front = known.front
    if not len(front):
        raise SolveFailed(_why_none(study, table, known))
    low, high = ends(known)
    best = int(front[chebyshev(known.aims[front], np.ones(len(wanted.aims)), low, high).argmin()])
    only = {aim.number: tuple(np.flatnonzero(table.values_of(aim.number)[1]).tolist()) for aim in wanted.aims}
    found = Optimum(study.name, wanted.aims, table, tuple(int(row) for row in front), best, only, ())
    found = replace(found, checked=_checked(study, found, known, runner))
    (folder / "optimum.json").write_text(json.dumps(found.record(), indent=2) + "\n", encoding="utf-8")
    found.plot().savefig(folder / "optimum.png")
    return found


def _space(study: Study) -> Space:
    """The space of a study whose keys have ranges; raises SceneError."""
    if study.settings.design in LISTED:
        raise SceneError(f'{study.name}: an optimisation begins with runs that are drawn, give design = "sobol"')
    if study.correlations:
        raise SceneError(f"{study.name}: correlations are of what scatters, leave them out of an optimisation")
    space = Space.of(study)
    for key, law in study.varied.items():
        assert isinstance(law, Marginal)
        if not np.isfinite(law.at(np.array([0.0, 1.0]))).all():
            raise SceneError(f"{study.name}: vary.{key}: an optimisation needs a range, give low and high")
    return space


def _coordinates(space: Space, share: np.ndarray) -> np.ndarray:
    return space.coordinates(space.values(share))


def _known(study: Study, space: Space, table: StudyTable) -> Known:
    """What the runs say of aims and limits, small values better; a number that is always positive by its logarithm."""
    wanted = study.optimise
    aims = [_column(table, aim.number) * (1.0 if aim.want == "low" else -1.0) for aim in wanted.aims]
    excess = [column for limit in wanted.limits for column in _excess(table, limit)]
    points = space.points_of(table.columns)
    share = space.shares(points)
    rows = len(table.columns[RUN])
    return Known(share, np.stack(aims, axis=1), np.array(excess).T.reshape(rows, len(excess)))


def _column(table: StudyTable, number: str) -> np.ndarray:
    values = table.values_of(number)[0]
    good = np.isfinite(values)
    return np.log(values) if good.any() and (values[good] > 0).all() else values


def _excess(table: StudyTable, limit: Limit) -> list[np.ndarray]:
    """By how much the ends of a limit are passed, over its size."""
    values = table.values_of(limit.number)[0]
    found = []
    for end, sign in ((limit.low, -1.0), (limit.high, 1.0)):
        if end is not None:
            at = si(end)
            assert at is not None
            found.append(sign * (values - at) / (abs(at) or 1.0))
    return found


def _why_none(study: Study, table: StudyTable, known: Known) -> str:
    if not known.solved.any():
        return f"no run has all numbers; the first: {table.columns[SENTENCE][0]}"
    least = known.excess[known.solved].max(axis=1).min()
    limits = ", ".join(limit.number for limit in study.optimise.limits)
    return f"no run keeps the limits of {limits}: the nearest passes one by {100 * least:.2g} % of it"


def _checked(study: Study, found: Optimum, known: Known, runner: Runner) -> tuple[Checked, ...]:
    """The best runs with finer settings, or with their verdicts."""
    wanted = study.optimise
    roles: dict[int, str] = {}
    for i, aim in enumerate(wanted.aims):
        roles[int(found.front[int(known.aims[list(found.front), i].argmin())])] = f"best {aim.number}"
    roles[found.best] = "nearest to the best of every aim" if len(wanted.aims) > 1 else f"best {wanted.aims[0].number}"
    rows, keys = list(roles), list(study.varied)
    settings = study.settings.model_copy(
        update={
            "design": "list",
            "runs": None,
            "verdict": not wanted.finer,
            "set": (*study.settings.set, *wanted.finer),
        }
    )
    varied = {key: tuple(float(found.table.columns[key][row]) for row in rows) for key in keys}
    runner.progress.say(f"{len(rows)} of the best runs again, {'finer' if wanted.finer else 'with their verdicts'}")
    again_study = replace(study, settings=settings, varied=varied)
    table = studies.run(again_study, runner.below(FINER), drawn=False, inside=True)
    checked = []
    for i, row in enumerate(rows):
        again, errors = {}, {}
        for number in found.values(row):
            value = table.values_of(number)[0][i] if _has(table, number) else np.nan
            again[number] = float(value) if np.isfinite(value) else None
            if not wanted.finer:
                errors[number] = _error(table, number, i)
        excess = [column[i] for limit in wanted.limits if _has(table, limit.number) for column in _excess(table, limit)]
        known_all = all(_has(table, limit.number) for limit in wanted.limits) and bool(np.isfinite(excess).all())
        keeps = bool(np.max(excess, initial=-1.0) <= 0) if known_all else None
        told = str(table.columns[SENTENCE][i]) if table.columns[STATUS][i] != "complete" else ""
        run_number = int(found.table.columns[RUN][row])
        checked.append(Checked(run_number, roles[row], found.values(row), again, errors, told, keeps))
    return tuple(checked)


def _has(table: StudyTable, number: str) -> bool:
    return number in table.columns or (number == LIFE and "cycles" in table.columns)


def _error(table: StudyTable, number: str, row: int) -> float | None:
    quantity = OF_VERDICT.get(number)
    column = table.columns.get(f"{quantity}_error") if quantity in QUANTITIES else None
    return float(column[row]) if column is not None and np.isfinite(column[row]) else None


def _again(one: Checked) -> str:
    if one.sentence:
        return one.sentence
    said = []
    for number, value in one.values.items():
        again = one.again[number]
        text = f"{number} not known" if again is None else f"{number} {again:.4g} ({100 * (again / value - 1):+.2g} %)"
        if number in one.errors:
            error = one.errors[number]
            text += ", error not known" if error is None else f", error {100 * error:.2g} % by its verdict"
        said.append(text)
    limits = {True: "", False: "; a limit is passed", None: "; limits not known"}[one.keeps]
    return ", ".join(said) + limits


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, (float, np.floating)) else str(value)
