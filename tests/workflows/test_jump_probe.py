"""How far more harmonics move the jump of a wear run to another peak."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.helpers.pressed_body import wear_problem
from tribodyn.hbm.continuation.operating_point import AtPeak, OperatingPoint
from tribodyn.hbm.wear.error_controlled_rule import jumps
from tribodyn.hbm.wear.evolution import Duty
from tribodyn.workflows.accuracy import jump_probe

SITE = AtPeak("tip", 250.0, 1200.0)
ROWS = [
    SimpleNamespace(plan=np.ones(2), omega=900.0),
    SimpleNamespace(plan=np.zeros(2), omega=880.0),  # the step behind it ended at another peak
    SimpleNamespace(plan=np.ones(2), omega=450.0),
    SimpleNamespace(plan=np.zeros(2), omega=449.0),  # a leap on the same branch
    SimpleNamespace(plan=np.ones(2), omega=448.0),
]


def test_a_jump_is_a_step_without_a_plan_to_another_frequency() -> None:
    rows: Any = ROWS
    assert jumps(rows) == [1]
    thesis: Any = [SimpleNamespace(plan=np.zeros(0), omega=omega) for omega in (900.0, 450.0)]
    assert jumps(thesis) == []


@pytest.mark.parametrize(
    ("first_overtaken", "moved"),
    [(-0.04, 0.05 * 0.75), (-0.01, 0.025 * 0.75), (0.03, 0.05 * 0.75), (0.25, 0.3 * 0.75), (0.5, None)],
)
def test_the_change_of_life_is_bounded_from_the_side_on_which_the_answer_changes(
    first_overtaken: float, moved: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The slower peak dissipates a quarter of the faster one: each cycle of delay costs three quarters of one."""
    monkeypatch.setattr(jump_probe, "_sweep_with_more", lambda *given: lambda share: share >= first_overtaken)
    wear: Any = SimpleNamespace(rows=lambda: ROWS, energy=np.array([[1.0], [1.0], [4.0], [4.0], [4.0]]))
    nothing: Any = None
    found = jump_probe.life_moved(nothing, wear, Duty(SITE), 1e6)
    assert found == (None if moved is None else pytest.approx(moved))
    wear.rows = lambda: ROWS[2:]
    assert jump_probe.life_moved(nothing, wear, Duty(SITE), 1e6) == 0.0


def _worn_at(point: OperatingPoint, cycles: list[float]) -> Any:
    """A history whose contact moves as at a point all the time, and does not wear."""
    x = point.state.x
    return SimpleNamespace(
        displacement=np.stack([x.reshape(-1, x.shape[-1])] * len(cycles)),
        cycles=np.array(cycles),
        depth=np.zeros((len(cycles), len(x))),
        omega=np.full(len(cycles), point.state.omega),
    )


def test_the_sweep_with_more_harmonics_meets_the_higher_peak() -> None:
    balance = wear_problem().balance
    highest, lower = SITE.first(balance), AtPeak("tip", 500.0, 545.0).first(balance)
    for point, overtaken in ((lower, True), (highest, False)):
        wear = _worn_at(point, [0.0, 1.0])
        assert jump_probe._sweep_with_more(balance, wear, Duty(SITE), 0, 1.0)(0.0) is overtaken


def test_a_run_that_stays_at_a_lower_peak_is_told_of_the_higher_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The lower peak at 523 rad/s is passed by the one that a sweep of the whole range meets; nothing passes that."""
    balance = wear_problem().balance
    highest, lower = SITE.first(balance), AtPeak("tip", 500.0, 545.0).first(balance)
    cycles = [0.0, 4e5, 1e6]
    assert jump_probe.peak_above(balance, _worn_at(highest, cycles), Duty(SITE), 1e6) == ""
    told = jump_probe.peak_above(balance, _worn_at(lower, cycles), Duty(SITE), 1e6)
    assert told.endswith(" Hz after 4e+05 cycles, and wear goes on there")
    met = float(told.split(" at ")[1].split()[0])
    assert met == pytest.approx(highest.state.omega / (2 * np.pi), rel=0.01)  # here without more harmonics
    monkeypatch.setattr(jump_probe._Sweep, "at", lambda *given: None)
    with pytest.raises(ValueError, match="is lost with harmonics 0 to 7"):
        jump_probe.peak_above(balance, _worn_at(lower, cycles), Duty(SITE), 1e6)
