"""The steps of a wear run taken again with one number changed: differences that derivatives of a life have to meet."""

from dataclasses import replace

import numpy as np

from tribodyn.hbm.derivatives.parameter_change import BalanceInputs, ParameterChange
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.wear import tangent
from tribodyn.hbm.wear.history import StepScheme
from tribodyn.hbm.wear.sdirk_stages import FrequencySearch, initial_guess, solve_stages
from tribodyn.hbm.wear.wear_problem import assess
from tribodyn.hbm.wear.wear_rows import state_of

EXACT, STEP = NewtonOptions(tolerance=1e-12), 1e-6


def exactly(problem, **site):
    """The problem with solutions to rounding at its only place, whose other settings are given."""
    (duty,) = problem.mission
    return replace(problem, mission=(replace(duty, site=replace(duty.site, newton=EXACT, **site)),))


def again(problem, worn, end, longer):
    """Cycles, largest depth and volume behind the steps of a run of another problem, and ln of the preload left.

    longer : factor on all steps"""
    rows = worn.rows()
    state = assess(problem, np.zeros_like(problem.area), 0.0, state_of(problem, rows[0]))
    first = problem.preload_of(state)
    for i, row in enumerate(rows[:end]):
        stride = longer * row.cycles_in_step
        if worn.scheme == StepScheme.IMPLICIT:
            drift, slopes = initial_guess(problem, state_of(problem, row), rows[:i], problem)
            state = solve_stages(
                problem, state, stride, drift / longer, [FrequencySearch(float(slope)) for slope in slopes]
            )[1]
        else:
            state = assess(problem, state.depth + stride * state.rate, state.cycles + stride, state)
        assert not state.failure
    remaining = np.log(problem.preload_of(state) / first)
    return np.array([state.cycles, state.depth.max(), problem.area @ state.depth]), remaining


def elasticity_anew(worn, share, problem_of, guess):
    """Central difference of runs whose steps keep their shares of a life that ends at the same share of the preload.

    problem_of : factor on the number -> problem; guess : the elasticity of the life, near it"""
    end, h = int(np.flatnonzero(worn.preload < share * worn.preload[0])[0]), 1e-4
    equal = problem_of(1.0)
    values, remaining = again(equal, worn, end, 1.0)
    slope = (again(equal, worn, end, 1 + h)[1] - remaining) / h
    sides = []
    for factor in (1 + h, 1 - h):
        longer, problem = 1 + guess * (factor - 1), problem_of(factor)
        longer -= (again(problem, worn, end, longer)[1] - remaining) / slope
        sides.append(again(problem, worn, end, longer)[0])
    return (sides[0] - sides[1]) / (2 * h) / values


def derivatives_of_life(problem, worn, build, names, share, numbers=None):
    """By numbers of contact and loads, and of the wear law; build : name, factor on its number -> problem."""
    sides = {name: [BalanceInputs.of(build(name, 1 + side).balance) for side in (STEP, -STEP)] for name in names}
    changes = [ParameterChange(name, STEP, *pair) for name, pair in sides.items()]
    return tangent.of_life(problem, worn, changes, numbers or {"coefficient": ("coefficient", ["contact"])}, share)
