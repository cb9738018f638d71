"""The compliance form beside the dense algorithm, its derivatives, the tracked peak and both wear rules."""

import numpy as np
import pytest

from proof.dense import DenseBalance
from tests.helpers.pressed_body import N_PAIR, balance_of, pressed_body
from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.continuation.methods import natural
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.compliance import ContactCompliance
from tribodyn.hbm.linear.expansion import SingularStuckSystem, UnbalancedLoad
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.reduction.model import ReducedModel


@pytest.fixture(scope="module")
def model() -> ReducedModel:
    return pressed_body()


def test_compliance_and_its_slope_equal_direct_solves(model: ReducedModel) -> None:
    balance = balance_of(model)
    compliance = ContactCompliance(model, balance.contact.stiffness, balance.basis, balance.excitation, 1500.0)
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
    assert np.abs(compliance.at(300.0).slope(g, 0.0)[0] - slope).max() < 1e-4 * np.abs(slope).max()


@pytest.mark.parametrize("moved_base", [False, True], ids=["fixed ground", "moved ground"])
def test_response_to_the_loads_and_outputs_equal_direct_solves(model: ReducedModel, moved_base: bool) -> None:
    balance = balance_of(model)
    basis, rng = balance.basis, np.random.default_rng(1)
    size = (3 * N_PAIR, basis.n_coeff)
    base = 1e-5 * rng.normal(size=size) if moved_base else None
    loads = {(0, "press"): 100.0, (1, "shake"): 60.0 - 20.0j, (3, "press"): 5.0j}
    compliance = ContactCompliance(model, balance.contact.stiffness, basis, Excitation(loads, base), 1500.0)
    system, b = model.at_harmonic(1)
    g, k = rng.normal(size=size), compliance.k[:, None]
    pushed = basis.to_complex(g)
    fixed = 0.0 if base is None else basis.to_complex(k * base)
    x, y, y_of_g = np.zeros((len(b), len(basis.harmonics)), complex), *np.zeros((2, 1, len(basis.harmonics)), complex)
    for column, h in enumerate(basis.harmonics):
        s = 1j * h * 1200.0
        d = system.stiffness + b.T @ (k * b) + s * system.damping + s * s * system.mass
        force = b.T @ (np.zeros(len(b)) if base is None else fixed[:, column])
        force = force + sum(v * system.loads[name] for (of, name), v in loads.items() if of == h)
        q = np.linalg.solve(d, force)
        x[:, column], y[:, column] = b @ q, system.outputs["tip"] @ q
        y_of_g[:, column] = system.outputs["tip"] @ np.linalg.solve(d, b.T @ pushed[:, column])
    point = compliance.at(1200.0)
    result = (point.x_lin + (0.0 if base is None else base), point.outputs_lin, point.outputs(g))
    for ours, direct in zip(result, (x, y, y_of_g), strict=True):
        expected = basis.to_real(direct)
        assert np.abs(ours - expected).max() < 1e-8 * np.abs(expected).max()


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
    shifted = np.abs(solution.state.x).max() * np.abs(solution.state.cycle.force).max()
    assert np.abs(balance.energy(solution.state)).max() < 1e-15 * shifted


@pytest.mark.parametrize(("located", "in_frequency", "in_amplitude"), [(True, 1e-6, 1e-7), (False, 1e-4, 1e-5)])
def test_tracked_peak_is_that_of_a_fine_sweep(model, located, in_frequency, in_amplitude):
    """Forces at equidistant samples bend the curve in steps, where a peak is no better known than they are wide."""
    balance = balance_of(model)
    balance = balance.with_samples(balance.basis.n_samples, located)
    peak = AtPeak("tip", 250.0, 1200.0, tolerance=1e-7).solve(balance)
    omega = peak.state.omega
    sweep = natural.follow(balance, 0.99 * omega, 1.01 * omega, natural.Options(n_points=201))
    height = sweep.amplitude("tip")
    top = int(height.argmax())
    a, b, c = np.polyfit(sweep.omega[top - 2 : top + 3] / omega - 1, height[top - 2 : top + 3], 2)
    assert -b / (2 * a) == pytest.approx(0.0, abs=in_frequency)
    assert peak.amplitude == pytest.approx(c - b * b / (4 * a), rel=in_amplitude)


def test_a_loose_part_is_refused(model: ReducedModel) -> None:
    """Where what nothing holds moves the contact, or a static load pushes it."""
    loads = {"push": np.eye(4)[3]}
    loose = SecondOrderSystem(np.eye(4), np.zeros((4, 4)), None, loads, {"x": np.eye(4)[3]})
    contact = ReducedModel(loose, interface(np.eye(3, 4), ("t1", "t2", "n")))
    basis = HarmonicBasis((0, 1), 16)
    with pytest.raises(UnbalancedLoad, match="not in equilibrium"):
        ContactCompliance(contact, np.ones((1, 3)), basis, Excitation({(0, "push"): 1.0}), 2.0)
    free = ContactCompliance(contact, np.ones((1, 3)), basis, Excitation({(1, "push"): 1.0}), 2.0)
    assert free.at(1.5).outputs_lin[0] == pytest.approx([0.0, -1 / 1.5**2, 0.0], abs=1e-14)
    with pytest.raises(SingularStuckSystem, match="rigid body"):
        ContactCompliance(contact, np.array([[1.0, 1.0, 0.0]]), basis, Excitation(), 2.0)
