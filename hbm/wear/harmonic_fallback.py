"""Wear with fewer harmonics where no solution with all of them follows: contacts that impact.

Where a step finds no solution with all harmonics, it takes the lower half of them; each later step adds harmonics again
as far as a solution with them is found. Rows have all coefficients, with zeros in the harmonics that were not used."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tribodyn.hbm.continuation.operating_point import OperatingPoint
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.wear.history import LARGEST_SHIFT, WearRow
from tribodyn.hbm.wear.wear_problem import WearProblem, WearState, worn_state

LEAST_HARMONIC = 3  # up to which harmonics are kept where no solution with more follows


def with_most_harmonics(full_problem: WearProblem, state: WearState) -> tuple[WearProblem, WearState]:
    """The problem with as many harmonics as a solution near a state is found with, and the state in it.

    A state that was solved with fewer harmonics than the problem has carries zeros in the others."""
    harmonics = full_problem.balance.basis.harmonics
    top = top_harmonic(full_problem.balance.basis, [point.state.x for point in state.points])
    count = 1 + harmonics.index(top)
    if count == len(harmonics):
        return full_problem, state
    problem = _with_harmonics(full_problem, harmonics[:count])
    state = converted(problem, state)
    while problem is not full_problem:
        finer = _with_harmonics(full_problem, harmonics[: 2 * len(problem.balance.basis.harmonics)])
        refined, solves = _solved_nearby(finer, state)
        if refined is None:
            return problem, replace(state, solves=solves)
        problem, state = finer, refined
    return problem, state


def _solved_nearby(finer: WearProblem, state: WearState) -> tuple[WearState | None, int]:
    """The state solved with more harmonics, None where there is no solution nearby that wears; solves in all."""
    points, solves = [], state.solves
    for duty, point in zip(finer.mission, converted(finer, state).points, strict=True):
        balance = finer.in_duty(duty, state.depth)
        solved = duty.site.solve_near(balance, point.state.omega, point.state.x)
        solves += solved.solves
        is_far = abs(solved.state.omega - point.state.omega) > LARGEST_SHIFT * point.state.omega
        if is_far or not solved.solution.converged:
            return None, solves
        points.append(solved)
    refined = worn_state(finer, state.depth, state.cycles, points, solves)
    if not refined.rate.max() > 0:  # another motion, which slips nowhere: no step follows from it
        return None, solves
    return replace(refined, preload_at_rest=state.preload_at_rest, lost=state.lost), solves


def with_fewer(problem: WearProblem) -> WearProblem | None:
    """The problem with the lower half of its harmonics, those that loads need among them; None where that is all."""
    harmonics = problem.balance.basis.harmonics
    half = (len(harmonics) + 1) // 2
    needed = _needed(problem, LEAST_HARMONIC)
    selected = tuple(h for i, h in enumerate(harmonics) if h <= needed or i < half)
    return None if selected == harmonics else _with_harmonics(problem, selected)


def scan_problem(full_problem: WearProblem) -> WearProblem:
    """The problem with the harmonics that scans for peaks have."""
    return _with_harmonics(
        full_problem,
        tuple(h for h in full_problem.balance.basis.harmonics if h <= _needed(full_problem, AtPeak.scan_harmonic)),
    )


def _needed(problem: WearProblem, least: int) -> int:
    """The highest harmonic that loads have, at least some."""
    return max([least, *(h for h, _ in problem.balance.excitation.loads)])


def _with_harmonics(problem: WearProblem, harmonics: tuple[int, ...]) -> WearProblem:
    """The problem with some of its harmonics; its cycles are looked for, as a known start has all of them."""
    if harmonics == problem.balance.basis.harmonics:
        return problem
    mission = tuple(
        replace(duty, start=None, balance=duty.balance and duty.balance.with_harmonics(harmonics))
        for duty in problem.mission
    )
    return replace(problem, balance=problem.balance.with_harmonics(harmonics), mission=mission)


def converted(problem: WearProblem, state: WearState) -> WearState:
    """A state in the same problem with other harmonics: those that it lacks are dropped, new ones are zero."""
    if all(point.state.x.shape[2] == problem.balance.basis.n_coeff for point in state.points):
        return state
    points = []
    for duty, point in zip(problem.mission, state.points, strict=True):
        balance = problem.in_duty(duty, state.depth)
        x = np.zeros((*point.state.x.shape[:2], balance.basis.n_coeff))
        common = min(x.shape[2], point.state.x.shape[2])
        x[..., :common] = point.state.x[..., :common]
        solution = replace(point.solution, state=balance.evaluate(point.state.omega, x))
        points.append(OperatingPoint.of(balance, solution, duty.site.output, point.solves))
    result = worn_state(problem, state.depth, state.cycles, points, state.solves)
    return replace(result, preload_at_rest=state.preload_at_rest, lost=state.lost)


def top_harmonic(basis: HarmonicBasis, displacements: Sequence[np.ndarray]) -> int:
    """The highest harmonic in which any displacement (..., n_coeff) is not zero; of the basis where none moves."""
    moves = np.any([np.any(x.reshape(-1, x.shape[-1]) != 0, axis=0) for x in displacements], axis=0)
    order = basis.order[: len(moves)][moves]
    return int(order.max()) if order.size and order.max() > 0 else basis.harmonics[-1]


def remark(basis: HarmonicBasis, rows: Sequence[WearRow]) -> str:
    """What the end of a run states of rows solved with fewer harmonics than all; empty where there are none."""
    tops = [top_harmonic(basis, list(row.duty_displacement)) for row in rows]
    reduced = [i for i, top in enumerate(tops) if top < basis.harmonics[-1]]
    if not reduced:
        return ""
    first, last = rows[reduced[0]].cycles, rows[min(reduced[-1] + 1, len(rows) - 1)].cycles
    share = sum(rows[i].cycles_in_step for i in reduced) / rows[-1].cycles if rows[-1].cycles else 1.0
    return (
        f"; {share:.0%} of the cycles, from {first:.3g} to {last:.3g}, with harmonics up to "
        f"{min(tops[i] for i in reduced)} at least, where no periodic motion with all of them follows"
    )
