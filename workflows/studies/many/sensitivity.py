"""Which of the things that vary a number depends on: Sobol indices of a surrogate, by scipy.stats.sobol_indices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from tribodyn.workflows.studies.many.space import Space

POINTS = 2**12  # a power of two


@dataclass(frozen=True)
class Influence:
    """What one key does to a number.

    first : share of the variance that goes when the key is known exactly; total : that stays when all others are known
    left : standard deviation over what it is now, if the key were known exactly, sqrt(1 - first)
    """

    key: str
    first: float
    total: float

    @property
    def left(self) -> float:
        """Share of the standard deviation that stays when the key is measured."""
        return float(np.sqrt(max(1 - self.first, 0.0)))


def influences(space: Space, mean: Callable[[np.ndarray], np.ndarray], seed: int = 0) -> tuple[Influence, ...]:
    """Of every key, the largest first.

    mean : coordinates (n, k) -> values (n,)
    Where keys are correlated, `first` counts what the others share with a key, and `total` does not: an index of what
    is independent, with the key as the first and as the last one of the Gaussian copula.
    Source  Saltelli et al. 2010, doi 10.1016/j.cpc.2009.09.018; correlated: Mara and Tarantola 2012, doi
    10.1016/j.ress.2011.08.008
    """
    k = len(space.keys)
    if not space.study.correlations:
        first, total = _indices(space, mean, seed)
    else:
        first, total = np.empty(k), np.empty(k)
        for i, key in enumerate(space.keys):
            others = [other for other in space.keys if other != key]
            first[i] = _indices(_ordered(space, [key, *others]), _as_before(space, mean, [key, *others]), seed)[0][0]
            total[i] = _indices(_ordered(space, [*others, key]), _as_before(space, mean, [*others, key]), seed)[1][-1]
    found = [Influence(key, float(a), float(b)) for key, a, b in zip(space.keys, first, total, strict=True)]
    return tuple(sorted(found, key=lambda one: -one.first))


def _indices(space: Space, mean: Callable[[np.ndarray], np.ndarray], seed: int) -> tuple[np.ndarray, np.ndarray]:
    """First and total indices (k,) with respect to the independent shares behind a space."""
    if len(space.keys) == 1:
        return np.ones(1), np.ones(1)

    def function(share: np.ndarray) -> np.ndarray:  # (k, n) -> (1, n)
        return mean(space.coordinates(space.values(share.T)))[None]

    shares = [stats.uniform(0, 1)] * len(space.keys)
    found = stats.sobol_indices(func=function, n=POINTS, dists=shares, random_state=np.random.default_rng(seed))
    return np.clip(found.first_order.ravel(), 0, 1), np.clip(found.total_order.ravel(), 0, 1)


def _ordered(space: Space, keys: list[str]) -> Space:
    study = space.study
    return Space(replace(study, varied={key: study.varied[key] for key in keys}))


def _as_before(
    space: Space, mean: Callable[[np.ndarray], np.ndarray], keys: list[str]
) -> Callable[[np.ndarray], np.ndarray]:
    """The function of coordinates in another order of the keys."""
    back = [keys.index(key) for key in space.keys]
    return lambda coordinates: mean(coordinates[:, back])
