"""The best designs of a scene: runs of a study where they promise most, and the best trades between aims under limits.

Every aim and every limit has a Gaussian process of its own, through its values and derivatives at the runs. Of several
aims one is made by the augmented Chebyshev function with weights: the largest weighted aim, each between its ends
along the trade, and a small share of their sum, are made small. A run promises what of this it is expected to improve
on the best allowed one. Most of it, for a t that none of these passes, with all limits kept, is a problem of nonlinear
programming; sequential quadratic programming solves it on the processes, from the best of 256 places.
Source  SLSQP of SciPy: Kraft 1988; weights: Knowles 2006, doi 10.1109/TEVC.2005.851274; a process for every aim:
    Daulton, Balandat and Bakshy 2020"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from tribodyn.output_file import write_text
from tribodyn.refusal import SolveFailed
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.scene_file import AnyPath, SceneError
from tribodyn.workflows.studies.files import write_picture
from tribodyn.workflows.studies.many import study_file, study_pictures, study_runs as studies
from tribodyn.workflows.studies.many.distributions import Marginal, si
from tribodyn.workflows.studies.many.parameter_space import ParameterSpace
from tribodyn.workflows.studies.many.proposals import EvaluatedRuns, chebyshev, ends, propose
from tribodyn.workflows.studies.many.run_task import RUN
from tribodyn.workflows.studies.many.study_file import LISTED, Aim, ParameterStudy
from tribodyn.workflows.studies.many.study_runs import Runner
from tribodyn.workflows.studies.many.study_table import SENTENCE, RunsResult, StudyTable

GAIN = 1e-3  # of an aim, of its logarithm where it is positive and of its range else, that one run more is worth


@dataclass(frozen=True, repr=False)
class Optimum(RunsResult):
    """Result of an optimisation.

    table : of all runs; front : rows of the table that no other allowed one beats in all aims, by the first aim
    best : row of the one nearest to the best of every aim, each between its ends on the front; the best of one aim
    bounded : by aim, rows of which only a lower bound is known, such as lives that did not end"""

    STEM: ClassVar[str] = "optimum"

    name: str
    aims: tuple[Aim, ...]
    table: StudyTable
    front: tuple[int, ...]
    best: int
    bounded: dict[str, tuple[int, ...]]

    def values(self, row: int) -> dict[str, float]:
        """Values of the aims in a row of the table; lower bounds count as values."""
        return {aim.number: float(self.table.values_of(aim.number)[0][row]) for aim in self.aims}

    def keys(self, row: int) -> dict[str, Any]:
        """Values of the keys that vary in a row of the table, numbers in SI units."""
        return {key: self.table.columns[key][row] for key in self.table.varied}

    def _record(self, row: int) -> dict[str, Any]:
        least = [number for number, rows in self.bounded.items() if row in rows]
        return {"run": int(self.table.columns[RUN][row]), "keys": self.keys(row), **self.values(row), "at_least": least}

    def record(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "aims": [aim.model_dump() for aim in self.aims],
            "runs": len(self.table.columns[RUN]),
            "complete": self.table.count("complete"),
            "best": self._record(self.best),
            "front": [self._record(row) for row in self.front],
        }

    def lines(self) -> list[str]:
        aims_text = ", ".join(f"{aim.number} {aim.want}" for aim in self.aims)
        texts = [f"{len(self.table.columns[RUN])} runs, {self.table.count('complete')} complete; wanted: {aims_text}"]
        if len(self.aims) > 1:
            texts.append(f"best trades, {len(self.front)} runs that no other one beats:")
        for row in self.front:
            mark = "  <- nearest to the best of every aim" if row == self.best and len(self.front) > 1 else ""
            texts.append(f"  {self._describe(row)}{mark}")
        return self.table.troubles() + texts

    def _describe(self, row: int) -> str:
        at = self.keys(row).items()
        keys = ", ".join(f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}" for key, value in at)
        values = ", ".join(
            f"{number} {'at least ' if row in self.bounded[number] else ''}{value:.4g}"
            for number, value in self.values(row).items()
        )
        return f"run {self.table.columns[RUN][row]}: {values}   with {keys}"

    def plot(self) -> Figure:
        """The trade of the first two aims, or how the one aim got better."""
        return study_pictures.picture(self)


def optimise(
    study: AnyPath | Mapping[str, Any],
    folder: AnyPath | None = None,
    *,
    workers: int | None = None,
    scheduler: str = "",
    fresh: bool = False,
    progress: Report = None,
) -> Optimum:
    """Search for the best designs: least amplitude and longest life, or other aims, over ranges of any keys.

    study : the .toml file of a study that draws from ranges, or its tables; its table [optimise] has what is wanted
    folder : folder of optimum.json, optimum.png and the study's tables; results/NAME by default
    workers : processes; as many as there are cores by default
    scheduler : address of a scheduler of dask.distributed, or "local": processes here
    fresh : do again the runs that the folder holds already, and what was proposed
    Raises  Refusal: what is asked for cannot be; SolveFailed: no run keeps the limits, a lost scheduler"""
    plan = study_file.read(study)
    runner = Runner(studies.place(plan, folder), reporter(progress), workers, scheduler, fresh)
    return _search(plan, runner)


def _search(study: ParameterStudy, runner: Runner) -> Optimum:
    """Runs where they promise most, until nothing is to be gained or there are as many as may be."""
    settings, space = study.optimise, _space(study)
    study = replace(study, settings=study.settings.model_copy(update={"derivatives": True}))
    proposals: list[dict[str, float]] = []
    while True:
        runner = replace(runner, fresh=runner.fresh and not proposals)
        table = studies.run(study, runner, added=proposals, drawn=False, inside=True)
        evaluated = _evaluate(study, space, table)
        if not evaluated.solved.any():
            raise SolveFailed(f"no run has all numbers; the first: {table.columns[SENTENCE][0]}")
        if len(evaluated.share) >= settings.evaluations:
            break
        place, gain = propose(evaluated, lambda share: space.coordinates(space.values(share)), study.settings.seed)
        if gain < GAIN:
            break
        proposals.append(space.run_of(space.values(place[None])[0]))
        runner.progress.say(
            f"{len(evaluated.front)} best trades of {len(evaluated.share)} runs, {int(evaluated.allowed.sum())} allowed"
        )
    front = evaluated.front
    if not len(front):
        least = evaluated.excess[evaluated.solved].max(axis=1).min()
        limits = ", ".join(limit.number for limit in settings.limits)
        raise SolveFailed(f"no run keeps the limits of {limits}: the nearest passes one by {100 * least:.2g} % of it")
    low, high = ends(evaluated)
    best = int(front[chebyshev(evaluated.aims[front], np.ones(len(settings.aims)), low, high).argmin()])
    bounded = {aim.number: tuple(np.flatnonzero(table.values_of(aim.number)[1]).tolist()) for aim in settings.aims}
    optimum = Optimum(study.name, settings.aims, table, tuple(int(row) for row in front), best, bounded)
    write_text(runner.folder / "optimum.json", json.dumps(optimum.record(), indent=2) + "\n")
    write_picture(optimum.plot, runner.folder / "optimum.png")
    return optimum


def _space(study: ParameterStudy) -> ParameterSpace:
    """The space of a study whose keys have ranges; raises SceneError."""
    if study.settings.design in LISTED:
        raise SceneError(f'{study.name}: an optimisation begins with runs that are drawn, give design = "sobol"')
    if study.correlations:
        raise SceneError(f"{study.name}: correlations are of what scatters, leave them out of an optimisation")
    space = ParameterSpace.of(study)
    for key, law in study.varied.items():
        assert isinstance(law, Marginal)
        if not np.isfinite(law.at(np.array([0.0, 1.0]))).all():
            raise SceneError(f"{study.name}: vary.{key}: an optimisation needs a range, give low and high")
    return space


def _evaluate(study: ParameterStudy, space: ParameterSpace, table: StudyTable) -> EvaluatedRuns:
    """What the runs say of aims and limits, small values better; a number that is always positive by its logarithm."""
    settings, columns = study.optimise, []
    for aim in settings.aims:
        values, slopes = table.values_of(aim.number)[0], space.slopes_of(table.columns, aim.number)
        good = np.isfinite(values)
        if good.any() and (values[good] > 0).all():
            values, slopes = np.log(values), slopes / values[:, None]
        elif good.any():
            size = float(np.ptp(values[good])) or 1.0
            values, slopes = values / size, slopes / size
        sign = 1.0 if aim.want == "low" else -1.0
        columns.append((sign * values, sign * slopes))
    for limit in settings.limits:
        values, slopes = table.values_of(limit.number)[0], space.slopes_of(table.columns, limit.number)
        for end, sign in ((limit.low, -1.0), (limit.high, 1.0)):
            if (at := si(end)) is not None:
                size = sign / (abs(at) or 1.0)
                columns.append((size * (values - at), size * slopes))
    numbers, by = (np.stack(each, axis=1) for each in zip(*columns, strict=True))
    m = len(settings.aims)
    return EvaluatedRuns(space.shares(space.points_of(table.columns)), numbers[:, :m], numbers[:, m:], by)
