"""The table of extremes in its quick form, and that its judge sees a wrong number."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tribodyn.hbm.wear.step_error import step_error
from tribodyn.workflows.benchmarks import extremes, extremes_wear
from tribodyn.workflows.benchmarks.extremes_judge import judged, sampled_honestly, tried
from tribodyn.workflows.benchmarks.extremes_march import force_error
from tribodyn.workflows.benchmarks.extremes_models import lattice, rigid
from tribodyn.workflows.command import main as cli


def test_no_cell_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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
    verdict, solution = tried(balance, body.ordinary.omega)
    assert verdict.outcome == "converged"
    assert "forces of a plain march, equilibrium of every coordinate" in verdict.reason
    x = solution.state.x.copy()
    x[0, 0, 1] *= 1 + 1e-6
    assert judged(balance, balance.evaluate(body.ordinary.omega, x)).outcome == "wrong"


@pytest.mark.parametrize(("transitions", "share"), [("located", 2e-2), ("sampled", 1e-9)])
def test_a_contact_force_that_is_slightly_off_is_seen(transitions: str, share: float) -> None:
    """The march shares nothing with the solver's law, which all other checks believe."""
    body = lattice(2, 2)
    balance = body.balance(replace(body.ordinary, transitions=transitions))
    state = tried(balance, body.ordinary.omega)[1].state
    off, allowed = force_error(balance, state)
    assert off <= allowed
    wrong = replace(state, cycle=replace(state.cycle, force=(1 + share) * state.cycle.force))
    off, allowed = force_error(balance, wrong)
    assert off > allowed


def test_what_nobody_declared_is_wrong_and_what_is_declared_is_refused() -> None:
    def surprise() -> extremes.Verdict:
        raise ZeroDivisionError("division by zero")

    def refusal() -> extremes.Verdict:
        raise ValueError("friction must be finite")

    assert extremes.outcome_of(surprise).outcome == "wrong"
    refused = extremes.outcome_of(refusal)
    assert (refused.outcome, refused.reason) == ("refused", "friction must be finite")


@pytest.mark.parametrize("samples", [12, 48, 192])
def test_the_estimate_of_sampling_covers_its_error(samples: int) -> None:
    body = rigid(3)
    balance = body.balance(replace(body.ordinary, samples=samples, transitions="sampled"))
    verdict = sampled_honestly(balance, tried(balance, body.ordinary.omega)[1].state)
    assert verdict.outcome == "converged"
    assert verdict.deviation > 0


def test_a_contact_that_sticks_does_not_wear() -> None:
    """What rounding leaves of the work of a stuck pair was once taken for slow wear, 1e25 cycles of it."""
    body = lattice(3, 3)
    gentle = replace(body.ordinary, force=12.0)
    balance = body.balance(gentle)
    _, solution = tried(balance, gentle.omega)
    assert np.all(solution.state.cycle.status == 1)
    assert not balance.energy(solution.state).any()


def test_the_error_of_wear_steps_falls_with_the_step() -> None:
    problem, delta = extremes_wear._problem(rigid(4))
    estimates = [step_error(extremes_wear.thesis_rule.evolve(problem, s * delta)).cycles for s in (0.2, 0.05, 0.0125)]
    assert estimates == sorted(estimates, reverse=True)
