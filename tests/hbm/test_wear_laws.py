"""Wear laws: archard beside energy, laws whose depth per work changes, files of one's own."""

from pathlib import Path

import numpy as np
import pytest

from tests.helpers.pressed_body import N_PAIR, life, wear_problem
from tribodyn.hbm.outcome import WearEnd
from tribodyn.hbm.wear import law as wear_law
from tribodyn.hbm.wear.law import JointWear
from tribodyn.hbm.wear.rules import error_controlled, thesis
from tribodyn.hbm.wear.step_control import Tolerance
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import WearProblem


@pytest.fixture(scope="module")
def problem() -> WearProblem:
    return wear_problem()


def test_archard_and_energy_law_agree_up_to_the_uncoupled_directions(problem: WearProblem) -> None:
    point = problem.mission[0].site.solve(problem.balance)
    area = problem.area
    base = {"coefficient": np.ones(N_PAIR)}
    exposure = wear_law.Exposure(problem.balance, point.state, area, base, np.zeros(N_PAIR), 0.0)
    energy = wear_law.load("energy").depth_rate(exposure)
    archard = wear_law.load("archard").depth_rate(exposure)
    slips = energy > 0.05 * energy.max()
    # uncoupled sliders dissipate mu N (|ds1| + |ds2|), which lies between mu N |ds| and sqrt(2) times that
    ratio = energy[slips] / (0.4 * archard[slips])
    assert np.all((ratio > 0.97) & (ratio < 1.03 * np.sqrt(2)))


@pytest.mark.parametrize("law", ["archard"])
def test_error_controlled_rule_takes_laws_whose_depth_per_work_changes(law: str) -> None:
    other = wear_problem(wear=JointWear.of(law, coefficient=4e-10))
    fine = evolve(thesis.Rule(other, 1.5e-6))
    worn = evolve(error_controlled.Rule(other, Tolerance(0.02, 2e-4)))
    assert life(worn) == pytest.approx(life(fine), rel=0.01)


def test_a_law_file_of_ones_own_is_taken_by_both_rules(tmp_path: Path) -> None:
    """The law of the tutorial."""
    law, page = tmp_path / "running_in.py", Path(__file__).parents[2] / "docs" / "tutorials" / "own_law.md"
    law.write_text(page.read_text(encoding="utf-8").partition("```python running_in.py\n")[2].partition("```")[0])
    base = wear_problem(wear=JointWear.of(str(law), coefficient=4e-10))
    fine = evolve(thesis.Rule(base, 1.5e-6))
    worn = evolve(error_controlled.Rule(base, Tolerance(0.02, 2e-4)))
    assert life(worn) == pytest.approx(life(fine), rel=0.015)
    plain_problem = wear_problem(wear=JointWear.of("energy", coefficient=4e-10))
    plain = evolve(error_controlled.Rule(plain_problem, Tolerance(0.02, 2e-4)))
    assert 0.25 * life(plain) < life(worn) < life(plain)  # a fresh face wears four times as fast


@pytest.mark.parametrize(("text", "says"), [(None, "there is no wear law file"), ("x = 1", "no function depth_rate")])
def test_a_file_that_is_no_wear_law_is_refused(tmp_path: Path, text: str | None, says: str) -> None:
    path = tmp_path / "law.py"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match=says):
        wear_law.load(str(path))


@pytest.mark.parametrize(("body", "says"), [
    ("return exposure.enrgy", "cannot be run: AttributeError: .* 'enrgy'"),
    ("return exposure.energy[:1]", r"depths of shape \(1,\) and not"),
    ("return exposure.energy + float('nan')", "not finite"),
])  # fmt: skip
def test_a_wear_law_that_fails_in_the_run_is_told(tmp_path: Path, body: str, says: str) -> None:
    path = tmp_path / "law.py"
    path.write_text(f"def depth_rate(exposure):\n    {body}\n")
    with pytest.raises(ValueError, match=says):
        evolve(thesis.Rule(wear_problem(wear=JointWear.of(str(path))), 5e-7), max_steps=1)


def test_a_law_that_takes_nothing_off_is_not_called_a_contact_at_rest() -> None:
    worn = evolve(thesis.Rule(wear_problem(wear=JointWear.of("energy", coefficient=0.0)), 5e-7))
    assert worn.ended is WearEnd.NO_LOSS


def test_steps_below_the_rounding_of_the_motion_end_the_run() -> None:
    worn = evolve(thesis.Rule(wear_problem(), 1e-30), max_steps=5)
    assert worn.ended is WearEnd.NO_STEP
    assert len(worn.cycles) == 1
    assert "are below rounding: check the static loads" in str(worn.end)
