"""Wear with fewer harmonics where no solution with all of them follows: contacts that impact.

A run keeps the harmonics that it was asked for. Where a step finds no solution with them, the lower half carries on,
and each later step takes up more again, as far as they have a solution. Rows keep all coefficients, with zeros in the
harmonics that were left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.wear.evolution import WearProblem, WearState, worn_state
from tribodyn.hbm.wear.history import LARGEST_SHIFT, WearRow

LEAST_HARMONIC = 3  # up to which harmonics are kept where no solution with more follows


def settled(whole: WearProblem, state: WearState) -> tuple[WearProblem, WearState]:
    """The problem with as many harmonics as a solution near a state is found with, and the state in it.

    A state that was solved with fewer harmonics than the problem has carries zeros in the others.
    """
    harmonics = whole.balance.basis.harmonics
    top = top_harmonic(whole.balance.basis, [point.state.x for point in state.points])
    count = 1 + harmonics.index(top)
    if count == len(harmonics):
        return whole, state
    problem = _with_harmonics(whole, harmonics[:count])
    state = carried(problem, state)
    while problem is not whole:
        more = _with_harmonics(whole, harmonics[: 2 * len(problem.balance.basis.harmonics)])
        points, solves = [], state.solves
        for duty, point in zip(more.mission, carried(more, state).points, strict=True):
            balance = more.in_duty(duty, state.depth)
            found = duty.site.solve_near(balance, point.state.omega, point.state.x)
            solves += found.solves
            far = abs(found.state.omega - point.state.omega) > LARGEST_SHIFT * point.state.omega
            if far or not found.solution.converged:
                return problem, replace(state, solves=solves)
            points.append(found)
        at_rest = (state.preload_at_rest, state.lost)
        found_with_more = worn_state(more, state.depth, state.cycles, points, solves)
        if not found_with_more.rate.max() > 0:  # another motion, which slips nowhere: no step follows from it
            return problem, replace(state, solves=solves)
        state = replace(found_with_more, preload_at_rest=at_rest[0], lost=at_rest[1])
        problem = more
    return problem, state


def with_fewer(problem: WearProblem) -> WearProblem | None:
    """The problem with the lower half of its harmonics, those that loads need among them; None where that is all."""
    harmonics = problem.balance.basis.harmonics
    half = (len(harmonics) + 1) // 2
    needed = _needed(problem, LEAST_HARMONIC)
    kept = tuple(h for i, h in enumerate(harmonics) if h <= needed or i < half)
    return None if kept == harmonics else _with_harmonics(problem, kept)


def of_scans(whole: WearProblem) -> WearProblem:
    """The problem with the harmonics that scans for peaks have."""
    return _with_harmonics(
        whole, tuple(h for h in whole.balance.basis.harmonics if h <= _needed(whole, AtPeak.scan_harmonic))
    )


def _needed(problem: WearProblem, least: int) -> int:
    """The highest harmonic that loads have, at least some."""
    return max([least, *(h for h, _ in problem.balance.excitation.loads)])


def _with_harmonics(problem: WearProblem, kept: tuple[int, ...]) -> WearProblem:
    """The problem with some of its harmonics."""
    if kept == problem.balance.basis.harmonics:
        return problem
    mission = tuple(
        duty if duty.balance is None else replace(duty, balance=duty.balance.with_harmonics(kept))
        for duty in problem.mission
    )
    return replace(problem, balance=problem.balance.with_harmonics(kept), mission=mission)


def carried(problem: WearProblem, state: WearState) -> WearState:
    """A state in the same problem with other harmonics: those that it lacks are dropped, new ones are zero."""
    if all(point.state.x.shape[2] == problem.balance.basis.n_coeff for point in state.points):
        return state
    points = []
    for duty, point in zip(problem.mission, state.points, strict=True):
        balance = problem.in_duty(duty, state.depth)
        x = np.zeros((*point.state.x.shape[:2], balance.basis.n_coeff))
        common = min(x.shape[2], point.state.x.shape[2])
        x[..., :common] = point.state.x[..., :common]
        there = replace(point.solution, state=balance.evaluate(point.state.omega, x))
        points.append(OperatingPoint.of(balance, there, duty.site.output, point.solves))
    made = worn_state(problem, state.depth, state.cycles, points, state.solves)
    return replace(made, preload_at_rest=state.preload_at_rest, lost=state.lost)


def top_harmonic(basis: HarmonicBasis, displacements: Sequence[np.ndarray]) -> int:
    """The highest harmonic in which any displacement (..., n_coeff) is not zero; of the basis where none moves."""
    moves = np.any([np.any(x.reshape(-1, x.shape[-1]) != 0, axis=0) for x in displacements], axis=0)
    order = basis.order[: len(moves)][moves]
    return int(order.max()) if order.size and order.max() > 0 else basis.harmonics[-1]


def reported(basis: HarmonicBasis, rows: Sequence[WearRow]) -> str:
    """What is reported of rows that no solution with all harmonics was found for; empty where there are none."""
    tops = [top_harmonic(basis, list(row.duty_displacement)) for row in rows]
    few = [i for i, top in enumerate(tops) if top < basis.harmonics[-1]]
    if not few:
        return ""
    first, last = rows[few[0]].cycles, rows[min(few[-1] + 1, len(rows) - 1)].cycles
    share = sum(rows[i].cycles_in_step for i in few) / rows[-1].cycles if rows[-1].cycles else 1.0
    return (
        f"; {share:.0%} of the cycles, from {first:.3g} to {last:.3g}, with harmonics up to "
        f"{min(tops[i] for i in few)} at least, where no periodic motion with all of them follows"
    )
