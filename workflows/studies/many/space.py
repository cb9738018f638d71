"""The space of what varies in a study: points drawn from it, and the coordinates that a surrogate is fitted in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import stats
from scipy.stats import qmc

from tribodyn.workflows.scene.scene_file import SceneError
from tribodyn.workflows.studies.many import design
from tribodyn.workflows.studies.many.distributions import Marginal, si
from tribodyn.workflows.studies.many.study_file import Study


@dataclass(frozen=True)
class Space:
    """What varies, in SI units.

    study : every key of which varies by a distribution
    """

    study: Study

    @classmethod
    def of(cls, study: Study, lists: bool = False) -> Space:
        """The space of a study; lists : numbers of a list count as evenly spread from their lowest to their highest.

        Raises  SceneError for a key that varies over a list otherwise
        """
        return cls(replace(study, varied={key: _marginal(study, key, lists) for key in study.varied}))

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys that vary."""
        return tuple(self.study.varied)

    def draw(self, exponent: int, seed: int = 0, wide: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """2**exponent scrambled Sobol points of the joint distribution, and their weights, which sum to 1.

        wide : factor on the standard normal variables behind the points, above 1 for rare values
        Returns values (n, k) in SI units, weights (n,)
        Source  importance sampling with a scaled normal density: Bucher 1988, doi 10.1016/0167-4730(88)90020-3
        """
        k = len(self.keys)
        share = np.clip(qmc.Sobol(k, seed=np.random.default_rng(seed)).random_base2(exponent), 1e-12, 1 - 1e-12)
        normal = stats.norm.ppf(share)
        weight = np.exp(0.5 * (1 - wide**2) * np.sum(normal**2, axis=1))
        return self.values(stats.norm.cdf(wide * normal)), weight / weight.sum()

    def values(self, share: np.ndarray) -> np.ndarray:
        """Values (n, k) in SI units of points (n, k) of the unit cube, correlated as the study says."""
        inside = np.clip(share, design.INSIDE, 1 - design.INSIDE)
        share = design.correlated(self.study, inside)
        return np.stack([self._law(key).at(share[:, i]) for i, key in enumerate(self.keys)], axis=1)

    def shares(self, values: np.ndarray) -> np.ndarray:
        """Points (n, k) of the unit cube that have values (n, k) where nothing is correlated."""
        return np.stack([self._law(key).share(values[:, i]) for i, key in enumerate(self.keys)], axis=1)

    def coordinates(self, values: np.ndarray) -> np.ndarray:
        """Values (n, k) in widths of their distributions from their medians; those of a lognormal one in logarithms."""
        columns = []
        for i, key in enumerate(self.keys):
            law = self._law(key)
            scaled = np.log if law.logarithmic else np.asarray
            low, middle, high = (float(scaled(law.at(np.array([share])))[0]) for share in (0.16, 0.5, 0.84))
            columns.append((scaled(values[:, i]) - middle) / (0.5 * (high - low)))
        return np.stack(columns, axis=1)

    def run_of(self, point: np.ndarray) -> dict[str, float]:
        """The values of a run at a point (k,)."""
        return {key: float(value) for key, value in zip(self.keys, point, strict=True)}

    def points_of(self, columns: Mapping[str, np.ndarray]) -> np.ndarray:
        """Values (n, k) of the runs of a table."""
        return np.stack([np.asarray(columns[key], float) for key in self.keys], axis=1)

    def _law(self, key: str) -> Marginal:
        law: Any = self.study.varied[key]
        return law


def _marginal(study: Study, key: str, lists: bool) -> Marginal:
    given = study.varied[key]
    if isinstance(given, Marginal):
        return given
    numbers = [si(value) for value in given]
    known = [number for number in numbers if number is not None]
    if not lists or len(known) < len(numbers) or len(set(known)) < 2:
        raise SceneError(f"{study.name}: vary.{key}: expected a distribution, this has a list of values")
    return Marginal(stats.uniform(min(known), max(known) - min(known)))
