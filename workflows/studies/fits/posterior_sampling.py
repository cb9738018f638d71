"""Trials of a model, the processes through them, and chains of samples."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tribodyn.extras import package
from tribodyn.refusal import Refusal
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.studies.fits.identification import FitParameter
from tribodyn.workflows.studies.many.distributions import Marginal
from tribodyn.workflows.studies.many.surrogate import Surrogate

Trial = Callable[[Mapping[str, float]], np.ndarray]

WALKERS = 96
STEPS = 500  # of every walker, a third of which is left out
BATCH = 6  # trials that are added at a time


@dataclass(frozen=True)
class ParameterBox:
    """The unknowns between their bounds as shares from 0 to 1."""

    parameters: tuple[FitParameter, ...]
    priors: dict[str, Marginal]

    def values(self, share: np.ndarray) -> list[float]:
        return [
            p.value(p.scaled(p.low) + float(s) * (p.scaled(p.high) - p.scaled(p.low)))
            for p, s in zip(self.parameters, share, strict=True)
        ]

    def coordinates(self, share: np.ndarray) -> np.ndarray:
        """Of order 1, for the processes."""
        return np.asarray(np.sqrt(12) * (share - 0.5))

    def log_prior(self, share: np.ndarray) -> np.ndarray:
        """(n,) of shares (n, k), up to a constant; -inf outside."""
        inside = ((share > 0) & (share < 1)).all(axis=1)
        density_sum = np.where(inside, 0.0, -np.inf)
        for i, p in enumerate(self.parameters):
            if p.name in self.priors and inside.any():
                law = self.priors[p.name]
                values = np.array([self.values(row)[i] for row in share[inside]])
                density = law.law.logpdf(values) + (np.log(values) if p.ratio else 0.0)  # of the unknown
                density_sum[inside] += np.where((values >= law.low) & (values <= law.high), density, -np.inf)
        return density_sum

    def width_of_prior(self, seed: int) -> np.ndarray:
        """(k,) standard deviations of the shares before anything was measured."""
        share = np.random.default_rng(seed).random((4000, len(self.parameters)))
        with np.errstate(invalid="ignore"):
            weight = np.exp(self.log_prior(share) - self.log_prior(share).max())
        mean = weight @ share / weight.sum()
        return np.asarray(np.sqrt(weight @ (share - mean) ** 2 / weight.sum()))


class ModelTrials:
    """Trials of the model, and the processes through the logarithms of their numbers."""

    def __init__(self, box: ParameterBox, trial: Trial, width: int):
        self.box, self._trial, self._width = box, trial, width
        self.shares: list[np.ndarray] = []
        self._numbers: list[np.ndarray] = []
        self.failed = 0
        self._last_failure = ""

    @property
    def count(self) -> int:
        return len(self._numbers) + self.failed

    def make(self, shares: np.ndarray) -> None:
        for share in shares:
            values = dict(zip((p.name for p in self.box.parameters), self.box.values(share), strict=True))
            try:
                numbers = np.asarray(self._trial(values), float)
            except SolveFailed as failure:
                self.failed, self._last_failure = self.failed + 1, str(failure)
                continue
            if numbers.shape != (self._width,) or not (numbers > 0).all():
                raise Refusal(f"the model predicts {numbers.tolist()} instead of {self._width} numbers above 0")
            self.shares.append(share)
            self._numbers.append(np.log(numbers))
        if 2 * self.failed > self.count:
            raise SolveFailed(
                f"{self.failed} of {self.count} trials fail: narrow the bounds; the last: {self._last_failure}"
            )

    def levels(self) -> list[Surrogate]:
        points, numbers = self.box.coordinates(np.array(self.shares)), np.array(self._numbers)
        return [Surrogate.fitted(points, numbers[:, i]) for i in range(self._width)]


def chains_of(
    box: ParameterBox, levels: Sequence[Surrogate], target: np.ndarray, errors: np.ndarray, seed: int
) -> tuple[np.ndarray, float]:
    """Samples (n, k) as shares, and how many autocorrelation times the chains are long."""
    emcee = package("emcee")
    k = len(box.parameters)

    def log_probability(share: np.ndarray) -> np.ndarray:
        log_density = box.log_prior(share)
        good = np.isfinite(log_density)
        if good.any():
            coordinates = box.coordinates(share[good])
            for level, value, error in zip(levels, target, errors, strict=True):
                mean, deviation = level.mean_and_deviation(coordinates)
                variance = error**2 + deviation**2
                log_density[good] -= 0.5 * ((value - mean) ** 2 / variance + np.log(variance))
        return log_density

    draw = np.random.default_rng(seed)
    start = draw.random((4000, k))
    likely = log_probability(start)
    best = start[np.argsort(-likely)[: 2 * WALKERS]]  # the better ones of points all over the bounds
    first = best[draw.choice(len(best), WALKERS, replace=False)]
    sampler = emcee.EnsembleSampler(WALKERS, k, log_probability, vectorize=True)
    sampler.run_mcmc(emcee.State(first, random_state=np.random.RandomState(seed).get_state()), STEPS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        time = float(np.max(sampler.get_autocorr_time(tol=0)))
    chain = sampler.get_chain(discard=STEPS // 3, flat=True)
    chain = draw.permutation(chain)  # in the order of the walkers a stride would take some of them only
    return np.asarray(chain), STEPS / time if np.isfinite(time) else 0.0


def uncertainty_at(levels: Sequence[Surrogate], errors: np.ndarray, coordinates: np.ndarray) -> np.ndarray:
    """(n,) largest standard deviation of a process over the error of its measurement."""
    each = [level.mean_and_deviation(coordinates)[1] / error for level, error in zip(levels, errors, strict=True)]
    return np.asarray(np.max(each, axis=0))


def spread_points(share: np.ndarray, uncertainty: np.ndarray, trials: np.ndarray) -> np.ndarray:
    """(BATCH, k) of the samples: uncertain ones far from each other and from what is known."""
    chosen, taken_points = [], trials
    for _ in range(BATCH):
        distance = np.min(np.linalg.norm(share[:, None] - taken_points[None], axis=2), axis=1)
        best = int(np.argmax(uncertainty * distance))
        chosen.append(share[best])
        taken_points = np.vstack([taken_points, share[best]])
    return np.array(chosen)
