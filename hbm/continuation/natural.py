"""Natural continuation: frequency is stepped, the solution follows by extrapolation of its last points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from hbm import newton
from hbm.balance import HarmonicBalance
from hbm.branch import Branch, BranchBuilder
from hbm.newton import NewtonOptions, Solution

DEGREE = 2  # of the extrapolating polynomial


@dataclass(frozen=True)
class Options:
    """n_points : equidistant frequencies, ends included; refinements : times a failed step may be halved."""

    n_points: int = 200
    refinements: int = 6
    newton: NewtonOptions = field(default_factory=NewtonOptions)


def follow(
    balance: HarmonicBalance,
    start: float,
    stop: float,
    options: Options | None = None,
    on_point: Callable[[int, int], None] | None = None,
) -> Branch:
    """Follow the response from one frequency to another.

    start, stop : [rad/s], either order; on_point : called with points done and points wanted
    Returns a Branch; where a point fails after all refinements the branch ends there and says so
    """
    options = options or Options()
    builder = BranchBuilder(balance)
    solution = newton.solve_from_rest(balance, start, options.newton)
    builder.add(solution)
    wanted = np.linspace(start, stop, options.n_points)[1:]
    for done, omega in enumerate(wanted, start=1):
        if not solution.converged:
            break
        solution = _step(balance, builder, omega, options, options.refinements)
        if on_point is not None:
            on_point(done + 1, options.n_points)
    if solution.converged:
        return builder.finish(f"reached {stop / (2 * np.pi):.6g} Hz")
    return builder.finish(f"ended at {solution.state.omega / (2 * np.pi):.6g} Hz: {solution.outcome}")


def _step(balance: HarmonicBalance, builder: BranchBuilder, omega: float, options: Options, halvings: int) -> Solution:
    """One step to `omega`, through points in between where it fails."""
    solution = newton.solve(balance, omega, predict(builder, omega), options.newton)
    if not solution.converged and halvings > 0:
        middle = _step(balance, builder, 0.5 * (builder.omega[-1] + omega), options, halvings - 1)
        if not middle.converged:
            return middle
        return _step(balance, builder, omega, options, halvings - 1)
    builder.add(solution)
    return solution


def predict(builder: BranchBuilder, omega: float) -> np.ndarray:
    """Lagrange extrapolation of the last points to a frequency: (n_pair, n_component, n_coeff) [m]."""
    known = np.array(builder.omega[-DEGREE - 1 :])
    x = builder.x[-DEGREE - 1 :]
    weights = [np.prod((omega - np.delete(known, i)) / (known[i] - np.delete(known, i))) for i in range(len(known))]
    return sum(w * xi for w, xi in zip(weights, x, strict=True))
