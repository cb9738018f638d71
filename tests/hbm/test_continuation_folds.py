"""A fold of a response is located in few solves, however coarse they are."""

import numpy as np
import pytest

from tests.helpers.continuation_models import Duffing
from tribodyn.hbm.continuation import curve_segment, parameter
from tribodyn.hbm.continuation.bordered import Direction, Metric
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.newton import NewtonOptions


@pytest.fixture(scope="module")
def duffing_branch():
    return arc_length.follow(Duffing().balance(), 0.5, 5.0)


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
