"""A first solution by stiffening the contact: from springs so soft that Newton solves them at once to their own ones.

Contacts far stiffer than the body that lift and slip have forces that change by their own size over displacements far
below that of the body. Two things then fail: Newton from rest, whose first steps open and close every pair in turn, and
its directions, whose products are of single precision: what the free structure resists is lost beside the springs.
Here directions come from the dense Jacobian in double precision, steps are damped by how far the next direction would
go (which no scaling of the equations changes), and the logarithm of the stiffness is raised in steps as long as that
converges, each start extrapolated from the last two. The end is held to the same tolerance as any other solution.
Source  damping by the natural level function: Deuflhard 2004, Newton Methods for Nonlinear Problems, 3.3
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg as sla

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.threads import single

DECADES = 13  # by which the springs are softened at most
SHORTEST = 0.02  # step of the decimal logarithm of the stiffness
GROWTH = 1.6  # of a step after one that converged
MOST_STEPS = 400  # of Newton on the whole way
LEAST_LENGTH = 1e-4  # of a damped step
NEAR = 1e-6  # next step over the displacement at the end: beside stiff springs a residual alone tells too little
ROUNDING = 1e-15  # relative change of the displacement that may be rounding
FORCE_KNOWN = 1e-5  # change of the contact forces by that, beyond which they are not known


@single
def solve_along_stiffness(balance: HarmonicBalance, omega: float, options: NewtonOptions) -> Solution | None:
    """A solution at one frequency [rad/s], None where there is no way to it or the dense Jacobian is too large."""
    if balance.n_unknown > newton.MOST_DENSE:
        return None
    left = MOST_STEPS
    for decade in range(DECADES + 1):
        soft = _softened(balance, -float(decade))
        found, steps = _damped(soft, omega, soft.stuck(omega), options)
        left -= steps
        if found is not None:
            break
        if left <= 0:
            return None
    else:
        return None
    level, x, stride = -float(decade), found.x, 1.0
    before: tuple[float, np.ndarray] | None = None
    while level < 0 and stride > SHORTEST and left > 0:
        target = min(0.0, level + stride)
        stiffer = _softened(balance, target)
        starts = [x] if before is None else [x + (x - before[1]) * (target - level) / (level - before[0]), x]
        for start in starts:
            found, steps = _damped(stiffer, omega, start, options)
            left -= steps
            if found is not None:
                break
        if found is None:
            stride *= 0.5
        else:
            before, level, x, stride = (level, x), target, found.x, GROWTH * stride
    if level < 0:
        return None
    solution = newton.solve(balance, omega, x, options)
    if not solution.converged or _rounded(balance, solution.state) > FORCE_KNOWN:
        return None
    return replace(solution, steps=solution.steps + MOST_STEPS - left)


def _rounded(balance: HarmonicBalance, state: State) -> float:
    """Largest change of a component of the contact forces, over its own size, when x changes by rounding."""
    beside = np.random.default_rng(0).uniform(-1, 1, state.x.shape)
    moved = balance.evaluate(state.omega, state.x * (1 + ROUNDING * beside), False).cycle.force - state.cycle.force
    sizes = [(np.linalg.norm(moved[:, i]), np.linalg.norm(state.cycle.force[:, i])) for i in range(moved.shape[1])]
    return max((float(change / size) for change, size in sizes if size > 0), default=0.0)


def _softened(balance: HarmonicBalance, level: float) -> HarmonicBalance:
    """The same problem with all contact springs times ten to the level."""
    if level == 0.0:
        return balance
    contact = balance.contact.with_parameters(lambda p: replace(p, stiffness=p.stiffness * 10.0**level))
    made = HarmonicBalance.of(
        balance.model, contact.joints, balance.basis, balance.excitation, balance.omega_max, balance.memory
    )
    return replace(made, load_factor=balance.load_factor)


def _damped(
    balance: HarmonicBalance, omega: float, start: np.ndarray, options: NewtonOptions
) -> tuple[State | None, int]:
    """Newton with exact directions; the state, None where it does not converge, and the steps spent."""
    x_lin = balance.x_lin(omega)
    state = balance.evaluate(omega, start)
    for step in range(options.max_steps):
        small = newton.relative_residual(state, x_lin) <= newton.wanted(balance, state, x_lin, options)
        try:
            factor = sla.lu_factor(balance.linearise(state).dense(), check_finite=True)
        except ValueError:  # numbers beyond all bounds
            return None, step
        with np.errstate(all="ignore"):
            direction = sla.lu_solve(factor, -state.residual.ravel(), check_finite=False)
        size, length = float(np.linalg.norm(direction)), 1.0
        near = size <= NEAR * float(np.linalg.norm(state.x))
        if not np.isfinite(size) or (small and near):
            return (state if small and near else None), step
        while length > LEAST_LENGTH:
            trial = balance.evaluate(omega, state.x + length * direction.reshape(state.x.shape))
            following = sla.lu_solve(factor, trial.residual.ravel(), check_finite=False)
            if float(np.linalg.norm(following)) <= (1 - 0.25 * length) * size:
                break
            length *= 0.5
        else:
            return None, step
        state = trial
    return None, options.max_steps
