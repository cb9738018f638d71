"""Propose the next run of an optimisation: surrogates of aims and limits, expected improvement."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import erfcx
from scipy.stats import qmc

from tribodyn.workflows.studies.many.surrogate import FEWEST, Surrogate

MISSED = 1e3  # what a limit that is passed counts beside the aims
AUGMENTED = 0.05  # share of the sum of aims beside the largest: Knowles 2006
SAME_POINT = 1e-3  # of the unit cube, within which a proposal is a run that is there already


@dataclass(frozen=True)
class EvaluatedRuns:
    """Aims and limits of the runs so far.

    share : (n, k) places of the runs in the unit cube
    aims : (n, m) values to be made small; excess : (n, q) by which limits are passed, below 0 where they are kept.
        A run that failed has nan in both
    slopes : (n, m + q, k) derivatives of both by coordinates, nan where they are not known"""

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
        anew for every run"""
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
        far below: Ament et al. 2023"""
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

    Source  Forrester, Sobester and Keane 2006, doi 10.1098/rspa.2005.1608"""
    surrogate = Surrogate.fitted(points[solved], column[solved], slopes[solved], is_small=True)
    for point in points[~solved]:
        mean, deviation = surrogate.mean_and_deviation(point[None])
        surrogate = surrogate.with_run(point, float(mean[0] + deviation[0]))
    return surrogate
