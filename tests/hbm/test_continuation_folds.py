"""Folds against a second parameter: closed form, round the cusp, against branches traced anew, and refusals."""

import numpy as np
import pytest

from tests.helpers.continuation_models import Duffing, Lifting
from tribodyn.hbm.continuation import curve_segment, parameter
from tribodyn.hbm.continuation.bordered import Direction, Metric
from tribodyn.hbm.continuation.fold_curve import FoldOptions, track_fold
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.newton import NewtonOptions


@pytest.fixture(scope="module")
def duffing_branch():
    return arc_length.follow(Duffing().balance(), 0.5, 5.0)


@pytest.mark.parametrize("number", [0, 1])
def test_fold_against_the_load_is_where_the_discriminant_vanishes(duffing_branch, number):
    duffing, branch = Duffing(), duffing_branch
    i = branch.folds[number]
    x = branch.contact[i].reshape(1, 1, -1)
    line = track_fold(parameter.load(duffing.balance(), 2.0), 1.0, 0.1, branch.omega[i], x)
    assert str(line.end) == "reached load factor 0.1"
    assert line.parameter[0] == 1.0
    assert line.parameter[-1] == 0.1
    assert len(line.omega) < 50
    for factor, omega, amplitude in zip(line.parameter, line.omega, line.amplitude("mass"), strict=True):
        assert np.abs(duffing.folds(factor=factor) / omega - 1).min() < 1e-8
        stiffness = 1 - omega**2 + 0.75 * amplitude**2
        np.testing.assert_allclose(amplitude * np.hypot(stiffness, 2 * duffing.zeta * omega), 0.3 * factor, rtol=1e-6)


def test_two_folds_meet_in_a_cusp_and_the_line_goes_round_it(duffing_branch):
    duffing, branch = Duffing(), duffing_branch
    i, other = branch.folds
    x = branch.contact[i].reshape(1, 1, -1)
    line = track_fold(parameter.load(duffing.balance(), 2.0), 1.0, 0.01, branch.omega[i], x)
    assert str(line.end) == "turned back to load factor 1"
    assert len(line.cusps) == 1
    assert duffing.cusp <= line.parameter.min() < 1.01 * duffing.cusp
    np.testing.assert_allclose(line.omega[-1], branch.omega[other], rtol=1e-8)


@pytest.mark.parametrize(("make", "start", "stop"), [("gap", 0.0, 0.3), ("stiffness", 1.0, 0.5)])
def test_fold_of_a_lifting_mass_against_branches_traced_anew(make, start, stop):
    balance = Lifting().balance(transitions="located")
    branch = arc_length.follow(balance, 0.5, 4.0)
    i = max(branch.folds, key=lambda i: branch.omega[i])
    path = getattr(parameter, make)(balance, 1.6)
    line = track_fold(path, start, stop, branch.omega[i], branch.contact[i].reshape(1, 1, -1))
    assert line.parameter[-1] == stop
    assert line.parameter_name == path.name
    for k in (len(line.omega) // 2, -1):
        repeated = arc_length.follow(path.make(line.parameter[k]), 0.5, 4.0)
        assert np.abs(repeated.omega[list(repeated.folds)] / line.omega[k] - 1).min() < 1e-8


def test_fold_of_a_sampled_contact_is_followed_over_its_kinks():
    """64 samples: no derivative of the scalar to rely on, yet the line stays on folds."""
    balance = Lifting().balance(n_samples=64)
    branch = arc_length.follow(balance, 0.5, 1.9, arc_length.Options(bounds=(0.4, 2.5), max_points=60))
    i = branch.folds[0]
    line = track_fold(parameter.load(balance, 1.6), 1.0, 2.0, branch.omega[i], branch.contact[i].reshape(1, 1, -1))
    assert str(line.end) == "reached load factor 2"
    repeated = arc_length.follow(balance.with_load(2.0), 0.5, 1.9, arc_length.Options(max_points=60))
    np.testing.assert_allclose(line.omega[-1], repeated.omega[repeated.folds[0]], rtol=1e-6)


def test_it_refuses_what_has_no_fold(duffing_branch):
    balance, branch = Duffing().balance(), duffing_branch
    path = parameter.load(balance, 2.0)
    x = branch.contact[0].reshape(1, 1, -1)
    with pytest.raises(ValueError, match="no fold near"):
        track_fold(path, 0.01, 0.02, 0.5, 0.01 * x)
    with pytest.raises(ValueError, match="not against the frequency"):
        track_fold(parameter.of(balance), 0.5, 1.0, 0.5, x)
    with pytest.raises(ValueError, match="start and stop are the same"):
        track_fold(path, 1.0, 1.0, 0.5, x)
    i = branch.folds[0]
    small = track_fold(path, 1.0, 0.1, branch.omega[i], branch.contact[i].reshape(1, 1, -1), FoldOptions(max_points=3))
    assert str(small.end).endswith("3 points were allowed")
    assert len(small.omega) == 3


def test_a_fold_whose_points_rounding_holds_in_place_is_found_in_few_solves(duffing_branch, monkeypatch):
    """Solves that are accurate to 3e-3 only: the tangent of each has the same sign, however often it is asked."""
    exact, rows, solves = curve_segment.bordered.correct, [], []

    def rounded(path, guess, border, metric, options):
        solves.append(guess.p)
        for point, solution in rows:
            if metric.norm(guess - point) < 3e-3:
                return solution, point.p
        solution, value = exact(path, guess, border, metric, options)
        rows.append((Direction(solution.state.flat, value), solution))
        return solution, value

    balance = Duffing().balance()
    i = duffing_branch.folds[0]
    place = [Direction(duffing_branch.contact[j].reshape(1, -1), duffing_branch.omega[j]) for j in (i - 1, i + 1)]
    metric = Metric(float(np.linalg.norm(place[0].x)), 1.0)
    direction = metric.unit(place[1] - place[0])
    path, newton = parameter.of(balance), NewtonOptions()
    ends = []
    for at in place:
        solution, value = exact(path, at, direction, metric, newton)
        tangent = curve_segment.bordered.tangent(path, value, solution.state, direction, metric, newton, 1e-6)
        ends.append(curve_segment.CurvePoint.of(value, solution, tangent))
    monkeypatch.setattr(curve_segment.bordered, "correct", rounded)
    fold = curve_segment.locate_fold(path, curve_segment.Segment(*ends, metric), newton, 1e-9)
    assert len(solves) < 20
    np.testing.assert_allclose(fold.value, duffing_branch.omega[i], rtol=1e-7)
