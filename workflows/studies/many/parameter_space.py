"""The space of what varies in a study: its runs, points drawn from it, and coordinates that a surrogate is fit in."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats
from scipy.stats import qmc

from tribodyn.workflows.scene.scene_file import SceneError
from tribodyn.workflows.studies.many.distributions import Marginal
from tribodyn.workflows.studies.many.run_task import slope_column
from tribodyn.workflows.studies.many.study_file import ParameterStudy

MOST_RUNS = 1_000_000
INSIDE = 1e-12  # shares stay this far from 0 and 1, where a quantile may be infinite


@dataclass(frozen=True)
class ParameterSpace:
    """What varies, in SI units.

    study : every key of which varies by a distribution
    ratios : keys whose coordinates are logarithms whatever their distributions"""

    study: ParameterStudy
    ratios: tuple[str, ...] = ()

    @classmethod
    def of(cls, study: ParameterStudy) -> ParameterSpace:
        """The space of a study; raises SceneError for a key that varies over a list."""
        for key, law in study.varied.items():
            if not isinstance(law, Marginal):
                raise SceneError(f"{study.name}: vary.{key}: expected a distribution, this has a list of values")
        return cls(study)

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys that vary."""
        return tuple(self.study.varied)

    def draw(self, exponent: int, seed: int = 0, wide: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """2**exponent scrambled Sobol points of the joint distribution, and their weights, which sum to 1.

        wide : factor on the standard normal variables behind the points, above 1 for rare values
        Returns values (n, k) in SI units, weights (n,)
        Source  importance sampling with a scaled normal density: Bucher 1988, doi 10.1016/0167-4730(88)90020-3"""
        k = len(self.keys)
        share = np.clip(qmc.Sobol(k, seed=np.random.default_rng(seed)).random_base2(exponent), 1e-12, 1 - 1e-12)
        normal = stats.norm.ppf(share)
        weight = np.exp(0.5 * (1 - wide**2) * np.sum(normal**2, axis=1))
        return self.values(stats.norm.cdf(wide * normal)), weight / weight.sum()

    def values(self, share: np.ndarray) -> np.ndarray:
        """Values (n, k) in SI units of points (n, k) of the unit cube, correlated as the study says."""
        inside = np.clip(share, INSIDE, 1 - INSIDE)
        share = correlated(self.study, inside)
        return np.stack([self._law(key).at(share[:, i]) for i, key in enumerate(self.keys)], axis=1)

    def shares(self, values: np.ndarray) -> np.ndarray:
        """Points (n, k) of the unit cube that have values (n, k) where nothing is correlated."""
        return np.stack([self._law(key).share(values[:, i]) for i, key in enumerate(self.keys)], axis=1)

    def coordinates(self, values: np.ndarray) -> np.ndarray:
        """Values (n, k) in widths of their distributions from their medians; those of a lognormal one in logarithms."""
        middle = self._scaled(np.stack([self._law(key).at(np.array([0.5])) for key in self.keys], axis=1))
        return (self._scaled(values) - middle) / self.widths

    @property
    def widths(self) -> np.ndarray:
        """(k,) what a coordinate is counted in: half the width of the middle 68 % of its distribution."""
        low, high = self._scaled(np.stack([self._law(key).at(np.array([0.16, 0.84])) for key in self.keys], axis=1))
        return np.asarray(0.5 * (high - low))

    def _scaled(self, values: np.ndarray) -> np.ndarray:
        return np.where(self._logarithmic, np.log(np.where(self._logarithmic, values, 1.0)), values)

    @property
    def _logarithmic(self) -> np.ndarray:
        return np.array([self._law(key).logarithmic or key in self.ratios for key in self.keys])

    def slopes_of(self, columns: Mapping[str, np.ndarray], number: str) -> np.ndarray:
        """(n, k) derivatives of a number of the runs by the coordinates, nan where a table has none."""
        none = np.full(len(next(iter(columns.values()))), np.nan)
        by_key = []
        for key in self.keys:
            keys = [key, *(copy for copy, original in self.study.settings.same.items() if original == key)]
            by_key.append(sum(np.asarray(columns.get(slope_column(number, name), none), float) for name in keys))
        values = self.points_of(columns)
        return np.stack(by_key, axis=1) * self.widths * np.where(self._logarithmic, values, 1.0)

    def run_of(self, point: np.ndarray) -> dict[str, float]:
        """The values of a run at a point (k,)."""
        return {key: float(value) for key, value in zip(self.keys, point, strict=True)}

    def points_of(self, columns: Mapping[str, np.ndarray]) -> np.ndarray:
        """Values (n, k) of the runs of a table."""
        return np.stack([np.asarray(columns[key], float) for key in self.keys], axis=1)

    def _law(self, key: str) -> Marginal:
        law: Any = self.study.varied[key]
        return law


def runs(study: ParameterStudy) -> list[dict[str, Any]]:
    """The values of the keys, run by run: as the lists have them, drawn ones in SI units.

    A key with a list in a design that draws takes its values with equal chances.
    Raises  SceneError where correlations contradict each other"""
    keys = list(study.varied)
    lists = [values for values in study.varied.values() if not isinstance(values, Marginal)]
    if study.settings.design == "grid":
        if np.prod([float(len(values)) for values in lists]) > MOST_RUNS:
            raise SceneError(f"{study.name}: a grid of more than {MOST_RUNS} runs, leave out values")
        return [dict(zip(keys, values, strict=True)) for values in itertools.product(*lists)]
    if study.settings.design == "list":
        return [dict(zip(keys, values, strict=True)) for values in zip(*lists, strict=True)]
    share = correlated(study, shares(study))
    columns = [_column(study.varied[key], share[:, i]) for i, key in enumerate(keys)]
    return [dict(zip(keys, values, strict=True)) for values in zip(*columns, strict=True)]


def shares(study: ParameterStudy) -> np.ndarray:
    """(n_run, n_key) points of the unit cube, by scipy.stats.qmc; scrambled Sobol points or a Latin hypercube."""
    count, width = study.settings.runs or 0, len(study.varied)
    draw = np.random.default_rng(study.settings.seed)
    engine = qmc.Sobol(width, seed=draw) if study.settings.design == "sobol" else qmc.LatinHypercube(width, seed=draw)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The balance properties of Sobol", UserWarning)  # the page says it
        return np.clip(engine.random(count), INSIDE, 1 - INSIDE)


def correlated(study: ParameterStudy, share: np.ndarray) -> np.ndarray:
    """The points under the study's correlations, by a Gaussian copula; raises SceneError where there is none."""
    if not study.correlations:
        return share
    keys, matrix = list(study.varied), np.eye(len(study.varied))
    for correlation in study.correlations:
        i, j = (keys.index(key) for key in correlation.keys)
        matrix[i, j] = matrix[j, i] = correlation.value
    try:
        factor = np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        raise SceneError(f"{study.name}: no variables have all of these correlations at once, lower them") from None
    normal = stats.norm.ppf(share) @ factor.T
    drawn = np.array([isinstance(study.varied[key], Marginal) for key in keys])
    return np.where(drawn, np.clip(stats.norm.cdf(normal), INSIDE, 1 - INSIDE), share)


def _column(varied: tuple[Any, ...] | Marginal, share: np.ndarray) -> list[Any]:
    if isinstance(varied, Marginal):
        return [float(value) for value in varied.at(share)]
    return [varied[int(u * len(varied))] for u in share]
