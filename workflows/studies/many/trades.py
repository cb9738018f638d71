"""Best trades between aims under limits: which of some runs they are, and where the next run promises most.

Every aim and every limit has a Gaussian process of its own, through its values and derivatives at the runs. Of several
aims one is made by the Chebyshev function with weights: the largest weighted aim, each between its ends along the
trade, is made small. Least t with all of these at most t, and all limits kept, is a problem of nonlinear programming;
sequential quadratic programming solves it on the processes, from several starts.
Source  SLSQP of SciPy: Kraft 1988; weights: Knowles 2006, doi 10.1109/TEVC.2005.851274; a process for every aim:
    Daulton, Balandat and Bakshy 2020
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from tribodyn.workflows.studies.many.surrogate import FEWEST, Surrogate

STARTS = 5  # of a search
MISSED = 1e3  # what a limit that is passed counts beside the aims
NEAR = 1e-3  # of the unit cube, within which a proposal is a run that is there already


@dataclass(frozen=True)
class Known:
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
    found = rows[~(no_better & worse).any(axis=1)]
    return found[np.lexsort(aims[found].T[::-1])]


def chebyshev(aims: np.ndarray, weights: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Largest of those aims (..., m) that have a weight, times it, between low (m,), 0, and high (m,), 1."""
    counted = weights > 0
    scaled = weights * (aims - low) / np.where(high > low, high - low, 1.0)
    found: np.ndarray = scaled[..., counted].max(axis=-1)
    return found


def ends(known: Known) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest values (m,) of the aims along the best trades, of all runs where these are fewer than two."""
    front = known.front
    aims = known.aims[front if len(front) > 1 else known.solved]
    return aims.min(axis=0), aims.max(axis=0)


def propose(known: Known, scale: Callable[[np.ndarray], np.ndarray], seed: int) -> tuple[np.ndarray, float]:
    """A place (k,) in the unit cube for the run that promises most; the same runs and seed propose the same.

    scale : places (n, k) -> coordinates (n, k) that surrogates are fitted in
    Returns the place and what is expected there beyond the best run so far, in what is made small, inf where there are
        too few runs to say: then it lies far from all others. A second aim is weighed anew for every run
    """
    share, m = known.share, known.aims.shape[1]
    draw = np.random.default_rng([seed, len(share)])
    columns, solved = np.concatenate([known.aims, known.excess], axis=1), known.solved
    if int(solved.sum()) + int(np.isfinite(known.slopes[solved, 0]).sum()) < FEWEST:
        return _emptiest(share, draw), np.inf
    surrogates = [_fitted(scale(share), column, known.slopes[:, i], solved) for i, column in enumerate(columns.T)]
    low, high = ends(known)
    turn = len(share) % (3 * m)  # the ends of the trade in their turns
    weights = np.eye(m)[turn] if turn < m and m > 1 else draw.dirichlet(np.ones(m))
    least = float(chebyshev(known.aims[known.allowed], weights, low, high).min()) if known.allowed.any() else np.inf

    def expected(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Aims (n, m) at places (n, k), and excess (n, q), a standard deviation above what is expected."""
        at = scale(np.clip(places, 0.0, 1.0))
        above = [mean + deviation for mean, deviation in (one.mean_and_deviation(at) for one in surrogates[m:])]
        excess = np.stack(above, axis=1) if above else np.zeros((len(at), 0))
        return np.stack([one.mean(at) for one in surrogates[:m]], axis=1), excess

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Sobol points whose number is no power of two; steps beyond the bounds
        places = np.vstack([share[known.front], qmc.Sobol(share.shape[1], seed=draw).random_base2(8)])
        aims, excess = expected(places)
        passed = np.maximum(excess, 0).max(axis=1, initial=0.0)
        order = np.argsort(chebyshev(aims, weights, low, high) + MISSED * passed)
        ended = [_descended(expected, place, weights, low, high) for place in places[order[:STARTS]]]
    found = min(ended, key=lambda one: one[1])
    at, value = found
    if np.abs(share - at).max(axis=1).min() < NEAR:
        return (at, 0.0) if m == 1 else (_emptiest(share, draw), np.inf)
    return at, least - value if m == 1 else np.inf


def _descended(
    expected: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    start: np.ndarray,
    weights: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> tuple[np.ndarray, float]:
    """The place where one search ends, and the Chebyshev function there with what limits are passed by."""
    counted = weights > 0
    scale = weights[counted] / np.where(high > low, high - low, 1.0)[counted]

    def margins(z: np.ndarray) -> np.ndarray:
        aims, excess = (each[0] for each in expected(z[None, 1:]))
        return np.concatenate([z[0] - scale * (aims - low)[counted], -excess])

    first = float(chebyshev(expected(start[None])[0], weights, low, high)[0])
    found = minimize(
        lambda z: z[0], np.array([first, *start]), jac=lambda z: np.eye(len(z))[0], method="SLSQP",
        bounds=[(None, None), *[(0.0, 1.0)] * len(start)], constraints={"type": "ineq", "fun": margins},
    )  # fmt: skip
    place = np.clip(found.x[1:], 0.0, 1.0)
    aims, excess = expected(place[None])
    passed = float(np.maximum(excess, 0).max(initial=0.0))
    return place, float(chebyshev(aims, weights, low, high)[0]) + MISSED * passed


def _fitted(points: np.ndarray, column: np.ndarray, slopes: np.ndarray, solved: np.ndarray) -> Surrogate:
    """A process through the runs that are solved; one that failed counts as worse than expected there by a deviation.

    Source  Forrester, Sobester and Keane 2006, doi 10.1098/rspa.2005.1608
    """
    found = Surrogate.fitted(points[solved], column[solved], slopes[solved])
    for point in points[~solved]:
        mean, deviation = found.mean_and_deviation(point[None])
        found = found.with_run(point, float(mean[0] + deviation[0]))
    return found


def _emptiest(share: np.ndarray, draw: np.random.Generator) -> np.ndarray:
    """A place (k,) far from all runs (n, k)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        places = qmc.Sobol(share.shape[1], seed=draw).random_base2(8)
    far = np.abs(places[:, None] - share).max(axis=2).min(axis=1)
    found: np.ndarray = places[int(far.argmax())]
    return found
