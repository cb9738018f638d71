"""Error-controlled wear steps, stable for the stiff coupling of pressure and depth.

dw/dZ = r(w) relaxes a pressure peak thousands of times faster than the contact as a whole wears: explicit steps must
resolve the former or oscillate from node to node. Here a Rosenbrock step of second order is taken with the contact's
own wear Jacobian; it is L-stable, keeps its order with an approximate Jacobian, and brings a first-order companion as
error estimate.
Source  ROS2: Verwer, Spee, Blom, Hundsdorfer 1999, SIAM J. Sci. Comput. 20(4), with gamma = 1 - 1/sqrt(2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sla

from hbm.evolution import WearProblem, WearState, assess, first_preload, reason_to_stop, row_of, state_of
from hbm.wear_history import WearHistory, WearRow, history

GAMMA = 1 - 1 / np.sqrt(2)


@dataclass(frozen=True)
class Tolerance:
    """share : local error allowed per step, of the depth scale and of the cycles passed; scale : depth scale [m]."""

    share: float
    scale: float


def wear_jacobian(problem: WearProblem, state: WearState) -> np.ndarray:
    """(n_pair, n_pair) d rate_i / d depth_j [1/cycle] at fixed frequency, by the work that a gap change moves.

    The rate is taken proportional to the friction work of its pair, as the energy law has it and others nearly do.
    """
    n_pair = len(state.depth)
    total = np.zeros((n_pair, n_pair))
    for duty, point in zip(problem.mission, state.points, strict=True):
        balance = problem.at_depth(state.depth).with_load(duty.load)
        total += duty.share * balance.work_slope(point.state)
    ratio = np.divide(state.rate, state.work, out=np.zeros(n_pair), where=state.work > 0)
    return ratio[:, None] * total


def evolve(
    problem: WearProblem,
    tolerance: Tolerance,
    max_steps: int = 10000,
    on_row: Callable[[WearRow], None] | None = None,
    resume: WearHistory | None = None,
) -> WearHistory:
    """Wear the contact until it is lost, with steps chosen by a local error estimate on depth and on life.

    on_row, resume, return : as for the thesis's rule; `step_error` of a row is the estimate over the tolerance
    """
    rows = resume.rows() if resume is not None else []
    if rows and rows[-1].cycles_in_step == 0:
        return history(rows, resume.end if resume is not None else "")
    n_pair = len(problem.area)
    end = f"stopped after {max_steps} wear steps"
    if rows:
        before = state_of(problem, rows[-1])
        depth, cycles = rows[-1].depth + rows[-1].worn, rows[-1].cycles + rows[-1].cycles_in_step
        state = assess(problem, depth, cycles, before)
        stride = _next_stride(rows[-1].cycles_in_step, rows[-1].step_error)
    else:
        state = assess(problem, np.zeros(n_pair), 0.0, None)
        stride = tolerance.share * tolerance.scale / max(state.rate.max(), 1e-300)
    while len(rows) < max_steps:
        reason = reason_to_stop(problem, state, first_preload(problem, rows, state))
        if reason:
            rows.append(row_of(problem, state, 0.0, np.zeros(n_pair), np.zeros(n_pair)))
            end = reason
        else:
            state, row, stride = _step(problem, tolerance, state, stride)
            rows.append(row)
        if on_row is not None:
            on_row(rows[-1])
        if reason:
            break
    return history(rows, end)


def _step(
    problem: WearProblem, tolerance: Tolerance, state: WearState, stride: float
) -> tuple[WearState, WearRow, float]:
    """One accepted step from a state: the state after it, its row, and the cycles to try next."""
    slope = wear_jacobian(problem, state)
    share = np.divide(state.work, state.rate, out=np.zeros_like(state.work), where=state.rate > 0)
    work_slope = share[:, None] * slope
    solves = state.solves
    while True:
        factor = sla.lu_factor(np.eye(len(slope)) - GAMMA * stride * slope)
        k1 = sla.lu_solve(factor, state.rate)
        e1 = state.work + GAMMA * stride * work_slope @ k1
        middle = assess(problem, np.maximum(state.depth + stride * k1, state.depth), state.cycles + stride, state)
        solves += middle.solves
        k2 = sla.lu_solve(factor, middle.rate - 2 * k1)
        e2 = middle.work - 2 * e1 + GAMMA * stride * work_slope @ k2
        worn, work = stride * (1.5 * k1 + 0.5 * k2), stride * (1.5 * e1 + 0.5 * e2)
        # a pair that the linear model would lift off cannot grow: cut off, and what is cut counts as error
        deviation = 0.5 * stride * (k1 + k2) - np.minimum(worn, 0.0)  # from the first-order companion w + h k1
        worn, work = np.maximum(worn, 0.0), np.maximum(work, 0.0)
        error = 4.0 if middle.failure else _error(problem, tolerance, state, stride, worn, deviation)
        if error <= 1.0:
            break
        stride = _next_stride(stride, error)
        if stride * state.rate.max() < 1e-9 * tolerance.scale:
            break
    after = assess(problem, state.depth + worn, state.cycles + stride, state)
    row = row_of(problem, replace(state, solves=solves), stride, worn, work, error)
    return after, row, _next_stride(stride, error)


def _error(
    problem: WearProblem, tolerance: Tolerance, state: WearState, stride: float, worn: np.ndarray, deviation: np.ndarray
) -> float:
    """Local error over the tolerance: of the deepest deviation, and of the cycles that the same volume takes."""
    on_depth = np.abs(deviation).max() / tolerance.scale
    volume = float(problem.area @ worn)
    on_life = abs(float(problem.area @ deviation)) / volume * stride / (state.cycles + stride) if volume > 0 else 0.0
    return float(max(on_depth, on_life) / tolerance.share)


def _next_stride(stride: float, error: float) -> float:
    """Step that meets the tolerance by the second power of the step, with a margin and limits."""
    return stride * float(np.clip(0.85 / np.sqrt(max(error, 1e-10)), 0.2, 5.0))
