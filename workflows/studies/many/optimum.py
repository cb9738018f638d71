"""The best designs of a scene: runs of a study where they promise most, and the best trades between aims under limits.

Every aim and every limit has a Gaussian process of its own, through its values and derivatives at the runs. Of several
aims one is made by the augmented Chebyshev function with weights: the largest weighted aim, each between its ends
along the trade, and a small share of their sum, are made small. A run promises what of this it is expected to improve
on the best allowed one. Most of it, for a t that none of these passes, with all limits kept, is a problem of nonlinear
programming; sequential quadratic programming solves it on the processes, from the best of 256 places.
Source  SLSQP of SciPy: Kraft 1988; weights: Knowles 2006, doi 10.1109/TEVC.2005.851274; a process for every aim:
    Daulton, Balandat and Bakshy 2020
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import minimize
from scipy.special import erfcx
from scipy.stats import qmc

from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.scene_file import SceneError
from tribodyn.workflows.scene.source import AnyPath
from tribodyn.workflows.studies.many import study_file, study_pictures, study_runs as studies
from tribodyn.workflows.studies.many.distributions import Marginal, si
from tribodyn.workflows.studies.many.parameter_space import ParameterSpace
from tribodyn.workflows.studies.many.run_task import RUN
from tribodyn.workflows.studies.many.study_file import LISTED, Aim, ParameterStudy
from tribodyn.workflows.studies.many.study_runs import Runner
from tribodyn.workflows.studies.many.study_table import SENTENCE, StudyTable
from tribodyn.workflows.studies.many.surrogate import FEWEST, Surrogate
from tribodyn.workflows.studies.study_result import StudyResult

GAIN = 1e-3  # of an aim, of its logarithm where it is positive and of its range else, that one run more is worth
MISSED = 1e3  # what a limit that is passed counts beside the aims
AUGMENTED = 0.05  # share of the sum of aims beside the largest: Knowles 2006
SAME_POINT = 1e-3  # of the unit cube, within which a proposal is a run that is there already


@dataclass(frozen=True, repr=False)
class Optimum(StudyResult):
    """What an optimisation came to.

    table : of all runs; front : rows of the table that no other allowed one beats in all aims, by the first aim
    best : row of the one nearest to the best of every aim, each between its ends on the front; the best of one aim
    bounded : by aim, rows of which only a lower bound is known, such as lives that did not end
    """

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
        """Plain data for machines."""
        return {
            "name": self.name,
            "aims": [aim.model_dump() for aim in self.aims],
            "runs": len(self.table.columns[RUN]),
            "complete": self.table.count("complete"),
            "best": self._record(self.best),
            "front": [self._record(row) for row in self.front],
        }

    def lines(self) -> list[str]:
        """For people."""
        aims_text = ", ".join(f"{aim.number} {aim.want}" for aim in self.aims)
        texts = [f"{len(self.table.columns[RUN])} runs, {self.table.count('complete')} complete; wanted: {aims_text}"]
        if len(self.aims) > 1:
            texts.append(f"best trades, {len(self.front)} runs that no other one beats:")
        for row in self.front:
            mark = "  <- nearest to the best of every aim" if row == self.best and len(self.front) > 1 else ""
            texts.append(f"  {self._describe(row)}{mark}")
        return self.table.troubles() + texts

    def _describe(self, row: int) -> str:
        keys = ", ".join(f"{key} {_short(value)}" for key, value in self.keys(row).items())
        values = ", ".join(
            f"{number} {'at least ' if row in self.bounded[number] else ''}{value:.4g}"
            for number, value in self.values(row).items()
        )
        return f"run {self.table.columns[RUN][row]}: {values}   with {keys}"

    @property
    def defects(self) -> list[str]:
        """Runs that a defect of the program stopped."""
        return self.table.defects

    @property
    def files(self) -> list[Path]:
        """What it left beside the study's tables."""
        folder = self.table.folder
        return [] if folder is None else [folder / "optimum.json", folder / "optimum.png"]

    def plot(self) -> Figure:
        """The trade of the first two aims, or how the one aim got better."""
        return study_pictures.picture(self)


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
    plan = study_file.read(study)
    runner = Runner(studies.place(plan, folder), reporter(progress), workers, scheduler, resume)
    return _search(plan, runner)


def _search(study: ParameterStudy, runner: Runner) -> Optimum:
    """Runs where they promise most, until nothing is to be gained or there are as many as may be."""
    optimise_settings, space = study.optimise, _space(study)
    study = replace(study, settings=study.settings.model_copy(update={"derivatives": True}))
    proposals: list[dict[str, float]] = []
    while True:
        table = studies.run(
            study, replace(runner, resume=runner.resume or bool(proposals)), added=proposals, drawn=False, inside=True
        )
        evaluated = _evaluate(study, space, table)
        if not evaluated.solved.any():
            raise SolveFailed(f"no run has all numbers; the first: {table.columns[SENTENCE][0]}")
        if len(evaluated.share) >= optimise_settings.evaluations:
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
        limits = ", ".join(limit.number for limit in optimise_settings.limits)
        raise SolveFailed(f"no run keeps the limits of {limits}: the nearest passes one by {100 * least:.2g} % of it")
    low, high = ends(evaluated)
    best = int(front[chebyshev(evaluated.aims[front], np.ones(len(optimise_settings.aims)), low, high).argmin()])
    bounded = {
        aim.number: tuple(np.flatnonzero(table.values_of(aim.number)[1]).tolist()) for aim in optimise_settings.aims
    }
    optimum = Optimum(study.name, optimise_settings.aims, table, tuple(int(row) for row in front), best, bounded)
    (runner.folder / "optimum.json").write_text(json.dumps(optimum.record(), indent=2) + "\n", encoding="utf-8")
    optimum.plot().savefig(runner.folder / "optimum.png")
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
            if end is not None:
                at = si(end)
                assert at is not None
                size = sign / (abs(at) or 1.0)
                columns.append((size * (values - at), size * slopes))
    numbers, by = (np.stack(each, axis=1) for each in zip(*columns, strict=True))
    m = len(settings.aims)
    return EvaluatedRuns(space.shares(space.points_of(table.columns)), numbers[:, :m], numbers[:, m:], by)


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, (float, np.floating)) else str(value)


@dataclass(frozen=True)
class EvaluatedRuns:
    """What runs have told.

    share : (n, k) places of the runs in the unit cube
    aims : (n, m) values to be made small; excess : (n, q) by which limits are passed, below 0 where they are kept.
        A run that failed has nan in both
    slopes : (n, m + q, k) derivatives of both by coordinates, nan where they are not known
    """

    share: np.ndarray
    aims: np.ndarray
    excess: np.ndarray
    slopes: np.ndarray

    @property
    def solved(self) -> np.ndarray:
        """(n,) whether a run has all numbers."""
        return np.isfinite(self.aims).all(axis=1) & np.isfinite(self.excess).all(axis=1)

    @property
    def allowed(self) -> np.ndarray:
        """(n,) whether a run keeps all limits."""
        return self.solved & (self.excess <= 0).all(axis=1)

    @property
    def front(self) -> np.ndarray:
        """Numbers of the allowed runs that no other one is as good as in all aims and better in one."""
        return best_trades(self.aims, self.allowed)


def best_trades(aims: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Numbers of the allowed rows of aims (n, m) that no other one beats, by the first aim (Pareto front)."""
    rows = np.flatnonzero(allowed)
    no_better = np.all(aims[rows, None] >= aims[None, rows], axis=2)  # row i against all others
    worse = np.any(aims[rows, None] > aims[None, rows], axis=2)
    front = rows[~(no_better & worse).any(axis=1)]
    return front[np.lexsort(aims[front].T[::-1])]


def weighed(aims: np.ndarray, weights: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Weighted aims (..., m), between low (m,), 0, and high (m,), 1, and a share of their sum; none without weight."""
    scaled = (weights * (aims - low) / (high - low))[..., weights > 0]
    return np.asarray(scaled + AUGMENTED * scaled.sum(axis=-1, keepdims=True))


def chebyshev(aims: np.ndarray, weights: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The augmented Chebyshev function (...) of aims, see above."""
    return np.asarray(weighed(aims, weights, low, high).max(axis=-1))


def ends(evaluated: EvaluatedRuns) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest values (m,) of the aims along the best trades, of all runs where these are fewer than two."""
    front = evaluated.front
    aims = evaluated.aims[front if len(front) > 1 else evaluated.solved]
    low, high = aims.min(axis=0), aims.max(axis=0)
    return low, np.where(high > low, high, low + 1.0)


def propose(evaluated: EvaluatedRuns, scale: Callable[[np.ndarray], np.ndarray], seed: int) -> tuple[np.ndarray, float]:
    """A place (k,) in the unit cube for the run that promises most; the same runs and seed propose the same.

    scale : places (n, k) -> coordinates (n, k) that surrogates are fitted in
    Returns the place and the improvement of the one aim expected there, inf of several aims, where no run is allowed,
        and where few runs without derivatives are solved: then it lies far from all others. A second aim is weighed
        anew for every run
    """
    share, m = evaluated.share, evaluated.aims.shape[1]
    draw = np.random.default_rng([seed, len(share)])
    columns, solved = np.concatenate([evaluated.aims, evaluated.excess], axis=1), evaluated.solved
    places = qmc.Sobol(share.shape[1], seed=draw).random_base2(8)
    emptiest = places[np.abs(places[:, None] - share).max(axis=2).min(axis=1).argmax()]
    if not solved.any() or (solved.sum() < FEWEST and not np.isfinite(evaluated.slopes[solved]).any()):
        return emptiest, np.inf
    surrogates = [_fitted(scale(share), column, evaluated.slopes[:, i], solved) for i, column in enumerate(columns.T)]
    low, high = ends(evaluated)
    turn = len(share) % (3 * m)  # the ends of the trade in their turns
    weights = np.eye(m)[turn] if turn < m and m > 1 else draw.dirichlet(np.ones(m))
    least = (
        float(chebyshev(evaluated.aims[evaluated.allowed], weights, low, high).min())
        if evaluated.allowed.any()
        else np.inf
    )

    def expected(places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Aims (n, m) at places (n, k), deviation (n,) of what is made of them, excess (n, q) a deviation higher."""
        at = scale(np.clip(places, 0.0, 1.0))
        mean, deviation = np.stack([surrogate.mean_and_deviation(at) for surrogate in surrogates], axis=-1)
        return mean[:, :m], chebyshev(deviation[:, :m], weights, np.zeros(m), high - low), (mean + deviation)[:, m:]

    def worth(places: np.ndarray, least: float) -> np.ndarray:
        aims, deviation, excess = expected(places)
        excess_sum = np.maximum(excess, 0).max(axis=1, initial=0.0)
        return promised(least, chebyshev(aims, weights, low, high), deviation) - MISSED * excess_sum

    def margins(z: np.ndarray) -> np.ndarray:
        aims, _, excess = (each[0] for each in expected(z[None, 1:]))
        return np.concatenate([z[0] - weighed(aims, weights, low, high), -excess])

    def climbed(start: np.ndarray) -> np.ndarray:
        solution = minimize(
            lambda z: -promised(least, z[0], expected(z[None, 1:])[1])[0],
            [chebyshev(expected(start[None])[0], weights, low, high)[0], *start], method="SLSQP",
            bounds=[(None, None), *[(0.0, 1.0)] * len(start)], constraints={"type": "ineq", "fun": margins},
        )  # fmt: skip
        return np.clip(solution.x[1:], 0.0, 1.0)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # steps beyond the bounds
        places = np.vstack([share[evaluated.front], places])
        starts = [places[worth(places, threshold).argmax()] for threshold in (least, np.inf)]
        places = np.vstack([*starts, *map(climbed, starts)])
        promise = worth(places, least)
    at, gain = places[promise.argmax()], float(np.exp(promise.max()) * (high - low)[0] / (1 + AUGMENTED))
    if np.abs(share - at).max(axis=1).min() < SAME_POINT:
        return (at, 0.0) if m == 1 else (emptiest, np.inf)
    return at, gain if m == 1 and np.isfinite(least) else np.inf


def promised(least: float, value: np.ndarray | float, deviation: np.ndarray) -> np.ndarray:
    """Logarithm of what a normal number lies below `least` by, 0 where it does not, on average; -value without least.

    Source  expected improvement: Jones, Schonlau and Welch 1998, doi 10.1023/A:1008306431147, eq. 15; its logarithm
        far below: Ament et al. 2023
    """
    if not np.isfinite(least):
        return -np.broadcast_to(value, deviation.shape)
    deviation = np.maximum(deviation, np.finfo(float).tiny)
    z = (least - value) / deviation
    distance = -np.minimum(np.abs(z), 1e6)  # beyond it all is rounding
    tail = (
        -(distance**2) / 2
        - np.log(2 * np.pi) / 2
        + np.log1p(distance * np.sqrt(np.pi / 2) * erfcx(-distance / np.sqrt(2)))
    )
    return np.asarray(np.log(deviation) + np.where(z > 0, np.log(np.where(z > 0, z, 1.0) + np.exp(tail)), tail))


def _fitted(points: np.ndarray, column: np.ndarray, slopes: np.ndarray, solved: np.ndarray) -> Surrogate:
    """A process through the runs that are solved; one that failed counts as worse than expected there by a deviation.

    Source  Forrester, Sobester and Keane 2006, doi 10.1098/rspa.2005.1608
    """
    surrogate = Surrogate.fitted(points[solved], column[solved], slopes[solved], is_small=True)
    for point in points[~solved]:
        mean, deviation = surrogate.mean_and_deviation(point[None])
        surrogate = surrogate.with_run(point, float(mean[0] + deviation[0]))
    return surrogate
