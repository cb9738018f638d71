"""Hill's method and Floquet multipliers: against eigenvalues, finite differences, each other, and turns of a branch."""

import numpy as np
import pytest
from scipy.sparse.linalg import ArpackNoConvergence

from tests.helpers.reduced import HarmonicModel
from tests.helpers.stability_in_time import multipliers, stability_in_time
from tests.helpers.three_pairs import FLIPS_AT, three_pairs
from tests.helpers.verification_models import interface, oscillator
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation import parameter
from tribodyn.hbm.continuation.methods import arc_length, natural
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.stability import exponents, floquet, hill_problem
from tribodyn.hbm.stability.branch_stability import stability_along
from tribodyn.hbm.stability.exponents import Stability, stability
from tribodyn.hbm.stability.floquet import monodromy
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.stepper import Options, TimeStepper
from tribodyn.reduction.model import ReducedModel


@pytest.mark.parametrize(("in_time", "smallest", "error"), [(False, 0.0, 1e-9), (True, 0.5, 0.02)])
def test_exponents_of_a_stuck_contact_are_eigenvalues(in_time, smallest, error):
    balance = three_pairs(friction=1e9, static=0.0, shaker=1.0, top=3)
    balance = balance.with_gap(np.full(3, -1e-4))  # pressed together by interference
    solution = newton.solve_from_rest(balance, FLIPS_AT)
    assert np.all(solution.state.cycle.status == 1)
    system, b = balance.model.system, np.asarray(balance.model.interface.B)
    stiffness = system.stiffness + b.T @ (balance.contact.stiffness.ravel()[:, None] * b)
    n = len(stiffness)
    inverse = np.linalg.inv(system.mass)
    first_order = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ system.damping]])
    expected = np.exp(np.linalg.eigvals(first_order) * 2 * np.pi / FLIPS_AT)
    state = solution.state
    result = stability_in_time(balance, state) if in_time else stability(balance, state, n_modes=n)
    assert result.stable
    assert len(result.exponents) == 2 * n
    for value in expected[np.abs(expected) > smallest]:
        assert np.abs(multipliers(result) - value).min() < error


def test_modes_left_out_of_hill_follow_statically():
    balance = three_pairs(friction=0.3, static=30.0, shaker=60.0, top=5)
    state = newton.solve_from_rest(balance, FLIPS_AT).state
    small, all_modes = stability(balance, state, n_modes=8), stability(balance, state, n_modes=13)
    assert len(small.exponents) == 16
    assert small.exponents[0].real == pytest.approx(all_modes.exponents[0].real, rel=0.01)


def test_monodromy_with_friction_is_the_finite_difference_of_the_period_map():
    balance = three_pairs(friction=0.3, static=30.0, shaker=60.0, top=7)
    state = newton.solve_from_rest(balance, FLIPS_AT).state
    options = Options(steps=256, tolerance=1e-11)
    stepper = TimeStepper(balance, FLIPS_AT, options)
    motion = time_integration.integrate(balance, FLIPS_AT, state, options, with_slopes=True)
    exact = np.linalg.eigvals(monodromy(stepper, motion.slopes))
    start = stepper.start_from(state)
    for _ in range(300):
        start, record, _, _ = stepper.period(start)
    assert np.all(record.bits == 7)
    n = stepper.n_dynamic
    unit = np.repeat([1 / FLIPS_AT, stepper.h, 1 / FLIPS_AT], [n, n, start.memory.size])

    def end_of(change: np.ndarray) -> np.ndarray:
        z, memory = np.split(unit * change, [2 * n])
        shape = start.memory.shape
        shifted = stepper.moving(start.z + z, start.memory + memory.reshape(shape), start.x, start.f, start.hold)
        end, *_ = stepper.period(shifted)
        return np.concatenate([end.z, end.memory.ravel()]) / unit

    step = 1e-6 * np.abs(start.z[n:]).max() / stepper.h * np.eye(len(unit))
    columns = [(end_of(e) - end_of(-e)) / (2 * e.max()) for e in step]
    approximate = np.linalg.eigvals(np.array(columns).T)
    for value in exact[np.abs(exact) > 0.05]:
        assert np.abs(approximate - value).min() < 1e-6


def test_hill_and_floquet_agree_on_a_flip_from_which_a_plain_march_departs():
    balance = three_pairs(friction=0.0, static=30.0, shaker=60.0, top=15)
    state = newton.solve_from_rest(balance, FLIPS_AT).state
    assert np.all(state.cycle.status == 6)
    hill, floquet = stability(balance, state), stability_in_time(balance, state)
    assert not hill.stable
    assert not floquet.stable
    assert hill.crossing == floquet.crossing == "flip"
    np.testing.assert_allclose(multipliers(hill)[0], multipliers(floquet)[0], rtol=0.01)
    np.testing.assert_allclose(hill.exponents[:7].real, floquet.exponents[:7].real, rtol=0.03)
    plain = time_integration.integrate(balance, FLIPS_AT, state, Options(accelerate=False, max_periods=60))
    mixed = time_integration.integrate(balance, FLIPS_AT, state, Options())
    assert str(plain.outcome).startswith("not periodic")
    assert mixed.outcome == CONVERGED


def lifting_mass() -> HarmonicBalance:
    """A pressed mass on a unilateral spring: it softens where it lifts, and its resonance bends over."""
    parameters = ContactParameters.of(("n",), [[4e4]])
    excitation = Excitation.of({"normal": 50.0}, {1: {"normal": 3.0}})
    basis = HarmonicBasis((0, 1, 2, 3, 4, 5), 256, "located")
    return HarmonicBalance.of(
        oscillator(1.0, 1e4, 0.01, "n"), Joint("contact", "unilateral", parameters), basis, excitation, 300.0
    )


def test_exponents_whose_iteration_does_not_converge_are_computed_with_all_others(monkeypatch):
    """Arnoldi's iteration gave up on a beam of set-valued contact and ended the run in a traceback."""
    balance = three_pairs(friction=0.2, static=30.0, shaker=30.0, top=5)
    state = newton.solve_from_rest(balance, FLIPS_AT).state
    calls = []

    def unconverged(*_, **__):
        calls.append(1)
        raise ArpackNoConvergence("no convergence", np.empty(0), np.empty((0, 0)))

    iterated = stability(balance, state).exponents
    monkeypatch.setattr(hill_problem, "eigs", unconverged)
    np.testing.assert_allclose(stability(balance, state).exponents, iterated, rtol=1e-6, atol=1e-6 * state.omega)
    assert calls


def test_folds_of_a_lifting_mass_are_marked_where_the_branch_turns():
    balance = lifting_mass()
    branch = arc_length.follow(balance, 150.0, 260.0)
    assert str(branch.end).startswith("reached")
    assert len(branch.folds) == 2
    marks = stability_along(balance, branch)
    assert [m.kind for m in marks.bifurcations] == ["fold", "fold"]
    for bifurcation, turn in zip(marks.bifurcations, branch.folds, strict=True):
        assert bifurcation.position == pytest.approx(turn, abs=1.0)
        assert bifurcation.value == pytest.approx(branch.omega[turn], rel=1e-3)
    first, second = branch.folds
    assert np.all(marks.stable[: first - 1])
    assert not np.any(marks.stable[first + 2 : second - 1])
    assert np.all(marks.stable[second + 2 :])
    between = (first + second) // 2
    unstable = balance.evaluate(branch.omega[between], branch.contact[between].reshape(1, 1, -1))
    by_time, by_hill = stability_in_time(balance, unstable), stability(balance, unstable)
    assert multipliers(by_time)[0].real > 1
    assert multipliers(by_time)[0] == pytest.approx(multipliers(by_hill)[0], rel=0.02)


def test_a_branch_in_another_parameter_is_marked_with_it():
    balance = lifting_mass()
    load = parameter.load(balance, 200.0)
    branch = arc_length.follow(load, 0.2, 1.5)
    marks = stability_along(load, branch)
    assert len(marks.stable) == len(branch.omega)
    assert len(marks.bifurcations) == len(branch.folds)
    with pytest.raises(ValueError, match="followed in the load factor"):
        stability_along(balance, branch)


def test_names_and_refusals():
    model = oscillator(1.0, 1e4, 0.01)
    parameters = ContactParameters.of(("t1", "n"), [[1e4, 1e4]], friction=0.3)
    excitation = Excitation.of({"normal": 1.0}, {1: {"force": 1.0}})
    balance = HarmonicBalance.of(
        model, Joint("contact", "jenkins", parameters), HarmonicBasis((0, 1), 32), excitation, 200.0
    )
    state = newton.solve_from_rest(balance, 100.0).state
    cyclic = HarmonicModel(model.system, model.interface, system_of=lambda h: (model.system, np.eye(2)))
    other = HarmonicBalance.of(
        cyclic, Joint("contact", "jenkins", parameters), HarmonicBasis((0, 1), 32), excitation, 200.0
    )
    with pytest.raises(ValueError, match="one system for all harmonics"):
        stability(other, state)
    assert Stability(10.0, np.array([1.0 + 3j])).crossing == "Neimark-Sacker"


def self_excited(ratio: float, force: float) -> HarmonicBalance:
    """A mass that negative damping drives and a slider limits."""
    system = SecondOrderSystem(np.eye(1), np.eye(1), 2 * ratio * np.eye(1), {"force": np.ones(1)}, {"mass": np.ones(1)})
    law = ContactParameters.of(("t1",), [[4.0]], friction=1.0, normal_load=1.0)
    contact = Joint("contact", "jenkins_constant", law)
    basis, load = HarmonicBasis((1, 3, 5, 7), 256, "located"), Excitation.of({}, {1: {"force": force}})
    return HarmonicBalance.of(ReducedModel(system, interface(np.eye(1), ("t1",))), contact, basis, load, 6.0)


@pytest.mark.parametrize(
    ("ratio", "force", "omega", "stable"),
    [(-0.02, 1.5, 2.2, True), (-0.02, 3.0, 0.8, True), (-0.1, 3.0, 1.8, True), (-0.1, 3.0, 1.3, False)],
)
def test_growth_that_friction_limits_is_that_of_the_motion_in_time(ratio, force, omega, stable, monkeypatch):
    """The answer to a steady vibration has no friction for the perturbation: by it every such motion grows."""
    balance = self_excited(ratio, force)
    state = newton.solve_from_rest(balance, omega).state
    result, reference = (way(balance, state) for way in (stability, stability_in_time))
    assert result.stable == reference.stable == stable
    assert np.abs(multipliers(result)).max() == pytest.approx(np.abs(multipliers(reference)).max(), rel=0.02)
    growth = floquet.growth_by_negative_damping(balance, state)
    assert growth is None if stable else growth == pytest.approx(reference.exponents[0].real, rel=0.05)
    monkeypatch.setattr(exponents, "_answer", lambda *of: None)
    assert not exponents.stability(balance, state).stable


def test_time_decides_beside_a_crossing_where_sliders_slip() -> None:
    """A mode with negative damping that friction limits: Hill's method has it stable by a rate of 7e-5 at 0.775."""
    mass, stiffness = np.eye(2), np.array([[2.0, -1.0], [-1.0, 3.7]])
    squares, shapes = np.linalg.eigh(stiffness)
    damping = shapes @ np.diag([0.1, -0.01] * np.sqrt(squares)) @ shapes.T
    system = SecondOrderSystem(mass, stiffness, damping, {"force": np.array([1.0, 0.2])}, {"mass": np.eye(2)[0]})
    law = ContactParameters.of(("t1",), [[1.0]], friction=1.0, normal_load=1.0)
    balance = HarmonicBalance.of(
        ReducedModel(system, interface(np.eye(2)[:1], ("t1",))), Joint("contact", "jenkins_constant", law),
        HarmonicBasis((1, 3, 5, 7, 9), 256, "located"), Excitation.of(harmonic={1: {"force": 2.0}}), 6.0,
    )  # fmt: skip
    branch = natural.follow(balance, 0.7, 0.8, natural.Options(n_points=5))
    marks = stability_along(balance, branch)
    states = [balance.evaluate(w, balance.shaped(x)) for w, x in zip(branch.omega, branch.contact, strict=True)]
    by_hill = [exponents.stability(balance, state).stable for state in states]
    in_time = [floquet.largest_multiplier(balance, state) < 1 for state in states]
    assert by_hill != in_time
    assert marks.known.all()
    assert marks.stable.tolist() == in_time
