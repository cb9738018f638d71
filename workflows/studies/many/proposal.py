"""Where the next runs of an optimisation promise most: expected improvement of several aims under limits.

Every aim and every limit has a Gaussian process of its own. Several aims become one by the augmented Chebyshev function
with weights that are drawn anew for every proposal, so that proposals spread over the best trades. The expected
improvement of that, where all limits are kept, is averaged over draws and maximised by differential evolution.
Source  expected improvement: Jones, Schonlau and Welch 1998; weights: Knowles 2006, doi 10.1109/TEVC.2005.851274;
    limits: Gardner et al. 2014; a process for every aim: Daulton, Balandat and Bakshy 2020
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from tribodyn.workflows.studies.many.surrogate import FEWEST, Surrogate

AUGMENTED = 0.05  # weight of the sum beside the largest, which leaves no point that another one beats in all
DRAWS = 6  # powers of two of them, for the average
GENERATIONS, POPULATION = 30, 12  # of differential evolution, for each key
NEAR = 1e-3  # of the unit cube, within which a proposal is a run that is there already


@dataclass(frozen=True)
class Known:
    """What runs have told.

    share : (n, k) places of the runs in the unit cube
    aims : (n, m) values to be made small; excess : (n, q) by which limits are passed, below 0 where they are kept.
        A run that failed has nan in both
    """

    share: np.ndarray
    aims: np.ndarray
    excess: np.ndarray

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
    found = rows[~(no_better & worse).any(axis=1)]
    return found[np.lexsort(aims[found].T[::-1])]


def chebyshev(aims: np.ndarray, weights: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Augmented Chebyshev function of aims (..., m) between low (m,), which is 0, and high (m,), which is 1."""
    scaled = weights * (aims - low) / np.where(high > low, high - low, 1.0)
    found: np.ndarray = scaled.max(axis=-1) + AUGMENTED * scaled.sum(axis=-1)
    return found


def ends(known: Known) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest values (m,) of the aims along the best trades, of all runs where these are fewer than two."""
    front = known.front
    aims = known.aims[front if len(front) > 1 else known.solved]
    return aims.min(axis=0), aims.max(axis=0)


def propose(known: Known, scale: Callable[[np.ndarray], np.ndarray], count: int, seed: int) -> np.ndarray:
    """Places (count, k) in the unit cube for runs that promise most; the same runs and seed propose the same.

    scale : places (n, k) -> coordinates (n, k) that surrogates are fitted in
    Where too few runs are solved for a surrogate, far from all others
    Raises  ValueError where scikit-learn is not there
    """
    share, m = known.share, known.aims.shape[1]
    draw = np.random.default_rng([seed, len(share)])
    if known.solved.sum() < FEWEST:
        for _ in range(count):
            share = np.vstack([share, _emptiest(share, draw)])
        return share[-count:]
    columns = np.concatenate([known.aims, known.excess], axis=1)
    surrogates = [_fitted(scale(share), column, known.solved) for column in columns.T]
    low, high = ends(known)
    found: list[np.ndarray] = []
    for _ in range(count):
        turn = len(known.share) % (3 * m)
        weights = np.eye(m)[turn] if turn < m else draw.dirichlet(np.ones(m))  # the ends of the trade in their turns
        at = _best(known, surrogates, scale, weights, low, high, draw)
        every = np.concatenate([share, *[one[None] for one in found]])
        if np.abs(every - at).max(axis=1).min() < NEAR:
            at = _emptiest(every, draw)
        found.append(at)
        # until it is solved it counts as what is expected of it
        place = scale(at[None])
        surrogates = [one.with_run(place[0], float(one.mean(place)[0])) for one in surrogates]
        expected = np.array([one.levels[-1].values[-1] for one in surrogates])
        known = replace(
            known,
            share=np.vstack([known.share, at]),
            aims=np.vstack([known.aims, expected[:m]]),
            excess=np.vstack([known.excess, expected[m:]]),
        )
    return np.array(found)


def _fitted(points: np.ndarray, column: np.ndarray, solved: np.ndarray) -> Surrogate:
    """A process through the runs that are solved; one that failed counts as worse than expected there by a deviation.

    Source  Forrester, Sobester and Keane 2006, doi 10.1098/rspa.2005.1608
    """
    found = Surrogate.fitted(points[solved], column[solved])
    for point in points[~solved]:
        mean, deviation = found.mean_and_deviation(point[None])
        found = found.with_run(point, float(mean[0] + deviation[0]))
    return found


def _best(
    known: Known,
    surrogates: list[Surrogate],
    scale: Callable[[np.ndarray], np.ndarray],
    weights: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    draw: np.random.Generator,
) -> np.ndarray:
    k, m = known.share.shape[1], known.aims.shape[1]
    normal = stats.norm.ppf(np.clip(qmc.Sobol(len(surrogates), seed=draw).random_base2(DRAWS), 1e-12, 1 - 1e-12))
    least = np.inf
    if known.allowed.any():
        least = float(chebyshev(known.aims[known.allowed], weights, low, high).min())

    def missed(share: np.ndarray) -> np.ndarray:  # (k, n) -> (n,)
        each = [one.mean_and_deviation(scale(share.T)) for one in surrogates]
        drawn = np.stack(
            [mean + np.multiply.outer(z, deviation) for z, (mean, deviation) in zip(normal.T, each, strict=True)]
        )
        kept = (drawn[m:] <= 0).all(axis=0)
        if least < np.inf:
            value = chebyshev(np.moveaxis(drawn[:m], 0, -1), weights, low, high)
            kept = kept * np.maximum(least - value, 0.0)
        spread = np.sum([deviation for _, deviation in each], axis=0)
        return np.asarray(-kept.mean(axis=0) - 1e-9 * spread)  # where nothing is to be gained, what is least known

    start = qmc.Sobol(k, seed=draw).random_base2(int(np.ceil(np.log2(POPULATION * k))))
    start = np.vstack([known.share[known.front], start])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = differential_evolution(
            missed, [(0.0, 1.0)] * k, maxiter=GENERATIONS, init=start, rng=draw, polish=False, vectorized=True,
            updating="deferred", tol=0.0,
        )  # fmt: skip
    place: np.ndarray = found.x
    return place


def _emptiest(share: np.ndarray, draw: np.random.Generator) -> np.ndarray:
    """A place (k,) far from all runs (n, k)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        places = qmc.Sobol(share.shape[1], seed=draw).random_base2(8)
    far = np.abs(places[:, None] - share).max(axis=2).min(axis=1)
    found: np.ndarray = places[int(far.argmax())]
    return found
