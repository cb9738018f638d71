"""The table of extremes in its quick form, and that its judge sees a wrong number."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from proof import __main__ as cli
from proof.hard_settings import extremes, extremes_march, extremes_wear
from proof.hard_settings.extremes_judge import judged, sampled_honestly, solve_and_judge
from proof.hard_settings.extremes_march import march_checks
from proof.hard_settings.extremes_models import lattice, rigid
from tests.helpers.pressed_body import growth_by_few_modes
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.wear.rules import thesis
from tribodyn.hbm.wear.step_control import first_order_error
from tribodyn.hbm.wear.wear_loop import evolve


def test_no_cell_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside a reference of wear that is as coarse as its own error may be, which the judge allows for."""
    monkeypatch.setattr(extremes_wear, "TIGHT", 1e-2)
    monkeypatch.setattr(extremes_wear, "_references", {})
    monkeypatch.setattr(extremes_wear, "MOST_STEPS", 50)
    with growth_by_few_modes():
        cli.app(["extremes", "--quick", "--json", "--out", str(tmp_path / "table.png")], result_action="return_value")
    rows = json.loads(capsys.readouterr().out)
    assert (tmp_path / "table.png").stat().st_size > 10_000
    assert len(rows) > 50
    assert {row["outcome"] for row in rows} == {"converged", "refused"}
    assert sum(row["outcome"] == "converged" for row in rows) > 0.8 * len(rows)
    assert all(len(row["reason"]) > 10 for row in rows)


def test_the_full_table_has_at_least_300_cells() -> None:
    assert sum(1 for _ in extremes.cells(quick=False)) >= 300


@pytest.mark.parametrize("transitions", ["located", "sampled"])
def test_a_solution_that_is_slightly_off_is_seen(transitions: str) -> None:
    body = lattice(2, 2)
    balance = body.balance(replace(body.ordinary, transitions=transitions))
    verdict, solution = solve_and_judge(balance, body.ordinary.omega)
    assert verdict.outcome == "converged"
    assert "friction of a plain march, normal of a plain march, work of a plain march, equilibrium" in verdict.reason
    x = solution.state.x.copy()
    x[0, 0, 1] *= 1 + 1e-6
    assert judged(balance, balance.evaluate(body.ordinary.omega, x)).outcome == "wrong"


@pytest.mark.parametrize(
    ("transitions", "changes"), [("located", {}), ("located", {"tangential": 1e9}), ("sampled", {"preload": 0.0})]
)
def test_a_contact_force_or_an_energy_off_by_a_thousandth_is_seen(transitions: str, changes: dict[str, float]) -> None:
    """The march shares nothing with the solver's law, which all other checks believe."""
    body = lattice(2, 2)
    balance = body.balance(replace(body.ordinary, transitions=transitions, **changes))
    state = solve_and_judge(balance, body.ordinary.omega)[1].state

    def told(verdict: State) -> set[str]:
        return {
            march_check.name for march_check in march_checks(balance, verdict) if march_check.off > march_check.allowed
        }

    assert not told(state)
    for part, name in ((np.s_[:, :-1], "friction"), (np.s_[:, -1:], "normal")):
        force = state.cycle.force.copy()
        force[part] *= 1.001
        assert name in told(replace(state, cycle=replace(state.cycle, force=force)))


@pytest.mark.parametrize("transitions", ["located", "sampled"])
def test_a_friction_work_off_by_a_thousandth_is_seen(transitions: str, monkeypatch: pytest.MonkeyPatch) -> None:
    body = lattice(3, 3)
    balance = body.balance(replace(body.ordinary, transitions=transitions))
    state = solve_and_judge(balance, body.ordinary.omega)[1].state
    energy = HarmonicBalance.energy
    monkeypatch.setattr(HarmonicBalance, "energy", lambda self, state: 1.001 * energy(self, state))
    assert [
        march_check.name for march_check in march_checks(balance, state) if march_check.off > march_check.allowed
    ] == ["work"]


def test_the_march_finds_the_loop_of_a_jenkins_element() -> None:
    """Masing's loop under constant pressure: work 4 mu N (u - mu N / k), force mu N where it ends."""
    body = rigid(1)
    balance = body.balance(replace(body.ordinary, harmonics=(0, 1)))
    k, pressed, u = balance.contact.stiffness[0, 0], 100.0, 3e-4
    x = np.zeros((1, 2, 3))
    x[0, 0, 1], x[0, 1, 0] = u, pressed / balance.contact.stiffness[0, 1]
    force, _, work, doubt = extremes_march._marched(balance, balance.evaluate(1100.0, x), 1024)
    limit = 0.4 * pressed
    expected = 4 * limit * (u - limit / k)
    assert work[0] == pytest.approx(expected, rel=1e-5)
    assert abs(work[0] - expected) < doubt[0]
    turned = np.arccos(1 - 2 * limit / (k * u))  # the angle through which it sticks after each end
    sine = -expected / (np.pi * u)
    cosine = (k * u * (2 * turned - np.sin(2 * turned))) / (2 * np.pi)
    assert force[0, 0, 1:] == pytest.approx([cosine, sine], rel=3e-5)


def test_what_nobody_declared_is_wrong_and_what_is_declared_is_refused() -> None:
    def surprise() -> extremes.Verdict:
        raise ZeroDivisionError("division by zero")

    def refusal() -> extremes.Verdict:
        raise ValueError("friction must be finite")

    assert extremes.outcome_of(surprise).outcome == "wrong"
    refused = extremes.outcome_of(refusal)
    assert (refused.outcome, refused.reason) == ("refused", "friction must be finite")


@pytest.mark.parametrize(("samples", "force"), [(6, 60.0), (8, 30.0), (12, 60.0), (48, 60.0), (192, 60.0)])
def test_the_estimate_of_sampling_covers_its_error(samples: int, force: float) -> None:
    """Also where a first step from it, relative to what was solved, tells 30 % of 43 and 24 % of 33."""
    body = rigid(3)
    balance = body.balance(replace(body.ordinary, samples=samples, transitions="sampled", force=force))
    verdict = sampled_honestly(balance, solve_and_judge(balance, body.ordinary.omega)[1].state)
    assert verdict.outcome == "converged"
    assert verdict.deviation > 0


def test_a_response_that_the_samples_spoil_is_refused() -> None:
    body = rigid(1)
    balance = body.balance(replace(body.ordinary, samples=4, transitions="sampled"))
    verdict = sampled_honestly(balance, solve_and_judge(balance, body.ordinary.omega)[1].state)
    assert verdict.outcome == "refused"
    assert "the error estimate of the samples is above 50%" in verdict.reason


def test_a_contact_that_sticks_does_not_wear() -> None:
    """What rounding leaves of the work of a stuck pair was once taken for slow wear, 1e25 cycles of it."""
    body = lattice(3, 3)
    gentle = replace(body.ordinary, force=12.0)
    balance = body.balance(gentle)
    _, solution = solve_and_judge(balance, gentle.omega)
    assert np.all(solution.state.cycle.status == 1)
    assert not balance.energy(solution.state).any()


def test_the_error_of_wear_steps_falls_with_the_step() -> None:
    problem, delta = extremes_wear._problem(rigid(4))
    runs = [evolve(thesis.Rule(problem, share * delta)) for share in (0.2, 0.05, 0.0125)]
    estimates = [first_order_error(run).cycles for run in runs]
    assert estimates == sorted(estimates, reverse=True)
