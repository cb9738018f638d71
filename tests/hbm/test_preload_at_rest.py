"""The preload that is left when the vibration stops, as the end of a wear run."""

import numpy as np
import pytest
from scipy.optimize import root

from tests.helpers.pressed_body import N_PAIR, wear_problem
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import WearEnd
from tribodyn.hbm.wear.history import WearHistory, cycles_to_preload
from tribodyn.hbm.wear.rules import error_controlled, thesis
from tribodyn.hbm.wear.step_control import Tolerance
from tribodyn.hbm.wear.wear_loop import evolve
from tribodyn.hbm.wear.wear_problem import WearProblem


def worn(problem: WearProblem, rule: str, max_steps: int = 10_000, resume: WearHistory | None = None) -> WearHistory:
    if rule == "thesis":
        return evolve(thesis.Rule(problem, 2e-6), max_steps, None, resume)
    return evolve(error_controlled.Rule(problem, Tolerance(0.05, 1e-5)), max_steps, None, resume)


@pytest.fixture(scope="module")
def problem() -> WearProblem:
    return wear_problem(lost_below=0.0, lost_below_at_rest=0.4)


def static_preload(problem: WearProblem, depth: np.ndarray) -> float:
    """The same by a general solver for nonlinear equations: springs that open and slip, no harmonics, no balance."""
    model, parameters = problem.balance.model, problem.balance.contact.joints[0].parameters
    B, flexibility = np.asarray(model.interface.B), np.linalg.inv(model.system.stiffness)
    free = B @ flexibility @ (100.0 * model.system.loads["press"])
    C = B @ flexibility @ B.T

    def forces(x: np.ndarray) -> np.ndarray:
        u, k = x.reshape(N_PAIR, 3), parameters.stiffness
        normal = np.maximum(k[:, 2] * (u[:, 2] - depth), 0.0)
        limit = (np.asarray(parameters.numbers["friction"]) * normal)[:, None]
        return np.column_stack([np.clip(k[:, :2] * u[:, :2], -limit, limit), normal])

    result = root(lambda x: x - free + C @ forces(x).ravel(), np.zeros(3 * N_PAIR), tol=1e-12)
    assert result.success
    return float(forces(result.x)[:, 2].sum())


@pytest.mark.parametrize("rule", ["thesis", "error_controlled"])
def test_a_run_ends_where_the_preload_at_rest_is_lost(problem: WearProblem, rule: str) -> None:
    result = worn(problem, rule)
    at_rest = result.preload_at_rest
    assert str(result.end) == f"{WearEnd.LOST_AT_REST.say()} 0.4 of its first value"
    assert at_rest[-1] <= 0.4 * at_rest[0] < at_rest[-2]
    assert result.cycles_in_step[-1] == 0.0
    life = cycles_to_preload(result, 0.4)
    assert life is not None
    assert result.cycles[-2] < life <= result.cycles[-1]
    for row in (0, len(at_rest) // 3):
        assert at_rest[row] == pytest.approx(static_preload(problem, result.depth[row]), rel=1e-6)
    assert (np.diff(at_rest) < 0).all()
    assert np.abs(at_rest[0] / result.preload[0] - 1) > 1e-3  # another number than the mean force while it vibrates


def test_steps_before_the_end_are_those_of_a_run_that_does_not_look(problem: WearProblem) -> None:
    searched, plain = worn(problem, "thesis"), worn(wear_problem(lost_below=0.0), "thesis", 12)
    assert plain.preload_at_rest is None
    n = min(len(searched.cycles), 12) - 1
    assert np.array_equal(searched.depth[:n], plain.depth[:n])
    assert np.array_equal(searched.cycles[:n], plain.cycles[:n])


@pytest.mark.parametrize("rule", ["thesis", "error_controlled"])
def test_a_resumed_run_ends_at_the_same_row(problem: WearProblem, rule: str) -> None:
    full = worn(problem, rule)
    repeated = worn(problem, rule, resume=worn(problem, rule, 3))
    assert np.array_equal(full.depth, repeated.depth)
    assert full.end == repeated.end
    np.testing.assert_allclose(repeated.preload_at_rest, full.preload_at_rest, rtol=1e-7)


def test_a_contact_without_static_normal_force_has_no_preload_at_rest(problem: WearProblem) -> None:
    item = problem.balance
    shaken = Excitation.of({}, {1: {"shake": 60.0}})
    unpressed = HarmonicBalance.of(item.model, item.contact.joints, HarmonicBasis((1,), 64), shaken, 1500.0)
    with pytest.raises(ValueError, match="component n and harmonic 0"):
        wear_problem(balance=unpressed, lost_below_at_rest=0.5)
