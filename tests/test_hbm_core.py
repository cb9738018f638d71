"""The compliance form beside the dense algorithm, its derivatives, the tracked peak and both wear rules."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sla

from fem.system import SecondOrderSystem
from hbm import error_controlled_rule, newton, thesis_rule, wear_law
from hbm.balance import HarmonicBalance
from hbm.compliance import ContactCompliance
from hbm.continuation import natural
from hbm.evolution import Duty, WearProblem, assess
from hbm.excitation import Excitation
from hbm.expansion import SingularStuckSystem
from hbm.harmonics import HarmonicBasis
from hbm.law import ContactParameters
from hbm.newton import NewtonOptions
from hbm.operating_point import AtFrequency, AtPeak, BesidePeak
from hbm.reference import DenseBalance
from reduction.model import ReducedModel
from tests.verification_models import interface

N_PAIR = 4


@pytest.fixture(scope="module")
def model() -> ReducedModel:
    """Four pairs on a body that a static load presses and a harmonic one shakes; full damping matrix."""
    rng = np.random.default_rng(3)
    n = 3 * N_PAIR + 60
    factor = rng.normal(size=(n, n))
    stiffness = 2e6 * factor @ factor.T / n + 1e5 * np.eye(n)
    mass = np.eye(n) + 0.1 * np.diag(rng.random(n))
    lam, phi = sla.eigh(stiffness, mass)
    damping = mass @ phi @ np.diag(2 * 0.02 * np.sqrt(lam)) @ phi.T @ mass
    press, shake = np.zeros(n), np.zeros(n)
    press[2 : 3 * N_PAIR : 3] = 1 / N_PAIR
    shake[0 : 3 * N_PAIR : 3] = 1 / N_PAIR
    system = SecondOrderSystem(mass, stiffness, damping, {"press": press, "shake": shake}, {"tip": shake})
    return ReducedModel(system, interface(np.eye(3 * N_PAIR, n), ("t1", "t2", "n")))


def balance_of(model: ReducedModel, harmonics: tuple[int, ...] = (0, 1, 2, 3), shake: float = 60.0) -> HarmonicBalance:
    stiffness = np.tile([2e5, 2e5, 3e5], (N_PAIR, 1)) * np.linspace(0.7, 1.3, N_PAIR)[:, None]
    parameters = ContactParameters.of(("t1", "t2", "n"), stiffness, friction=0.4)
    basis = HarmonicBasis(harmonics, 64, "located")
    excitation = Excitation.of({"press": 100.0}, {1: {"shake": shake}})
    return HarmonicBalance(model, "jenkins", parameters, basis, excitation, 1500.0)


def test_compliance_and_its_slope_equal_direct_solves(model: ReducedModel) -> None:
    balance = balance_of(model)
    compliance = ContactCompliance(model, balance.parameters.stiffness, balance.basis, balance.excitation, 1500.0)
    g = np.random.default_rng(0).normal(size=(3 * N_PAIR, balance.basis.n_coeff))
    system, b = model.at_harmonic(1)
    stuck = system.stiffness + b.T @ (compliance.k[:, None] * b)

    def direct(omega: float) -> np.ndarray:
        force = balance.basis.to_complex(g)
        for column, h in enumerate(balance.basis.harmonics):
            s = 1j * h * omega
            d = stuck + s * system.damping + s * s * system.mass
            force[:, column] = b @ np.linalg.solve(d, b.T @ force[:, column])
        return balance.basis.to_real(force)

    for omega in (0.0, 300.0, 1499.0):
        assert np.abs(compliance.at(omega).apply(g) - direct(omega)).max() < 1e-8 * np.abs(direct(omega)).max()
    slope = (direct(300.01) - direct(299.99)) / 0.02
    assert np.abs(compliance.at(300.0).slope(g)[0] - slope).max() < 1e-4 * np.abs(slope).max()


def test_jacobian_and_frequency_slope_equal_finite_differences(model: ReducedModel) -> None:
    balance = balance_of(model)
    state = newton.solve_from_rest(balance, 400.0).state
    linear = balance.linearise(state)
    direction = np.random.default_rng(1).normal(size=state.x.shape) * 1e-6 * np.abs(state.x).max()
    fore, back = (balance.evaluate(400.0, state.x + sign * direction).residual for sign in (1, -1))
    exact = linear.dense() @ direction.ravel()
    assert np.abs((fore - back).ravel() / 2 - exact).max() < 1e-6 * np.abs(exact).max()
    solved, _, _ = linear.solve(exact.reshape(fore.shape), 1e-10)
    assert np.abs(solved.ravel() - direction.ravel()).max() < 1e-4 * np.abs(direction).max()
    up, down = (balance.evaluate(400.0 + step, state.x).residual for step in (1e-3, -1e-3))
    slope, _ = balance.frequency_slope(state)
    assert np.abs((up - down) / 2e-3 - slope).max() < 1e-6 * np.abs(slope).max()


@pytest.mark.parametrize("harmonics", [(0, 1), (0, 1, 2, 3), (0, 1, 3)])
def test_solution_equals_the_dense_algorithm(model: ReducedModel, harmonics: tuple[int, ...]) -> None:
    balance = balance_of(model, harmonics)
    dense = DenseBalance(balance)
    for omega in (300.0, 500.0):
        fast = newton.solve_from_rest(balance, omega, NewtonOptions(1e-12))
        slow = dense.solve(omega, dense.coordinates_of(omega, fast.state.x), 1e-13)
        assert np.abs(fast.state.x - slow.x).max() < 1e-8 * np.abs(slow.x).max()


def test_nothing_slips_below_the_friction_limit(model: ReducedModel) -> None:
    balance = balance_of(model, shake=1e-3)
    solution = newton.solve(balance, 300.0, balance.stuck(300.0))
    assert solution.steps == 0  # the stuck response is the solution: no balance to iterate
    moved = np.abs(solution.state.x).max() * np.abs(solution.state.cycle.force).max()
    assert np.abs(balance.energy(solution.state)).max() < 1e-15 * moved


def test_tracked_peak_is_that_of_a_fine_sweep(model: ReducedModel) -> None:
    balance = balance_of(model)
    peak = AtPeak("tip", 250.0, 1200.0, tolerance=1e-7).first(balance)
    omega = peak.state.omega
    sweep = natural.follow(balance, 0.99 * omega, 1.01 * omega, natural.Options(201))
    height = sweep.amplitude("tip")
    top = int(height.argmax())
    a, b, c = np.polyfit(sweep.omega[top - 2 : top + 3] / omega - 1, height[top - 2 : top + 3], 2)
    assert -b / (2 * a) == pytest.approx(0.0, abs=1e-4)
    assert peak.amplitude == pytest.approx(c - b * b / (4 * a), rel=1e-5)


def test_a_loose_part_is_refused(model: ReducedModel) -> None:
    loose = SecondOrderSystem(np.eye(4), np.zeros((4, 4)), None, {}, {"x": np.eye(4)[0]})
    contact = ReducedModel(loose, interface(np.eye(3, 4), ("t1", "t2", "n")))
    with pytest.raises(SingularStuckSystem, match="rigid body"):
        ContactCompliance(contact, np.ones((1, 3)), HarmonicBasis((0, 1), 16), Excitation(), 1.0)


@pytest.fixture(scope="module")
def problem(model: ReducedModel) -> WearProblem:
    balance = balance_of(model, (0, 1))
    site = AtFrequency("tip", 420.0)
    return WearProblem(balance, (Duty(site),), "energy", 1e-9, np.full(N_PAIR, 1e-4), lost_below=0.01)


def test_thesis_rule_wears_what_it_dissipates(problem: WearProblem) -> None:
    first = assess(problem, np.zeros(N_PAIR), 0.0, None)
    worn = thesis_rule.evolve(problem, 2e-6)
    assert worn.end.startswith(("preload fell", "contact lost"))
    assert worn.worn[0].max() <= 2e-6  # eq. 3.30: Z is rounded down
    assert worn.cycles_in_step[0] == np.floor(2e-6 / first.rate.max())
    volume = problem.area @ (worn.depth[-1] + worn.worn[-1])
    assert volume == pytest.approx(1e-9 * worn.work.sum(), rel=1e-12)
    assert np.all(np.diff(worn.depth, axis=0) >= 0)


def test_error_controlled_rule_converges_to_the_finest_thesis_run(problem: WearProblem) -> None:
    fine = thesis_rule.evolve(problem, 5e-8)
    errors = []
    for share in (0.1, 0.01):
        worn = error_controlled_rule.evolve(problem, error_controlled_rule.Tolerance(share, 1e-5))
        assert problem.area @ worn.depth[-1] == pytest.approx(1e-9 * worn.work.sum(), rel=1e-12)
        errors.append(abs(np.interp(0.1 * fine.preload[0], worn.preload[::-1], worn.cycles[::-1])
                          / np.interp(0.1 * fine.preload[0], fine.preload[::-1], fine.cycles[::-1]) - 1))
    assert errors[1] < 0.02
    assert len(worn.cycles) < len(fine.cycles) / 3


@pytest.mark.parametrize("kind", ["thesis", "error_controlled"])
def test_a_resumed_run_ends_in_the_same_bits(problem: WearProblem, kind: str) -> None:
    def run(resume=None, max_steps=10000):
        if kind == "thesis":
            return thesis_rule.evolve(problem, 2e-6, max_steps, None, resume)
        tolerance = error_controlled_rule.Tolerance(0.05, 1e-5)
        return error_controlled_rule.evolve(problem, tolerance, max_steps, None, resume)

    whole = run()
    parts = run(run(None, 3))
    assert np.array_equal(whole.depth, parts.depth)
    assert np.array_equal(whole.cycles, parts.cycles)


def test_missions_average_their_duties(problem: WearProblem) -> None:
    site = AtFrequency("tip", 420.0)
    mission = (Duty(site, 0.25), Duty(site, 0.75, load=0.5))
    mixed = WearProblem(problem.balance, mission, "energy", 1e-9, problem.area)
    state = assess(mixed, np.zeros(N_PAIR), 0.0, None)
    full, half = (
        assess(WearProblem(problem.balance, (Duty(site, 1.0, load),), "energy", 1e-9, problem.area), *start)
        for load, start in ((1.0, (np.zeros(N_PAIR), 0.0, None)), (0.5, (np.zeros(N_PAIR), 0.0, None)))
    )
    assert state.rate == pytest.approx(0.25 * full.rate + 0.75 * half.rate, rel=1e-6)
    beside = BesidePeak(AtPeak("tip", 250.0, 1200.0), 0.97).first(problem.balance)
    peak = AtPeak("tip", 250.0, 1200.0).first(problem.balance)
    assert beside.state.omega == pytest.approx(0.97 * peak.state.omega, rel=1e-4)
    assert beside.amplitude < peak.amplitude


def test_archard_and_energy_law_agree_up_to_the_uncoupled_directions(problem: WearProblem) -> None:
    point = problem.mission[0].site.first(problem.balance)
    area = problem.area
    exposure = wear_law.Exposure(problem.balance, point.state, area, np.ones(N_PAIR), np.zeros(N_PAIR), 0.0)
    energy = wear_law.load("energy").depth_rate(exposure)
    archard = wear_law.load("archard").depth_rate(exposure)
    slips = energy > 0.05 * energy.max()
    # uncoupled sliders dissipate mu N (|ds1| + |ds2|), which lies between mu N |ds| and sqrt(2) times that
    ratio = energy[slips] / (0.4 * archard[slips])
    assert np.all((ratio > 0.97) & (ratio < 1.03 * np.sqrt(2)))
