"""Wear, step by step, until the contact is lost: the rule of the thesis.

Each step takes the cycle at its operating point, wears every pair as if the cycle repeated Z times, and moves the gap;
Z is what lets the deepest pair wear by the largest depth allowed for one step.
Source  Tamatam 2021, eq. 3.29-3.31 and figure 3.6.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hbm import law as contact_law
from hbm import newton, wear_law
from hbm.balance import HarmonicBalance
from hbm.operating_point import AtFrequency, AtPeak, OperatingPoint
from hbm.wear_history import WearHistory, WearRow, history

LOST = "contact lost at every pair"


@dataclass(frozen=True)
class WearProblem:
    """What wears, where the cycle is taken, and by which law.

    balance : the unworn problem; site : where the cycle is taken
    law : name of a wear law; coefficient : (n_pair,) or scalar, in the unit the law states; area : (n_pair,) [m2]
    """

    balance: HarmonicBalance
    site: AtFrequency | AtPeak
    law: str
    coefficient: np.ndarray | float
    area: np.ndarray


def evolve(
    problem: WearProblem,
    step_depth: float,
    max_steps: int = 10000,
    on_row: Callable[[WearRow], None] | None = None,
    resume: WearHistory | None = None,
) -> WearHistory:
    """Wear the contact by the thesis's rule until every pair is separated over the whole cycle.

    step_depth : largest depth that one step may wear, v_w,max [m]; Z is floored to whole cycles, but at least one
    on_row : called with each finished row, for checkpoints and progress
    resume : rows of an interrupted run of the same problem; the run goes on after them to the same numbers
    Returns the history; its `end` says why it stopped, also where a solve failed
    """
    if not step_depth > 0:
        raise ValueError("the wear step must be a positive depth")
    rate_of = wear_law.load(problem.law).depth_rate
    coefficient = np.broadcast_to(np.asarray(problem.coefficient, float), problem.area.shape)
    initial_gap = problem.balance.parameters.gap
    rows: list[WearRow] = []
    depth, cycles = np.zeros_like(problem.area), 0.0
    if resume is not None and len(resume.cycles):
        rows = resume.rows()
        depth, cycles = rows[-1].depth + rows[-1].worn, rows[-1].cycles + rows[-1].cycles_in_step
        if rows[-1].cycles_in_step == 0:
            return resume
    end = f"stopped after {max_steps} wear steps"
    while len(rows) < max_steps:
        balance = problem.balance.with_gap(initial_gap + depth)
        point = _locate(problem, balance, rows)
        exposure = wear_law.Exposure(balance, point.state, problem.area, coefficient, depth, cycles)
        rate = rate_of(exposure)
        fastest = float(rate.max())
        reason = _reason_to_stop(point, fastest)
        whole = 0.0 if reason else max(1.0, np.floor(step_depth / fastest))  # eq. 3.30
        row = WearRow.of(balance, point, depth, cycles, whole, whole * rate)
        rows.append(row)
        if on_row is not None:
            on_row(row)
        if reason:
            end = reason
            break
        depth = depth + row.worn  # eq. 3.31, total of both surfaces
        cycles += whole
    return history(rows, end)


def _locate(problem: WearProblem, balance: HarmonicBalance, rows: list[WearRow]) -> OperatingPoint:
    if not rows:
        return problem.site.first(balance)
    last = rows[-1]
    x = last.displacement.reshape(balance.parameters.n_pair, -1, balance.basis.n_coeff)
    before = problem.balance.with_gap(balance.parameters.gap - last.worn)
    guess = x + before.gap_response(before.evaluate(last.omega, x), last.worn)
    point = problem.site.next(balance, last.omega, guess)
    if point.solution.converged:
        return point
    x, solves = _carry(before, last.omega, x, last.worn)
    again = problem.site.next(balance, last.omega, x)
    return replace(again, solves=again.solves + point.solves + solves)


def _carry(before: HarmonicBalance, omega: float, x: np.ndarray, opening: np.ndarray) -> tuple[np.ndarray, int]:
    """Follow x at fixed frequency while the gaps open, in steps that halve where Newton fails; x and solves spent."""
    gap, done, stride, solves = before.parameters.gap, 0.0, 0.5, 0
    while done < 1.0 and stride > 1e-3:
        reach = min(1.0, done + stride)
        here, there = before.with_gap(gap + done * opening), before.with_gap(gap + reach * opening)
        guess = x + here.gap_response(here.evaluate(omega, x), (reach - done) * opening)
        solution = newton.solve(there, omega, guess)
        solves += 1
        if solution.converged:
            x, done, stride = solution.state.x, reach, 1.5 * stride
        else:
            stride *= 0.5
    return x, solves


def _reason_to_stop(point: OperatingPoint, fastest: float) -> str:
    if not point.solution.converged:
        return f"solve failed at {point.state.omega / (2 * np.pi):.6g} Hz: {point.solution.outcome}"
    if np.all(point.state.cycle.status == contact_law.SEPARATES):
        return LOST
    if fastest <= 0.0:
        return "no pair slips any more: wear has stopped"
    return ""
