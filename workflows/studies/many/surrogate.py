"""A Gaussian process through runs of a study: it knows how far it may be off, and is held to that by leaving runs out.

The regression is scikit-learn's. Several levels add up: one through many cheap runs, and one through the differences
that few full runs make to it.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sla

FEWEST = 8  # runs that a surrogate is fitted to
JITTER = 1e-9  # of the largest variance, on the diagonal of a covariance that is drawn from
BLOCK = 4096  # points at a time
NOISE = 0.01  # most of the variance that counts as noise of the runs: more would hide what the points are too few for


@dataclass(frozen=True)
class Level:
    """A Gaussian process of one kind of runs.

    regression : fitted to values less `middle`, over `width`; points, values : (n, k), (n,) that it was fitted to
    stretch : factor on its standard deviation, so that it accounts for the runs when they are left out one by one
    explained : share of their variance that it explains when they are left out
    """

    regression: Any
    points: np.ndarray
    values: np.ndarray
    middle: float
    width: float
    stretch: float
    explained: float

    @classmethod
    def fitted(cls, points: np.ndarray, values: np.ndarray, seed: int = 0) -> Level:
        """Fit to coordinates (n, k) of order 1 and values (n,).

        Raises  ValueError where the runs are fewer than FEWEST or scikit-learn is not there
        Source  Rasmussen and Williams 2006, eq. 2.23, 2.24; trend as a linear kernel, section 2.7
        """
        if len(values) < FEWEST:
            raise ValueError(f"{len(values)} runs have a value, a surrogate needs {FEWEST} at least")
        process, kernels = _library()
        middle, width = float(np.mean(values)), float(np.std(values)) or 1.0
        k = points.shape[1]
        kernel = (
            kernels.ConstantKernel(1.0, (1e-3, 1e3)) * kernels.Matern(np.full(k, 2.0), (0.1, 100.0), nu=2.5)
            + kernels.ConstantKernel(1.0, (1e-6, 1e3)) * kernels.DotProduct(1.0, (1e-3, 1e3))
            + kernels.WhiteKernel(1e-4, (1e-10, NOISE))
        )
        regression = process.GaussianProcessRegressor(kernel, alpha=1e-10, n_restarts_optimizer=2, random_state=seed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a length at its bound: what does not matter
            regression.fit(points, (values - middle) / width)
        spread, missed = _leaving_out(regression)
        stretch = max(1.0, float(np.sqrt(np.mean(missed**2 / spread))))
        explained = 1 - float(np.mean(missed**2))
        return cls(regression, points, values, middle, width, stretch, explained)

    @property
    def left_out(self) -> np.ndarray:
        """(n,) what the others say of each run."""
        return self.values - self.width * _leaving_out(self.regression)[1]

    def with_run(self, point: np.ndarray, value: float) -> Level:
        """The same process with one run more, nothing fitted again."""
        process, _ = _library()
        points, values = np.vstack([self.points, point]), np.append(self.values, value)
        again = process.GaussianProcessRegressor(self.regression.kernel_, alpha=1e-10, optimizer=None)
        again.fit(points, (values - self.middle) / self.width)
        return Level(again, points, values, self.middle, self.width, self.stretch, self.explained)

    def mean_and_deviation(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Expected values (n,) and their standard deviations (n,), of what is computed without its noise."""
        means, deviations = [], []
        for start in range(0, len(points), BLOCK):
            mean, deviation = self.regression.predict(points[start : start + BLOCK], return_std=True)
            means.append(mean)
            deviations.append(np.sqrt(np.maximum(deviation**2 - self._noise, 0.0)))
        return (
            self.middle + self.width * np.concatenate(means),
            self.width * self.stretch * np.concatenate(deviations),
        )

    def mean(self, points: np.ndarray) -> np.ndarray:
        """Expected values (n,)."""
        parts = [self.regression.predict(points[start : start + BLOCK]) for start in range(0, len(points), BLOCK)]
        return self.middle + self.width * np.concatenate(parts)

    def departures(self, points: np.ndarray, draws: int, seed: int = 0) -> np.ndarray:
        """(draws, n) drawn jointly: how far the function may lie from its expected values."""
        _, covariance = self.regression.predict(points, return_cov=True)
        diagonal = covariance.diagonal()
        covariance[np.diag_indices_from(covariance)] += JITTER * diagonal.max() - self._noise
        try:
            root = np.linalg.cholesky(covariance)
        except np.linalg.LinAlgError:  # rounding has made it indefinite
            values, vectors = np.linalg.eigh(covariance)
            root = vectors * np.sqrt(np.maximum(values, 0.0))
        normal = np.random.default_rng(seed).standard_normal((draws, len(points)))
        return np.asarray(self.width * self.stretch * normal @ root.T)

    @property
    def _noise(self) -> float:
        return float(np.exp(self.regression.kernel_.theta[-1]))  # of the last kernel, the white one


@dataclass(frozen=True)
class Surrogate:
    """The sum of its levels."""

    levels: tuple[Level, ...]

    @classmethod
    def fitted(
        cls, points: np.ndarray, values: np.ndarray, cheap: tuple[np.ndarray, np.ndarray] | None = None
    ) -> Surrogate:
        """Fit to coordinates (n, k) and values (n,) of full runs, and to those of cheap runs where there are any.

        Raises  ValueError where one kind has too few runs
        Source  levels that add up: Kennedy and O'Hagan 2000, doi 10.1093/biomet/87.1.1, with their factor rho = 1
        """
        if cheap is None:
            return cls((Level.fitted(points, values),))
        first = Level.fitted(*cheap)
        return cls((first, Level.fitted(points, values - first.mean(points))))

    @property
    def explained(self) -> float:
        """Share of the variance of the full runs that is explained when each is left out."""
        last = self.levels[-1]
        if len(self.levels) == 1:
            return last.explained
        return 1 - (1 - last.explained) * float(np.var(last.values) / np.var(self.runs[0]))

    @property
    def runs(self) -> tuple[np.ndarray, np.ndarray]:
        """Values of the full runs (n,), and what the others say of each of them (n,)."""
        last = self.levels[-1]
        below = np.asarray(sum((level.mean(last.points) for level in self.levels[:-1]), start=np.zeros(1)))
        return last.values + below, last.left_out + below

    def mean(self, points: np.ndarray) -> np.ndarray:
        """Expected values (n,)."""
        return np.asarray(sum(level.mean(points) for level in self.levels))

    def mean_and_deviation(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Expected values (n,) and their standard deviations (n,)."""
        each = [level.mean_and_deviation(points) for level in self.levels]
        return np.asarray(sum(mean for mean, _ in each)), np.sqrt(sum(deviation**2 for _, deviation in each))

    def departures(self, points: np.ndarray, draws: int, seed: int = 0) -> np.ndarray:
        """(draws, n) drawn jointly: how far the function may lie from its expected values."""
        return np.asarray(sum(level.departures(points, draws, seed + i) for i, level in enumerate(self.levels)))

    def with_run(self, point: np.ndarray, value: float) -> Surrogate:
        """With one full run more, nothing fitted again."""
        below = sum(float(level.mean(point[None])[0]) for level in self.levels[:-1])
        return Surrogate((*self.levels[:-1], self.levels[-1].with_run(point, value - below)))


def _leaving_out(regression: Any) -> tuple[np.ndarray, np.ndarray]:
    """Variance of each run by the others (n,), and by how much they miss it (n,), in the scale of the regression.

    Source  Rasmussen and Williams 2006, eq. 5.12
    """
    spread = 1 / np.diag(sla.cho_solve((regression.L_, True), np.eye(len(regression.alpha_))))
    return spread, regression.alpha_ * spread


def _library() -> tuple[Any, Any]:
    try:
        from sklearn import gaussian_process
        from sklearn.gaussian_process import kernels
    except ImportError:
        raise ValueError('this needs the package scikit-learn: install it with pip install "tribodyn[lives]"') from None
    return gaussian_process, kernels
