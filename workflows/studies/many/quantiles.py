"""Quantiles of a number over a distribution, with a surrogate's confidence in them, and its Sobol indices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from tribodyn.workflows.studies.many.parameter_space import ParameterSpace
from tribodyn.workflows.studies.many.surrogate import Surrogate

EXPONENT = 14  # of two: points that a distribution is made of
RARE = 0.01  # shares below this are drawn from a wider distribution
WIDE = 1.6  # how much wider
DRAWS = 300  # functions that the surrogate may stand for
ZONE = 4.0  # standard deviations: points further than this from a quantile lie on their side for sure
MAX_DRAWS = 1000  # points whose values are drawn jointly
GRID = 1024  # values among which ends are looked for
POINTS = 2**12  # of the Sobol indices, a power of two


@dataclass(frozen=True)
class Sample:
    """Points of the distribution with what the surrogate expects there, in the order of that.

    points : (n, k) values; coordinates : (n, k); weight : (n,), sums to 1; mean, deviation : (n,)"""

    points: np.ndarray
    coordinates: np.ndarray
    weight: np.ndarray
    mean: np.ndarray
    deviation: np.ndarray

    @classmethod
    def of(cls, space: ParameterSpace, surrogate: Surrogate, rare: bool = False, seed: int = 0) -> Sample:
        """Points of a space; rare : spread wider, for shares below RARE."""
        points, weight = space.draw(EXPONENT, seed, WIDE if rare else 1.0)
        coordinates = space.coordinates(points)
        mean, deviation = surrogate.mean_and_deviation(coordinates)
        order = np.argsort(mean, kind="stable")
        return cls(*(each[order] for each in (points, coordinates, weight, mean, deviation)))

    def quantile(self, share: float) -> float:
        """The expected value that a share of the weight lies below."""
        return weighted_quantile(self.mean, self.weight, share)


def weighted_quantile(ordered: np.ndarray, weight: np.ndarray, share: float) -> float:
    """The value that a share of the weight of ordered values (n,) lies below, at the middles of their weights."""
    return float(np.interp(share, np.cumsum(weight) - 0.5 * weight, ordered))


def drawn(sample: Sample, surrogate: Surrogate, share: float, draws: int = DRAWS, seed: int = 0) -> np.ndarray:
    """(draws,) values of a quantile, one for each function that the surrogate may stand for.

    Points that lie on their side of the quantile for sure keep their expected values; of the others MOST, evenly over
    their order, are drawn jointly."""
    middle = sample.quantile(share)
    neighbours = np.flatnonzero(np.abs(sample.mean - middle) < ZONE * sample.deviation)
    if len(neighbours) < 2:
        return np.full(draws, middle)
    step = -(-len(neighbours) // MAX_DRAWS)
    chosen = neighbours[step // 2 :: step]
    sure = np.ones(len(sample.mean), bool)
    sure[neighbours] = False
    n_below = float(sample.weight[sure & (sample.mean < middle)].sum())
    weight = sample.weight[chosen] * (sample.weight[neighbours].sum() / sample.weight[chosen].sum())
    own_deviation = np.clip((share - n_below) / weight.sum(), 0.0, 1.0)
    values = sample.mean[chosen] + surrogate.departures(sample.coordinates[chosen], draws, seed)
    # thinned out, the chosen points have a quantile of their own: only how the draws differ from it counts
    offset = middle - weighted_quantile(sample.mean[chosen], weight / weight.sum(), own_deviation)
    quantile_draws = np.empty(draws)
    for i, row in enumerate(values):
        order = np.argsort(row)
        quantile_draws[i] = offset + weighted_quantile(row[order], weight[order] / weight.sum(), own_deviation)
    return quantile_draws


def counted(
    sample: Sample, values: np.ndarray, predictions: np.ndarray, share: float, confidence: float
) -> tuple[float, float]:
    """Ends of a quantile that hold however the runs depend on the points, also where they jump.

    A surrogate smooths a jump, and is then surer of a quantile beside it than it may be. So the share below a value is
    what the surrogate says, corrected by the runs of the design: by those of them that lie below it less those that
    the others put there. The ends are the next values to either side whose corrected share is not as wanted, by the
    scatter of that count.

    values, predictions : (n, m) runs drawn from the distribution, and what the others say of each, m equally likely
        ones of each where a factor of them is known exactly; none were added on purpose
    Source  Angelopoulos et al. 2023, doi 10.1126/science.adi6000: prediction-powered quantiles"""
    thinned = sample.mean[:: max(len(sample.mean) // GRID, 1)]
    at = np.unique(np.concatenate([thinned, values.ravel(), predictions.ravel()]))
    run_values, remaining = (
        np.array([np.searchsorted(np.sort(x), at, side="right") for x in each]) for each in (values, predictions)
    )
    off = (run_values - remaining) / values.shape[1]  # runs x values
    n_below = np.interp(at, sample.mean, np.cumsum(sample.weight)) + off.mean(axis=0)
    width = stats.norm.ppf(0.5 + confidence / 2) * off.std(axis=0, ddof=1) / np.sqrt(len(values))
    low = high = int(np.argmax(n_below >= share))
    while low > 0 and n_below[low] + width[low] >= share:
        low -= 1
    while high < len(at) - 1 and n_below[high] - width[high] <= share:
        high += 1
    return float(at[low]), float(at[high])


def next_runs(sample: Sample, surrogate: Surrogate, share: float, count: int) -> np.ndarray:
    """(count, k) points whose runs would say most about a quantile: on either side of it, and not near each other.

    Source  active learning with the chance of a wrong sign, as in Echard, Gayton, Lemaire 2011, doi
    10.1016/j.strusafe.2011.01.002; several at a time by taking expected values as found (kriging believer)"""
    middle = sample.quantile(share)
    candidates = np.argsort(-_gain(sample.weight, sample.mean, sample.deviation, middle))[:MAX_DRAWS]
    chosen: list[int] = []
    for _ in range(count):
        mean, deviation = surrogate.mean_and_deviation(sample.coordinates[candidates])
        own_deviation = _gain(sample.weight[candidates], mean, deviation, middle)
        own_deviation[chosen] = -1.0
        best = int(np.argmax(own_deviation))
        chosen.append(best)
        surrogate = surrogate.with_run(sample.coordinates[candidates[best]], float(mean[best]))
    return sample.points[candidates[chosen]]


def _gain(weight: np.ndarray, mean: np.ndarray, deviation: np.ndarray, middle: float) -> np.ndarray:
    """How much a run would say: weight, times how uncertain its side of the quantile is."""
    return np.asarray(weight * deviation * np.exp(-0.5 * ((mean - middle) / np.maximum(deviation, 1e-12)) ** 2))


@dataclass(frozen=True)
class Influence:
    """What one key does to a number.

    first : share of the variance that goes when the key is known exactly; total : that stays when all others are known
    remaining : standard deviation over what it is now, if the key were known exactly, sqrt(1 - first)"""

    key: str
    first: float
    total: float

    @property
    def remaining(self) -> float:
        """Share of the standard deviation that stays when the key is measured."""
        return float(np.sqrt(max(1 - self.first, 0.0)))


def influences(space: ParameterSpace, mean: Callable[[np.ndarray], np.ndarray], seed: int = 0) -> tuple[Influence, ...]:
    """Of every key, the largest first.

    mean : coordinates (n, k) -> values (n,)
    Where keys are correlated, `first` counts what the others share with a key, and `total` does not: an index of what
    is independent, with the key as the first and as the last one of the Gaussian copula.
    Source  Saltelli et al. 2010, doi 10.1016/j.cpc.2009.09.018; correlated: Mara and Tarantola 2012, doi
    10.1016/j.ress.2011.08.008"""
    k = len(space.keys)
    if not space.study.correlations:
        first, total = _indices(space, mean, seed)
    else:
        first, total = np.empty(k), np.empty(k)
        for i, key in enumerate(space.keys):
            others = [other for other in space.keys if other != key]
            first[i] = _indices_in_order(space, mean, [key, *others], seed)[0][0]
            total[i] = _indices_in_order(space, mean, [*others, key], seed)[1][-1]
    indices = [Influence(key, float(a), float(b)) for key, a, b in zip(space.keys, first, total, strict=True)]
    return tuple(sorted(indices, key=lambda influence: -influence.first))


def _indices(
    space: ParameterSpace, mean: Callable[[np.ndarray], np.ndarray], seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """First and total indices (k,) with respect to the independent shares behind a space."""
    if len(space.keys) == 1:
        return np.ones(1), np.ones(1)

    def function(share: np.ndarray) -> np.ndarray:  # (k, n) -> (1, n)
        return mean(space.coordinates(space.values(share.T)))[None]

    shares = [stats.uniform(0, 1)] * len(space.keys)
    indices = stats.sobol_indices(func=function, n=POINTS, dists=shares, random_state=np.random.default_rng(seed))
    return np.clip(indices.first_order.ravel(), 0, 1), np.clip(indices.total_order.ravel(), 0, 1)


def _indices_in_order(
    space: ParameterSpace, mean: Callable[[np.ndarray], np.ndarray], keys: list[str], seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """The same of the keys in another order."""
    back = [keys.index(key) for key in space.keys]
    ordered = ParameterSpace(replace(space.study, varied={key: space.study.varied[key] for key in keys}))
    return _indices(ordered, lambda coordinates: mean(coordinates[:, back]), seed)
