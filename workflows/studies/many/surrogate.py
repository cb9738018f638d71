"""A Gaussian process through runs of a study, by their values and, where these are known, their derivatives.

It knows how far it may be off, and is held to that by leaving runs out. Covariance: Matern 5/2 with a length for each
coordinate, a linear trend, and noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
import scipy.linalg as sla
from scipy.optimize import minimize

from tribodyn.refusal import Refusal

FEWEST = 8  # numbers, values and derivatives, that a surrogate is fitted to
BLOCK = 4096  # points at a time
JITTER = 1e-9  # of the largest variance, on the diagonal of a covariance
# logarithms of the least and the largest variance of the process, of its trend and of noise, over that of the runs, and
# of lengths; more noise would hide what the points are too few for
BOUNDS = ((-7.0, 7.0), (-14.0, 7.0), (-23.0, -4.6), (-2.3, 4.6))
LIKELY = 1e-5  # relative change of the likelihood that ends a search for them
STARTS = (0.7, -0.5, 2.0)  # logarithms of lengths that the most likely ones are looked for from


def covariance(log: np.ndarray, a: np.ndarray, i: np.ndarray, b: np.ndarray, j: np.ndarray) -> np.ndarray:
    """(n, m) covariance of what is known at points a (n, k) with that at points b (m, k), without noise.

    log : logarithms of variance, trend, noise and the k lengths
    i (n,), j (m,) : the coordinate that it is the derivative by, -1 for a value
    Source  Rasmussen and Williams 2006, eq. 4.17; derivatives: section 9.4"""
    variance, trend, length = np.exp(log[0]), np.exp(log[1]), np.exp(log[3:])
    d = (a[:, None] - b[None]) / length
    r = np.sqrt(5 * np.einsum("nmk,nmk->nm", d, d))
    fall = variance * np.exp(-r)
    blocks = np.asarray(fall * (1 + r + r**2 / 3) + trend * (1 + a @ b.T))
    n, m = np.flatnonzero(i >= 0), np.flatnonzero(j >= 0)
    slope = 5 / 3 * fall * (1 + r)
    by_i = d[n, :, i[n]] / length[i[n], None]  # (n, m) the own coordinate's distance over its length squared
    by_j = d[:, m, j[m]] / length[j[m]]
    blocks[n] = trend * b.T[i[n]] - slope[n] * by_i
    blocks[:, m] = trend * a[:, j[m]] + slope[:, m] * by_j
    product = np.ix_(n, m)
    is_same = i[n, None] == j[m]
    diagonal = is_same * (slope[product] / length[i[n], None] ** 2 + trend)
    blocks[product] = diagonal - 25 / 3 * fall[product] * by_i[:, m] * by_j[n]
    return blocks


@dataclass(frozen=True, eq=False)
class Law:
    """A direction (k,) of the coordinates; along one times it values change by `slope` from any point."""

    direction: np.ndarray
    slope: float

    def coordinate(self, points: np.ndarray) -> np.ndarray:
        """(n,) how many times the direction points (n, k) lie from the plane that is left for a process."""
        shifted = self.direction != 0
        return np.asarray((points[:, shifted] / self.direction[shifted]).mean(axis=1))

    def values(self, points: np.ndarray) -> np.ndarray:
        """(n,) part of the values at points that the law gives."""
        return self.slope * self.coordinate(points)


@dataclass(frozen=True, eq=False)
class Surrogate:
    """A process conditioned on runs.

    log : see `covariance`, in the scale of values less `middle`, over `width`
    points : (n, k); values : (n,); slopes : (n, k) derivatives, nan where they are not known
    laws : directions along which the values are known to be linear; the process is through what these leave
    stretch : factor on its standard deviation, so that it accounts for the runs when they are left out one by one"""

    log: np.ndarray
    points: np.ndarray
    values: np.ndarray
    slopes: np.ndarray
    laws: tuple[Law, ...]
    middle: float
    width: float
    stretch: float = 1.0

    @classmethod
    def fitted(
        cls, points: np.ndarray, values: np.ndarray, slopes: np.ndarray | None = None, laws: tuple[Law, ...] = (),
        is_small: bool = False,
    ) -> Surrogate:  # fmt: skip
        """The most likely process: coordinates (n, k) of order 1, values (n,), derivatives (n, k) or nan.

        Of a number that has laws no derivatives are taken.

        is_small : where fewer than FEWEST numbers are known, a process that is nearly linear
        Raises  Refusal where fewer are known, and `is_small` is not asked for
        Source  Rasmussen and Williams 2006, eq. 2.30"""
        slopes = np.full(points.shape, np.nan) if slopes is None else slopes
        by_law = len(values) + int(np.isfinite(slopes).sum())
        if by_law < FEWEST and not is_small:
            raise Refusal(f"{by_law} numbers of runs are known, a surrogate needs {FEWEST} at least")
        residual = values - sum(law.values(points) for law in laws)
        middle, width = float(np.mean(residual)), float(np.std(residual)) or 1.0
        k = points.shape[1]
        bounds = [*BOUNDS[:3], *[BOUNDS[3]] * k]

        def unlikely(log: np.ndarray) -> float:
            candidates = cls(log, points, values, slopes, laws, middle, width)
            try:
                root, alpha = candidates._conditioned
            except np.linalg.LinAlgError:
                return 1e6
            return float(0.5 * candidates._targets @ alpha + np.log(np.diag(root)).sum())

        # derivatives leave little doubt of lengths; where little is known they are long, and the process nearly linear
        lengths = STARTS[2:] if by_law < FEWEST else STARTS[:1] if np.isfinite(slopes).any() else STARTS
        starts = [np.array([0.0, -3.0, -9.0, *[length] * k]) for length in lengths]
        climb = partial(minimize, unlikely, method="L-BFGS-B", bounds=bounds, tol=LIKELY)
        likely = min(map(climb, starts), key=lambda known_law: known_law.fun).x if by_law >= FEWEST else starts[0]
        fitted = cls(likely, points, values, slopes, laws, middle, width)
        spread, missed = fitted._leaving_out
        return replace(fitted, stretch=max(1.0, float(np.sqrt(np.mean(missed**2 / spread)))))

    @cached_property
    def _rows(self) -> tuple[np.ndarray, np.ndarray]:
        """(n_known,) the run of all that is known, values first, and the coordinate that it is the derivative by."""
        run, by = np.nonzero(np.isfinite(self.slopes))
        n = len(self.values)
        return np.concatenate([np.arange(n), run]), np.concatenate([np.full(n, -1), by])

    @property
    def _targets(self) -> np.ndarray:
        run, by = self._rows
        remaining = self.values - self.values_by_laws(self.points) - self.middle
        return np.where(by < 0, remaining[run], self.slopes[run, by]) / self.width

    def values_by_laws(self, points: np.ndarray) -> np.ndarray:
        """(n,) values that the laws give."""
        return np.asarray(sum((law.values(points) for law in self.laws), start=np.zeros(len(points))))

    def _coordinates(self, points: np.ndarray) -> np.ndarray:
        """Coordinates of the process."""
        for law in self.laws:
            points = points - law.coordinate(points)[:, None] * law.direction
        return points

    @cached_property
    def _conditioned(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower root L of the covariance of what is known, and that covariance's inverse times what it is."""
        run, by = self._rows
        at = self._coordinates(self.points)[run]
        values = covariance(self.log, at, by, at, by)
        values[np.diag_indices_from(values)] += np.exp(self.log[2]) + JITTER * np.exp(self.log[0])
        root = np.linalg.cholesky(values)
        return root, sla.cho_solve((root, True), self._targets)

    @cached_property
    def _leaving_out(self) -> tuple[np.ndarray, np.ndarray]:
        """Variance (n,) of each run's value where the others alone are known, and by how much they miss it.

        Source  Rasmussen and Williams 2006, eq. 5.12, for a run's value and its derivatives together"""
        root, alpha = self._conditioned
        inverse, run = sla.cho_solve((root, True), np.eye(len(root))), self._rows[0]
        spread, missed = np.empty(len(self.values)), np.empty(len(self.values))
        for i in range(len(self.values)):
            run_values = np.flatnonzero(run == i)  # its value first
            block = np.linalg.inv(inverse[np.ix_(run_values, run_values)])
            spread[i], missed[i] = block[0, 0], block[0] @ alpha[run_values]
        return spread, missed

    @property
    def explained(self) -> float:
        """Share of the variance of the runs that is explained when each is left out."""
        return 1 - float(np.mean((self.values - self.left_out) ** 2) / (np.var(self.values) or 1.0))

    @property
    def left_out(self) -> np.ndarray:
        """(n,) what the others say of each run."""
        return self.values - self.width * self._leaving_out[1]

    def with_run(self, point: np.ndarray, value: float) -> Surrogate:
        """The same process with one run more, nothing fitted again."""
        extended = np.vstack([self.slopes, np.full(len(point), np.nan)])
        return replace(
            self, points=np.vstack([self.points, point]), values=np.append(self.values, value), slopes=extended
        )

    def mean(self, points: np.ndarray) -> np.ndarray:
        """Expected values (n,)."""
        return self.mean_and_deviation(points)[0]

    def mean_and_deviation(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Expected values (n,) and their standard deviations (n,), of what is computed without its noise."""
        root, alpha = self._conditioned
        means, deviations = [], []
        for part in _blocks(points):
            cross = self._covariance_with_runs(part)
            by_law = sla.solve_triangular(root, cross.T, lower=True)
            size = 1 + (self._coordinates(part) ** 2).sum(axis=1)
            prior = np.exp(self.log[0]) + np.exp(self.log[1]) * size
            means.append(cross @ alpha)
            deviations.append(np.sqrt(np.maximum(prior - np.einsum("mn,mn->n", by_law, by_law), 0.0)))
        scale = self.width * self.stretch
        expected = self.values_by_laws(points) + self.middle + self.width * np.concatenate(means)
        return expected, scale * np.concatenate(deviations)

    def departures(self, points: np.ndarray, draws: int, seed: int = 0) -> np.ndarray:
        """(draws, n) drawn jointly: how far the function may lie from its expected values."""
        value = np.full(len(points), -1)
        mean = sla.solve_triangular(self._conditioned[0], self._covariance_with_runs(points).T, lower=True)
        run_values = self._coordinates(points)
        residual = covariance(self.log, run_values, value, run_values, value) - mean.T @ mean
        values, vectors = np.linalg.eigh(residual)
        normal = np.random.default_rng(seed).standard_normal((draws, len(points)))
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        return np.asarray(self.width * self.stretch * normal @ root.T)

    def _covariance_with_runs(self, points: np.ndarray) -> np.ndarray:
        """(n, n_known) covariance of values at points with what is known."""
        run, by = self._rows
        return covariance(
            self.log, self._coordinates(points), np.full(len(points), -1), self._coordinates(self.points)[run], by
        )


def _blocks(points: np.ndarray) -> list[np.ndarray]:
    return [points[start : start + BLOCK] for start in range(0, len(points), BLOCK)]
