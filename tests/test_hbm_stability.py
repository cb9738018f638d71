"""Hill's method and Floquet multipliers: against eigenvalues, finite differences, each other, and turns of a branch."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import fsolve

from hbm import newton, parameter, time_integration
from hbm.balance import HarmonicBalance
from hbm.branch import BranchBuilder
from hbm.excitation import Excitation
from hbm.floquet import monodromy
from hbm.harmonics import HarmonicBasis
from hbm.law import ContactParameters
from hbm.newton import Solution
from hbm.stability import Stability, mark, stability
from hbm.time_integration import Options, TimeStepper
from reduction.model import ReducedModel
from tests.verification_models import oscillator, random_structure

OMEGA = 305.3


def balance_of(friction: float, static: float, shaker: float, top: int) -> HarmonicBalance:
    model = random_structure(3)
    parameters = ContactParameters.of(("t1", "t2", "n"), model.interface.stiffness(3e6, 5e6), friction=friction)
    excitation = Excitation.of({"static": static}, {1: {"shaker": shaker}})
    basis = HarmonicBasis(tuple(range(top + 1)), 512)
    return HarmonicBalance(model, "jenkins", parameters, basis, excitation, 1.2 * OMEGA)


@pytest.mark.parametrize(("method", "smallest", "error"), [("hill", 0.0, 1e-9), ("floquet", 0.5, 0.02)])
def test_exponents_of_a_stuck_contact_are_eigenvalues(method, smallest, error):
    balance = balance_of(friction=1e9, static=0.0, shaker=1.0, top=3)
    balance = balance.with_gap(np.full(3, -1e-4))  # pressed together by interference
    solution = newton.solve_from_rest(balance, OMEGA)
    assert np.all(solution.state.cycle.status == 1)
    system, b = balance.model.system, np.asarray(balance.model.interface.B)
    stiffness = system.stiffness + b.T @ (balance.parameters.stiffness.ravel()[:, None] * b)
    n = len(stiffness)
    inverse = np.linalg.inv(system.mass)
    first_order = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ system.damping]])
    expected = np.exp(np.linalg.eigvals(first_order) * 2 * np.pi / OMEGA)
    result = stability(balance, solution.state, method, n_modes=n)
    assert result.stable
    assert len(result.exponents) == 2 * n
    for value in expected[np.abs(expected) > smallest]:
        assert np.abs(result.multipliers - value).min() < error


def test_modes_left_out_of_hill_follow_statically():
    balance = balance_of(friction=0.3, static=30.0, shaker=60.0, top=5)
    state = newton.solve_from_rest(balance, OMEGA).state
    few, all_modes = stability(balance, state, n_modes=8), stability(balance, state, n_modes=13)
    assert len(few.exponents) == 16
    assert few.exponents[0].real == pytest.approx(all_modes.exponents[0].real, rel=0.01)


def test_monodromy_with_friction_is_the_finite_difference_of_the_period_map():
    balance = balance_of(friction=0.3, static=30.0, shaker=60.0, top=7)
    state = newton.solve_from_rest(balance, OMEGA).state
    options = Options(steps=256, tolerance=1e-11)
    stepper = TimeStepper(balance, OMEGA, options)
    motion = time_integration.integrate(balance, OMEGA, state, options, with_slopes=True)
    exact = np.linalg.eigvals(monodromy(stepper, motion))
    start = stepper.start_from(state)
    for _ in range(300):
        start, record = stepper.period(start)
    assert np.all(record.bits == 7)
    n = len(start.eta)
    unit = np.repeat([1 / OMEGA, 1.0, OMEGA, 1 / OMEGA], [n, n, n, start.memory.size])

    def end_of(change: np.ndarray) -> np.ndarray:
        eta, v, a, memory = np.split(unit * change, [n, 2 * n, 3 * n])
        moved = (start.eta + eta, start.v + v, start.a + a, start.memory + memory.reshape(start.memory.shape))
        end, _ = stepper.period(stepper.motion(*moved))
        return np.concatenate([end.eta, end.v, end.a, end.memory.ravel()]) / unit

    step = 1e-6 * np.abs(start.v).max() * np.eye(len(unit))
    columns = [(end_of(e) - end_of(-e)) / (2 * e.max()) for e in step]
    approximate = np.linalg.eigvals(np.array(columns).T)
    for value in exact[np.abs(exact) > 0.05]:
        assert np.abs(approximate - value).min() < 1e-6


def test_hill_and_floquet_agree_on_a_flip_from_which_a_plain_march_departs():
    balance = balance_of(friction=0.0, static=30.0, shaker=60.0, top=15)
    state = newton.solve_from_rest(balance, OMEGA).state
    assert np.all(state.cycle.status == 6)
    hill, floquet = stability(balance, state), stability(balance, state, "floquet")
    assert not hill.stable
    assert not floquet.stable
    assert hill.crossing == floquet.crossing == "flip"
    np.testing.assert_allclose(hill.multipliers[0], floquet.multipliers[0], rtol=0.01)
    np.testing.assert_allclose(hill.exponents[:7].real, floquet.exponents[:7].real, rtol=0.03)
    plain = time_integration.integrate(balance, OMEGA, state, Options(accelerate=False, max_periods=60))
    mixed = time_integration.integrate(balance, OMEGA, state, Options())
    assert plain.outcome.startswith("not periodic")
    assert mixed.outcome == "converged"


def test_fold_of_a_lifting_mass_is_marked_where_the_branch_turns():
    mass, stiffness, kn = 1.0, 1e4, 4e4
    parameters = ContactParameters.of(("t1", "n"), [[1.0, kn]], friction=0.0)
    excitation = Excitation.of({"normal": 50.0}, {1: {"normal": 3.0}})
    basis = HarmonicBasis((0, 1, 2, 3, 4, 5), 512)
    balance = HarmonicBalance(oscillator(mass, stiffness, 0.01), "jenkins", parameters, basis, excitation, 300.0)
    lift = 50.0 / (stiffness + kn)  # amplitude at which contact is lost
    builder = BranchBuilder(parameter.of(balance))

    def equations(unknown, amplitude):
        x = np.zeros((1, 2, basis.n_coeff))
        x[0, 1] = unknown[:-1] * lift
        state = balance.evaluate(unknown[-1] * 200.0, x, jacobian=False)
        return np.r_[state.residual[1] / lift, np.hypot(*unknown[1:3]) - amplitude]

    guess = np.r_[1.0, 0.5, 0, np.zeros(8), 0.9]
    for amplitude in np.linspace(0.4, 2.4, 81):  # up the left flank, through the fold
        guess, *_ = fsolve(equations, guess, args=(amplitude,), xtol=1e-12, full_output=True)
        x = np.zeros((1, 2, basis.n_coeff))
        x[0, 1] = guess[:-1] * lift
        state = balance.evaluate(guess[-1] * 200.0, x)
        assert np.abs(state.residual).max() < 1e-9 * lift
        builder.add(state.omega, Solution(state, "converged", 0, 0, ()))
    branch = builder.finish("reached the amplitude asked for")
    turn = int(np.argmax(branch.omega))
    assert 10 < turn < 70
    a, b, c = np.polyfit(np.arange(-2, 3), branch.omega[turn - 2 : turn + 3], 2)
    marks = mark(balance, branch)
    assert [m.kind for m in marks.bifurcations] == ["fold"]
    assert marks.bifurcations[0].position == pytest.approx(turn - b / (2 * a), abs=0.5)
    assert marks.bifurcations[0].omega == pytest.approx(c - b * b / (4 * a), rel=1e-4)
    assert np.all(marks.stable[: turn - 1])
    assert not np.any(marks.stable[turn + 2 :])
    assert np.all(marks.leading[turn + 2 :].imag == pytest.approx(0.0, abs=1e-3))
    x = branch.contact[turn + 16].reshape(1, 2, -1)
    unstable = balance.evaluate(branch.omega[turn + 16], x)
    by_time, by_hill = stability(balance, unstable, "floquet"), stability(balance, unstable)
    assert by_time.multipliers[0] == pytest.approx(by_hill.multipliers[0], rel=0.02)


def test_names_and_refusals():
    model = oscillator(1.0, 1e4, 0.01)
    parameters = ContactParameters.of(("t1", "n"), [[1e4, 1e4]])
    excitation = Excitation.of({"normal": 1.0}, {1: {"force": 1.0}})
    balance = HarmonicBalance(model, "jenkins", parameters, HarmonicBasis((0, 1), 32), excitation, 200.0)
    state = newton.solve_from_rest(balance, 100.0).state
    with pytest.raises(ValueError, match="no stability method"):
        stability(balance, state, "guess")
    cyclic = ReducedModel(model.system, model.interface, per_harmonic=lambda h: (model.system, np.eye(2)))
    other = HarmonicBalance(cyclic, "jenkins", parameters, HarmonicBasis((0, 1), 32), excitation, 200.0)
    with pytest.raises(ValueError, match="one system for all harmonics"):
        stability(other, state)
    assert Stability(10.0, np.array([1.0 + 3j]), "hill").crossing == "Neimark-Sacker"
