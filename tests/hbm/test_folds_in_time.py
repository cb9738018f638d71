"""Ends of branches in time: those of a Duffing oscillator, where many harmonics and time integration agree."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from proof.coexisting import coexisting
from tests.helpers.continuation_models import Duffing
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.stability.folds_in_time import fold_in_time, solutions_at
from tribodyn.hbm.time.stepper import Options

QUICK = Options(steps=256, tolerance=1e-6, max_periods=400)
DUFFING = Duffing(zeta=0.05, force=0.3)


def branch_of(harmonics: tuple[int, ...]) -> Branch:
    return arc_length.follow(DUFFING.balance(harmonics, 128), 0.7, 2.5)


@pytest.mark.parametrize("which", [0, 1])
def test_a_fold_in_time_is_where_several_harmonics_have_it(which: int) -> None:
    """The first harmonic alone leads to the same fold in time, but is farther from it."""
    off = []
    for harmonics in ((1,), (1, 3, 5)):
        branch = branch_of(harmonics)
        fold = branch.folds[which]
        result = fold_in_time(DUFFING.balance(harmonics, 128), branch, fold, "mass", QUICK, bracket=0.04)
        assert result.outcome == CONVERGED
        assert result.resolution == pytest.approx(0.08 / 256)
        assert result.amplitude == pytest.approx(branch.amplitude("mass")[fold], rel=0.15)
        off.append(abs(result.omega / result.in_time - 1))
    assert off[1] < 3 * result.resolution
    assert off[1] <= off[0]


def test_the_upper_branch_ends_there_for_another_integrator() -> None:
    """Runge-Kutta of the equation itself: swept slowly to just below the fold it stays up, just above it falls."""
    branch = branch_of((1, 3, 5))
    fold = max(branch.folds, key=lambda i: branch.omega[i])
    result = fold_in_time(DUFFING.balance((1, 3, 5)), branch, fold, "mass", QUICK, bracket=0.04)
    stationary = []
    for omega in (result.in_time * 0.995, result.in_time * 1.01):
        state = solutions_at(DUFFING.balance((1, 3, 5)), branch, result.in_time * 0.995)
        a, b = max((s.x[0, 0, :2] for s in state), key=np.linalg.norm)

        def motion(t: float, y: np.ndarray, w: float = omega) -> list[float]:
            x, v = y
            return [v, 0.3 * np.cos(w * t) - 2 * 0.05 * v - x - x**3]

        period = 2 * np.pi / omega
        end = solve_ivp(motion, (0, 150 * period), [a, omega * b], rtol=1e-8, t_eval=np.linspace(149, 150, 65) * period)
        stationary.append(float(np.ptp(end.y[0]) / 2))
    assert stationary[0] > 0.9 * result.amplitude
    assert stationary[1] < 0.5 * result.amplitude


def test_of_three_solutions_the_middle_one_is_left_in_time() -> None:
    balance, branch = DUFFING.balance((1, 3), 64), branch_of((1, 3))
    low, high = sorted(branch.omega[list(branch.folds)])
    omega, three = coexisting(balance, branch, low, high, "mass", 5)
    assert low < omega < high
    assert [item.stable for item in three] == [True, False, True]
    assert [item.returns for item in three] == [True, False, True]
    assert three[1].growth > 0 > max(three[0].growth, three[2].growth)


def test_what_is_no_fold_is_refused() -> None:
    with pytest.raises(ValueError, match="point 0 of the branch is no fold"):
        fold_in_time(DUFFING.balance(), branch_of((1,)), 0, "mass")


def test_a_bracket_that_ends_before_the_fold_in_time_says_so() -> None:
    branch = branch_of((1,))
    fold = max(branch.folds, key=lambda i: branch.omega[i])
    result = fold_in_time(DUFFING.balance((1,)), branch, fold, "mass", QUICK, bracket=1e-5, bisections=2)
    assert str(result.outcome).startswith(("no motion stays", "the motion stays"))
