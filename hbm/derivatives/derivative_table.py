"""Derivatives of some numbers by some parameters, put together from those at points of the response."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.derivatives.adjoint_gradient import Gradient
from tribodyn.hbm.derivatives.derivative_rules import RULES, NoDerivative
from tribodyn.hbm.derivatives.parameter_change import ParameterChange
from tribodyn.hbm.newton import NewtonOptions


@dataclass(frozen=True)
class Derivatives:
    """Derivatives of some quantities by some parameters.

    names, values : (n_quantity,) of the numbers, those of a joint such as "energy of lap"; parameters : (n_parameter,)
    slopes : (n_quantity, n_parameter) dq / dp; corner : (n_parameter,) whether p is at a corner of the contact forces,
        such as grazing or first slip: one-sided derivatives differ, and `slopes` is their mean
    above, below : (n_quantity, n_parameter) one-sided derivatives at a fixed frequency
    by_frequency : (n_quantity,) dq / d omega at fixed parameters [1/(rad/s)], zero along a peak
    by_gap : (n_quantity, n_pair) dq / d gap of each pair [1/m]
    state : solved, along a peak next to it
    follows_corner : whether the peak is a corner of the curve, at which a contact transition begins"""

    names: tuple[str, ...]
    values: np.ndarray
    parameters: tuple[str, ...]
    slopes: np.ndarray
    corner: np.ndarray
    above: np.ndarray
    below: np.ndarray
    by_frequency: np.ndarray
    by_gap: np.ndarray
    state: State
    follows_corner: bool = False


@dataclass(frozen=True)
class PointSlopes:
    """At one solution: values of numbers, their dq / d omega, both (n_number,), and derivatives at a fixed frequency.

    above, below : (n_number, n_change) one-sided, by the changes; by_gap : (n_number, n_pair)"""

    values: np.ndarray
    by_frequency: np.ndarray
    above: np.ndarray
    below: np.ndarray
    by_gap: np.ndarray

    @property
    def columns(self) -> np.ndarray:
        """(n_number, n_change + n_pair) by the changes and by the gap of every pair."""
        return np.concatenate([(self.above + self.below) / 2, self.by_gap], axis=1)

    @classmethod
    def limit(cls, points: Sequence[PointSlopes]) -> PointSlopes:
        """Limit of points at 1, 4, 9 and 16 times a distance, by a cubic of its root: slip begins by a root."""
        return cls(*(np.tensordot((4, -6, 4, -1), [getattr(p, f.name) for p in points], 1) for f in fields(cls)))


@dataclass(frozen=True)
class ParameterSteps:
    """Names of parameters, and their steps (n_change,)."""

    names: tuple[str, ...]
    steps: np.ndarray


def point_slopes(
    gradients: Sequence[Gradient], changes: Iterable[ParameterChange]
) -> tuple[ParameterSteps, list[PointSlopes]]:
    """What each gradient has by the changes, of which one exists at a time."""
    names, steps = list[str](), list[float]()
    sides: list[list[tuple[np.ndarray, np.ndarray]]] = [[] for _ in gradients]
    for change in changes:
        names.append(change.name)
        steps.append(change.step)
        for slopes, gradient in zip(sides, gradients, strict=True):
            slopes.append(gradient.by(change))
    points = []
    for slopes, gradient in zip(sides, gradients, strict=True):
        values = np.array([number.value for number in gradient.numbers])
        upper, lower = np.moveaxis(np.reshape(slopes, (len(slopes), 2, len(values))), 1, 0)
        points.append(PointSlopes(values, gradient.by_frequency(), upper.T, lower.T, gradient.by_gap()))
    return ParameterSteps(tuple(names), np.array(steps)), points


def derivatives_at(
    gradient: Gradient, parameters: ParameterSteps, point: PointSlopes, moves: np.ndarray | None = None
) -> Derivatives:
    """At a fixed frequency, or along one that has the derivatives `moves` [rad/s] by every column of the point."""
    columns, by_frequency = point.columns, point.by_frequency
    if moves is not None:
        columns, by_frequency = columns + by_frequency[:, None] * moves, np.zeros(len(columns))
    n, upper, lower = len(parameters.names), point.above, point.below
    effect = np.abs(upper + lower) * parameters.steps
    size = np.maximum(effect, RULES.least_effect * effect.max(axis=1, initial=0.0, keepdims=True))
    corner = (2 * np.abs(upper - lower) * parameters.steps > RULES.corner * size).any(axis=0)
    return Derivatives(
        tuple(number.name for number in gradient.numbers), point.values, parameters.names, columns[:, :n], corner,
        upper, lower, by_frequency, columns[:, n:], gradient.state,
    )  # fmt: skip


def exact_state(balance: HarmonicBalance, omega: float, x: np.ndarray, options: NewtonOptions | None) -> State:
    """Solve the balance at a frequency [rad/s] more exactly; raises NoDerivative where it does not converge."""
    tolerance = RULES.state_tolerance
    solution = newton.solve(balance, omega, x, replace(options or NewtonOptions(), tolerance=tolerance))
    if not solution.converged and not solution.history[-1] <= 1e2 * tolerance:
        raise NoDerivative(f"the balance at {omega / (2 * np.pi):.6g} Hz is not solved: {solution.outcome}")
    return solution.state
