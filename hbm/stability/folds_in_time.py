"""Where a branch of periodic motions ends in time: the folds of a response curve, found by time integration alone.

At a fold a stable branch of a response curve ends, and the motion leaves it. A truncated balance puts the fold at a
frequency of its own; here the frequency is bisected at which the integrated motion, started on the stable branch,
still stays near it. Harmonic balance only says where to begin and which motions there are to fall to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.outcome import CONVERGED, Outcome, SolveEnd
from tribodyn.hbm.stability import exponents
from tribodyn.hbm.threads import single
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.time_integration import PeriodicMotion
from tribodyn.refusal import Refusal

SEARCH_OPTIONS = Options(steps=512, tolerance=1e-7, max_periods=400)
MARCH_OPTIONS = replace(SEARCH_OPTIONS, accelerate=False, max_periods=800, patience=800)
POINTS_BESIDE = 2  # from the fold, where stability says which side is the stable one: at the fold both are neutral


@dataclass(frozen=True)
class FoldInTime:
    """A fold of the balance and the end of the same branch in time.

    point : of the fold in the branch; omega : of the fold by harmonic balance [rad/s]
    in_time : last frequency at which the integrated motion stays on the branch [rad/s]; amplitude : there [m]
    resolution : to which in_time is known, relative
    outcome : CONVERGED, or why there is no such frequency within the bracket
    """

    point: int
    omega: float
    in_time: float
    amplitude: float
    resolution: float
    outcome: Outcome[SolveEnd]

    @property
    def is_located(self) -> bool:
        """Whether the end of the branch in time was found within the bracket."""
        return self.outcome.kind is SolveEnd.CONVERGED


def amplitude_in_time(balance: HarmonicBalance, motion: PeriodicMotion, output: str) -> float:
    """Vibration amplitude of an output in time integration, as hbm.continuation.branch.amplitude counts it [m]."""
    return float(np.sqrt(2) * motion.outputs[balance.compliance.output_names.index(output)].std())


def march(balance: HarmonicBalance, state: State, omega: float, options: Options = MARCH_OPTIONS) -> PeriodicMotion:
    """Time integration from a balance state, at a frequency [rad/s] that may be another than its own."""
    return time_integration.integrate(balance, omega, balance.evaluate(omega, state.x), options)


@single
def solutions_at(
    balance: HarmonicBalance, branch: Branch, omega: float, points: tuple[int, int] | None = None
) -> list[State]:
    """All solutions of a curve at one frequency [rad/s], in the order of the curve.

    points : first and last point of the stretch that is looked at, the whole curve by default
    """
    first, last = (0, len(branch.omega) - 1) if points is None else points
    offset = branch.omega[first : last + 1] - omega
    states = []
    for i in np.flatnonzero(offset[:-1] * offset[1:] < 0):
        share = offset[i] / (offset[i] - offset[i + 1])
        x = (1 - share) * branch.contact[first + i] + share * branch.contact[first + i + 1]
        solution = newton.solve(balance, omega, balance.shaped(x))
        if solution.converged:
            states.append(solution.state)
    return states


@single
def fold_in_time(
    balance: HarmonicBalance,
    branch: Branch,
    fold: int,
    output: str,
    options: Options = SEARCH_OPTIONS,
    bracket: float = 0.02,
    bisections: int = 8,
) -> FoldInTime:
    """Bisect for the frequency at which, in time, the stable branch ends that a fold of the balance ends.

    fold : index of the fold's point, one of branch.folds; output : whose amplitude is given
    bracket : distance to the fold, relative, within which the end is looked for
    Raises  ValueError where the point is no fold; IntegrationFailed as time integration does
    """
    if fold not in branch.folds:
        raise Refusal(f"point {fold} of the branch is no fold, the folds are {list(branch.folds)}")
    stable_stretch, partner = _stable_side(balance, branch, fold)
    other_stretches = [
        other_stretch for other_stretch in _stretches(branch) if other_stretch not in (stable_stretch, partner)
    ]
    at_fold = balance.evaluate(branch.omega[fold], balance.shaped(branch.contact[fold]))
    side = np.sign(branch.omega[fold - 1] - branch.omega[fold])
    inside, outside = (float(branch.omega[fold] * (1 + s * bracket)) for s in (side, -side))
    last, stayed, has_left = float(branch.amplitude(output)[fold]), False, False
    for _ in range(bisections):
        omega = 0.5 * (inside + outside)
        solutions = solutions_at(balance, branch, omega, stable_stretch)
        start = (solutions[-1] if stable_stretch[1] == fold else solutions[0]) if solutions else at_fold
        other_states = [
            state for other_stretch in other_stretches for state in solutions_at(balance, branch, omega, other_stretch)
        ]
        motion = march(balance, start, omega, options)
        final_x = motion.coefficients(motion.x, balance.basis)
        distance = np.linalg.norm(final_x - start.x)
        if motion.periodic and all(distance < np.linalg.norm(final_x - other.x) for other in other_states):
            inside, last, stayed = omega, amplitude_in_time(balance, motion, output), True
        else:
            outside, has_left = omega, True
    hertz = branch.omega[fold] / (2 * np.pi)
    outcome = CONVERGED
    if not stayed:
        outcome = SolveEnd.LEAVES_BRANCH.say(f" {100 * bracket:g} % of its fold at {hertz:.6g} Hz")
    elif not has_left:
        outcome = SolveEnd.STAYS_ON_BRANCH.say(f" {100 * bracket:g} % beyond its fold at {hertz:.6g} Hz")
    return FoldInTime(fold, float(branch.omega[fold]), inside, last, 2 * bracket / 2**bisections, outcome)


def _stretches(branch: Branch) -> list[tuple[int, int]]:
    """First and last point of each stretch of a curve between its folds."""
    ends = [0, *sorted(branch.folds), len(branch.omega) - 1]
    return list(pairwise(ends))


def _stable_side(balance: HarmonicBalance, branch: Branch, fold: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """The stretch that ends stable at a fold, and the other one."""
    stretches: Sequence[tuple[int, int]] = _stretches(branch)
    before, after = (next(s for s in stretches if s[end] == fold) for end in (1, 0))
    growth = []
    for point in (max(fold - POINTS_BESIDE, before[0]), min(fold + POINTS_BESIDE, after[1])):
        state = balance.evaluate(branch.omega[point], balance.shaped(branch.contact[point]))
        growth.append(float(exponents.stability(balance, state).exponents.real.max()))
    return (before, after) if growth[0] <= growth[1] else (after, before)
