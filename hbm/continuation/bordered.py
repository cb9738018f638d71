"""Bordered Newton-Krylov: solutions where the parameter is an unknown too, so that a fold is a point like any other.

    [ I - G dg/dx   dR/dp ] [dx]   [r]
    [     c^T         c_p ] [dp] = [s]

stays regular where I - G dg/dx alone is singular. Unknowns are scaled by a `Metric`, so that lengths and parameter
values compare; the border acts on the active rows only, which is enough: a direction that moves no active pair moves p.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla

from tribodyn.hbm.balance import State
from tribodyn.hbm.continuation.parameter import Parameter
from tribodyn.hbm.criterion import relative_residual, required_by_vibration
from tribodyn.hbm.krylov import gmres
from tribodyn.hbm.linearisation import Linearisation
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.outcome import CONVERGED, SolveEnd
from tribodyn.refusal import SolverFailure


@dataclass(frozen=True)
class Direction:
    """A direction in (x, p): x (n_contact, n_coeff) [m], p in the unit of the parameter."""

    x: np.ndarray
    p: float

    def __mul__(self, factor: float) -> Direction:
        return Direction(factor * self.x, factor * self.p)

    def __add__(self, other: Direction) -> Direction:
        return Direction(self.x + other.x, self.p + other.p)

    def __sub__(self, other: Direction) -> Direction:
        return Direction(self.x - other.x, self.p - other.p)


@dataclass(frozen=True)
class Metric:
    """The inner product of arc length: length [m] and width (unit of the parameter) count as one each."""

    length: float
    width: float

    def dot(self, a: Direction, b: Direction) -> float:
        """<a, b>, without unit."""
        return float(np.vdot(a.x, b.x)) / self.length**2 + a.p * b.p / self.width**2

    def norm(self, a: Direction) -> float:
        """Length of a direction, without unit."""
        return float(np.sqrt(self.dot(a, a)))

    def unit(self, a: Direction) -> Direction:
        """The direction with norm one."""
        return a * (1.0 / self.norm(a))


class BorderFailed(SolverFailure):
    """The bordered system could not be solved."""


def solve(
    linear: Linearisation, slope: np.ndarray, border: Direction, metric: Metric, rhs: tuple[np.ndarray, float],
    tolerance: float, max_products: int,
) -> tuple[Direction, int]:  # fmt: skip
    """Solve the bordered system by GMRES that keeps its few directions, or directly where it stalls.

    slope : (n_contact, n_coeff) dR/dp; border : c, of any norm; rhs : r (n_contact, n_coeff) [m] and s
    Returns the direction and the products spent
    Raises  BorderFailed"""
    rows = linear.rows
    shape = (len(rows), slope.shape[1])
    bordering = np.append(slope[rows].ravel() * (metric.width / metric.length), 0.0)
    column = bordering[:-1]
    row = np.append(border.x[rows].ravel() / metric.length, border.p / metric.width)
    size = float(np.linalg.norm(row))
    if size == 0.0:
        raise BorderFailed("the border vanishes on the active contacts")
    row /= size
    right = np.append(rhs[0][rows].ravel() / metric.length, rhs[1] / size)

    def product(v: np.ndarray) -> np.ndarray:
        out = v[-1] * bordering
        out[:-1] += linear.product(v[:-1].reshape(shape)).ravel() if len(rows) else v[:-1]
        out[-1] = row @ v
        return out

    precondition = _coarse_inverse(linear, column, row) if len(rows) else None
    y, spent, reached = gmres(product, right, tolerance, max_products, precondition)
    if not reached <= max(10 * tolerance, 0.5):  # stalled: the direct way
        active = (rows[:, None] * shape[1] + np.arange(shape[1])).ravel()
        inner = linear.dense()[np.ix_(active, active)]
        matrix = np.block([[inner, column[:, None]], [row]])
        spent += len(rows)
        try:
            y = np.linalg.solve(matrix, right)
        except np.linalg.LinAlgError:
            raise BorderFailed("the bordered system is singular") from None
    if not np.all(np.isfinite(y)):
        raise BorderFailed("the bordered system has no finite solution")
    dp = float(y[-1]) * metric.width
    d = linear.spread(y[:-1].reshape(shape) * metric.length, rhs[0] - slope * dp)
    return Direction(d, dp), spent


def _coarse_inverse(
    linear: Linearisation, column: np.ndarray, row: np.ndarray
) -> Callable[[np.ndarray], np.ndarray] | None:
    """The inverse of the bordered system with the coarse part of G alone, regular at folds as the whole is."""
    if linear.coarse is None:
        return None
    u, a, matrix = linear.coarse
    shape = (len(u), len(column) // len(u))

    def inner(d: np.ndarray) -> np.ndarray:
        return np.asarray(a @ (u.T @ linear.g_slope(d.reshape(shape))).ravel())

    bordered = np.empty((len(matrix) + 1, len(matrix) + 1), order="F")
    bordered[:-1, :-1], bordered[:-1, -1] = matrix, inner(column)
    bordered[-1, :-1], bordered[-1, -1] = (u.T @ row[:-1].reshape(shape)).ravel(), row[-1] - row[:-1] @ column
    factor, pivots, zero = sla.lapack.dgetrf(bordered, overwrite_a=True)
    if zero:
        return None

    def apply(v: np.ndarray) -> np.ndarray:
        y = sla.lapack.dgetrs(factor, pivots, np.append(inner(v[:-1]), v[-1] - row[:-1] @ v[:-1]))[0]
        out = v.copy()
        out[:-1] += (u @ y[:-1].reshape(u.shape[1], -1)).ravel() - y[-1] * column
        out[-1] = y[-1]
        return out

    return apply


def tangent(
    path: Parameter, value: float, state: State, border: Direction, metric: Metric, options: NewtonOptions,
    tolerance: float,
) -> Direction:  # fmt: skip
    """Unit tangent of the solution curve at a state, on the side that the border points to; raises BorderFailed."""
    balance, _ = path.place(value)
    linear = balance.linearise(state)
    zero = np.zeros_like(state.residual)
    direction, _ = solve(linear, path.slope(value, state), border, metric, (zero, 1.0), tolerance, options.max_products)
    side = 1.0 if metric.dot(direction, border) >= 0 else -1.0
    return metric.unit(direction) * side


def correct(
    path: Parameter, start: Direction, border: Direction, metric: Metric, options: NewtonOptions
) -> tuple[Solution, float]:
    """Newton for R(x, p) = 0 in the hyperplane of a start, normal to the border.

    Returns the solution, converged or not, and its value of the parameter
    Source  inexact Newton with the forcing term of Eisenstat and Walker 1996, choice 2"""
    place = _Place.at(path, start.p, start.x)
    history = [place.error]
    forcing, products, outcome = 1e-2, 0, CONVERGED
    while place.error > (goal := min(options.tolerance, place.required)):
        steps = len(history) - 1
        if steps == options.max_steps:
            outcome = SolveEnd.STEPS_SPENT.say(f" {steps} steps: {place.error:.1e}")
            break
        balance, _ = path.place(place.value)
        target = max(min(forcing, 0.1), 0.3 * goal / place.error, 1e-12)
        slope = path.slope(place.value, place.state)
        try:
            linear = balance.linearise(place.state)
            direction, spent = solve(
                linear, slope, border, metric, (-place.state.residual, 0.0), target, options.max_products
            )
        except BorderFailed as reason:
            outcome = SolveEnd.NO_DIRECTION.say(f" {reason}")
            break
        products += spent
        trial = place.search(path, direction)
        history.append(trial.error)
        if trial.error >= place.error * (1 - 1e-10):
            outcome = SolveEnd.NO_DESCENT.say(f" {place.error:.1e}")
            break
        forcing = 0.5 * (trial.error / place.error) ** 1.5
        place = trial
    if place.error <= options.tolerance:  # as far as rounding lets it
        outcome = CONVERGED
    return Solution(place.state, outcome, len(history) - 1, products, tuple(history)), place.value


@dataclass(frozen=True)
class _Place:
    """One (x, p) of the Newton iteration with its relative residual, and that which the vibration needs."""

    value: float
    state: State
    error: float
    required: float

    @classmethod
    def at(cls, path: Parameter, value: float, flat: np.ndarray) -> _Place:
        balance, omega = path.place(value)
        state = balance.evaluate(omega, balance.shaped(flat))
        x_lin = balance.x_lin(omega)
        error = relative_residual(state, x_lin)
        return cls(value, state, error if np.isfinite(error) else np.inf, required_by_vibration(state, x_lin))

    def search(self, path: Parameter, direction: Direction) -> _Place:
        """Backtrack until the residual falls; the best trial where none falls enough, for the derivative has kinks."""
        best, length = self, 1.0
        for _ in range(8):
            trial = _Place.at(path, self.value + length * direction.p, self.state.flat + length * direction.x)
            if trial.error < best.error:
                best = trial
            if trial.error <= (1 - 0.1 * length) * self.error:
                return trial
            length *= 0.5
        return best
