"""`./tribodyn prove branches`: random friction problems followed both ways, and a judge that sees what is wrong."""

import json
from dataclasses import replace

import numpy as np
import pytest

from proof import branches
from proof.__main__ import main
from tests.helpers.command import leave
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import arc_length

FOLDS_OF_168 = (209.0526659, 209.0735379, 214.7464873, 214.7524408)  # [rad/s], as the way down finds them
FOLDS_OF_18 = (182.3982312, 182.3994060)  # [rad/s], as the way up finds them; 6e-6 of the frequency apart


def test_curves_that_slip_lift_and_fold_are_followed_both_ways(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = leave(["branches", "--problems", "3", "--first", "5", "--json"], capsys, main)
    assert code == 0, err
    rows = json.loads(out)
    assert [row["outcome"] for row in rows] == ["followed"] * 3
    assert [row["folds"] for row in rows] == [2, 0, 2]
    assert all(row["slips"] and row["lifts"] and row["defect"] < branches.DEFECT for row in rows)
    assert "problem 7: followed" in err


@pytest.mark.slow
@pytest.mark.parametrize(("number", "folds"), [(29, 12), (39, 8), (43, 6), (53, 6), (95, 18), (137, 24)])
def test_no_pair_of_folds_is_stepped_over(number: int, folds: int) -> None:
    row = branches.judged(number)
    assert (row.outcome, row.folds) == (branches.FOLLOWED, folds), row.reason


@pytest.mark.slow
def test_twenty_problems_are_followed_with_the_same_folds_both_ways() -> None:
    rows = branches.run(range(20), lambda _: None)
    assert all(row.outcome == branches.FOLLOWED for row in rows), branches.as_text(rows)


def test_two_folds_close_together_are_not_stepped_over() -> None:
    inputs = branches.problem(18)
    down = arc_length.follow(inputs.balance, inputs.high, inputs.low)
    assert np.sort(down.omega[list(down.folds)]) == pytest.approx(FOLDS_OF_18, rel=1e-8)


def test_two_folds_within_one_step_are_both_found() -> None:
    inputs = branches.problem(168)
    up = arc_length.follow(inputs.balance, inputs.low, inputs.high)
    assert np.sort(up.omega[list(up.folds)]) == pytest.approx(FOLDS_OF_168, rel=1e-8)


def test_the_judge_sees_points_off_the_curve_lost_folds_and_gaps() -> None:
    inputs = branches.problem(7)
    up = arc_length.follow(inputs.balance, inputs.low, inputs.high)
    good = branches.checked(inputs.balance, up)
    assert good < branches.DEFECT
    assert branches.verdict(up, replace(up, **_backwards(up)), good)[0] == branches.FOLLOWED
    off = replace(up, contact=up.contact * 1.01)
    assert branches.checked(inputs.balance, off) > branches.DEFECT
    outcome, reason = branches.verdict(up, replace(up, **_backwards(up) | {"folds": ()}), good)
    assert outcome == branches.WRONG
    assert reason == "2 folds upwards and 0 downwards, or not the same"
    stepped = replace(up, end=replace(up.end, detail=f"{up.end.detail}; stepped over gaps in the curve at 3 Hz"))
    assert branches.verdict(stepped, up, good)[0] == branches.REFUSED


def _backwards(branch: Branch) -> dict[str, object]:
    turned = tuple(len(branch.omega) - 1 - i for i in branch.folds)
    return {"omega": branch.omega[::-1], "contact": branch.contact[::-1], "folds": turned}


def test_the_table_counts_by_load() -> None:
    row = branches.Curve(3, 2.0, 1, 2, branches.FOLLOWED, "", 50, 2, True, True, 1e-4, 1.5)
    refused = replace(row, seed=4, load=20.0, outcome=branches.REFUSED, reason="up: ended at 3 Hz")
    lines = branches.as_text([row, refused]).splitlines()
    assert lines[1].split() == ["1", "to", "3", "1", "1", "0", "0", "1", "1", "2"]
    assert lines[2].split() == ["from", "10", "1", "0", "1", "0", "1", "1", "2"]
    assert lines[3] == "problem 4, refused: up: ended at 3 Hz"
    assert np.isfinite(branches.problem(3).load)
