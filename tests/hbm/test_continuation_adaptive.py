"""Adaptive points: interpolation error at the tolerance, far fewer points than equidistant ones, jumps told."""

import numpy as np
import pytest

from tests.helpers.continuation_models import Duffing, rubbing_mass
from tribodyn.hbm.continuation import parameter
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import adaptive, natural
from tribodyn.hbm.continuation.methods.adaptive import Options
from tribodyn.hbm.continuation.methods.natural import EXTRAPOLATION_DEGREE, extrapolate
from tribodyn.hbm.outcome import BranchEnd


def interpolate(branch: Branch, values: np.ndarray) -> np.ndarray:
    """Response between the points of a branch, by the cubic through the four nearest points.

    values : (n,) of the stepped parameter, within the branch
    Returns (n, n_output, n_coeff) Fourier coefficients of the outputs [m]"""
    order = np.argsort(branch.parameter)
    reference, response = branch.parameter[order], branch.response[order]
    window = min(EXTRAPOLATION_DEGREE + 1, len(reference))
    first = np.clip(np.searchsorted(reference, values) - window // 2, 0, len(reference) - window)
    pieces = [(slice(i, i + window), value) for i, value in zip(first, values, strict=True)]
    return np.stack([extrapolate(reference[piece], list(response[piece]), value) for piece, value in pieces])


def worst(branch: Branch, reference: Branch) -> float:
    """Largest error of interpolation, relative to the largest response."""
    miss = interpolate(branch, reference.omega) - reference.response
    return float(np.linalg.norm(miss, axis=(1, 2)).max() / np.linalg.norm(reference.response, axis=(1, 2)).max())


@pytest.mark.parametrize(("case", "share"), [("friction", 0.35), ("resonance", 0.1)])
def test_points_lie_where_the_response_bends(case, share):
    balance = rubbing_mass(transitions="located") if case == "friction" else Duffing(zeta=1e-3, cubic=0.0).balance()
    reference = natural.follow(balance, 0.5, 2.0, natural.Options(n_points=2001))
    for tolerance in (1e-2, 1e-3):
        branch = adaptive.follow(balance, 0.5, 2.0, Options(tolerance=tolerance))
        assert str(branch.end) == f"reached {2.0 / (2 * np.pi):.6g} Hz"
        assert branch.converged.all()
        assert np.all(np.diff(branch.omega) > 0)
        error = worst(branch, reference)
        assert error < 5 * tolerance
        equidistant = natural.follow(balance, 0.5, 2.0, natural.Options(n_points=round(len(branch.omega) / share)))
        assert worst(equidistant, reference) > error
    gaps = np.diff(branch.omega)
    assert gaps.max() > 20 * gaps.min()


def test_error_falls_with_the_tolerance_and_both_ways_agree():
    balance = rubbing_mass(transitions="located")
    reference = natural.follow(balance, 0.5, 2.0, natural.Options(n_points=2001))
    errors = [worst(adaptive.follow(balance, 0.5, 2.0, Options(tolerance=t)), reference) for t in (3e-2, 3e-3, 3e-4)]
    assert errors[0] > errors[1] > errors[2]
    back = adaptive.follow(balance, 2.0, 0.5, Options(tolerance=3e-3))
    assert back.omega[0] == 2.0
    assert back.omega[-1] == 0.5
    assert worst(back, reference) < 5 * 3e-3


def test_a_sweep_jumps_at_the_fold_and_says_so():
    duffing = Duffing()
    low, high = duffing.folds()
    for start, stop, fold in ((0.5, 4.0, high), (4.0, 0.5, low)):
        branch = adaptive.follow(duffing.balance(), start, stop, Options(tolerance=1e-3))
        assert branch.omega[-1] == stop
        assert branch.ended is BranchEnd.JUMPED
        jump = 2 * np.pi * float(str(branch.end).split()[-2])
        np.testing.assert_allclose(jump, fold, rtol=1e-4)
        amplitude = branch.amplitude("mass")
        assert np.abs(duffing.defect(branch.omega, amplitude)).max() < 1e-5


def test_a_rough_response_is_not_crawled_along():
    """Loads that differ by a fifth; a point a little further than the shortest step is taken, too."""
    balance = Duffing().balance()

    def shaken(value: float):
        return balance.with_load(1 + 0.2 * np.random.default_rng(int(1e12 * value)).uniform())

    branch = adaptive.follow(parameter.Parameter("place", shaken, 0.3), 0.0, 1.0, Options(min_step=2.5e-5))
    assert branch.parameter[-1] == 1.0
    assert 200 < len(branch.parameter) < 800


def test_it_steps_other_parameters_and_ends_in_words():
    balance = Duffing().balance()
    branch = adaptive.follow(parameter.load(balance, 1.0), 0.0, 2.0)
    assert branch.parameter_name == "load factor"
    assert branch.parameter[-1] == 2.0
    small = adaptive.follow(balance, 0.5, 2.0, Options(max_points=5))
    assert str(small.end).endswith("5 points were allowed")
    with pytest.raises(ValueError, match="tolerance"):
        Options(tolerance=0.0)
    with pytest.raises(ValueError, match="min_step <= step"):
        Options(step=0.5)
