"""Tests under control: constant response and phase resonance beside closed forms and beside constant force."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers.verification_models import oscillator, random_structure
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.control import PhaseResonance, constant_response, driven, phase_resonance
from tribodyn.hbm.continuation.methods import arc_length, natural
from tribodyn.hbm.continuation.nonlinear_modes import BackboneOptions
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import BranchEnd
from tribodyn.hbm.time.ring_down import hammer

MASS, STIFFNESS, RATIO = 1.3, 4.0e4, 0.01
KT, CUBIC, FORCE = 3.0e4, 2e9, 20.0
DASHPOT = 2 * RATIO * np.sqrt(MASS * STIFFNESS)


def duffing(harmonics: tuple[int, ...] = (1,)) -> HarmonicBalance:
    joint = Joint("contact", "cubic_spring", ContactParameters.of(("n",), [[KT]], cubic=CUBIC))
    load = Excitation.of({}, {1: {"force": FORCE * np.exp(0.3j)}})
    model = oscillator(MASS, STIFFNESS, RATIO, "n")
    return HarmonicBalance.of(model, joint, HarmonicBasis(harmonics, 256), load, 1e4)


def test_constant_response_of_a_duffing_oscillator_is_the_closed_form_where_constant_force_folds():
    balance, a = duffing(), 5e-3
    fixed = constant_response(balance, "mass", a)
    result = driven(fixed, arc_length.follow(fixed, 100.0, 400.0))
    stiff = STIFFNESS + KT + 0.75 * CUBIC * a**2 - MASS * result.omega**2
    needed = (stiff + 1j * DASHPOT * result.omega) * a
    assert str(result.end).startswith("reached")
    assert result.folds == ()
    assert (np.diff(result.omega) > 0).all()
    np.testing.assert_allclose(result.amplitude("mass"), a, rtol=1e-9)
    np.testing.assert_allclose(FORCE * result.load_factor, np.abs(needed), rtol=1e-6)
    phase = np.angle(result.fundamental("mass") * np.exp(-0.3j))
    np.testing.assert_allclose(phase, -np.angle(needed), atol=1e-6)
    assert result.load_factor.min() * 10 < result.load_factor.max()
    peak = result.peak("mass")  # where it takes least, up to the spacing of points
    np.testing.assert_allclose(result.omega[peak], np.sqrt((STIFFNESS + KT + 0.75 * CUBIC * a**2) / MASS), rtol=0.1)
    force = FORCE * result.load_factor[peak + 1]  # the curve of that force folds, and goes through the same state
    curve = arc_length.follow(balance.with_load(force / FORCE), 100.0, 2000.0)
    assert len(curve.folds) == 2
    assert _missed(balance, result, peak + 1) < 1e-6


def test_phase_resonance_of_a_duffing_oscillator_is_the_closed_form():
    result = phase_resonance(duffing(), "mass", 150.0, 300.0, 1e-5, 2e-2)
    a = result.parameter
    omega = np.sqrt((STIFFNESS + KT + 0.75 * CUBIC * a**2) / MASS)
    assert str(result.end).startswith("reached")
    assert omega[-1] > 2 * omega[0]
    np.testing.assert_allclose(result.omega, omega, rtol=1e-7)
    np.testing.assert_allclose(FORCE * result.load_factor, DASHPOT * result.omega * a, rtol=1e-6)
    np.testing.assert_allclose(np.angle(result.fundamental("mass") * np.exp(-0.3j)), -np.pi / 2, atol=1e-6)


@pytest.mark.parametrize("way", [(120.0, 420.0), (420.0, 120.0)], ids=["up", "down"])
def test_a_stepped_sweep_jumps_where_the_closed_form_folds_on_its_way(way):
    """F^2 = ((k_A - m w^2)^2 + (c w)^2) A^2: up the larger, down the smaller frequency of the two vertical tangents."""
    force = 5.0
    branch = natural.follow(duffing().with_load(force / FORCE), *way, natural.Options(n_points=61))
    a = np.linspace(1e-5, 5e-3, 1_000_001)
    half = (STIFFNESS + KT + 0.75 * CUBIC * a**2 - DASHPOT**2 / (2 * MASS)) / MASS
    root = half**2 - ((STIFFNESS + KT + 0.75 * CUBIC * a**2) ** 2 - (force / a) ** 2) / MASS**2
    previous = np.sqrt(half[root > 0] + np.sqrt(root[root > 0]))  # the resonance, by rising amplitude
    low = int(previous.argmin())
    expected = previous[low:].max() if way[0] < way[1] else previous[low]
    assert branch.ended is BranchEnd.JUMPED
    jump = branch.omega[list(branch.folds)]
    assert len(jump) == 1
    np.testing.assert_allclose(jump, expected, rtol=1e-6)


def rubbing() -> HarmonicBalance:
    """Three pairs that slip and lift, four harmonics, located, so that a shift in time changes nothing."""
    model = random_structure(3, ratio=0.01)
    parameters = ContactParameters.of(("t1", "t2", "n"), model.interface.stiffness(3e6, 5e6), friction=0.3)
    basis = HarmonicBasis((0, 1, 2, 3), 256, "located")
    name = next(load for load in model.system.loads if load != "static")
    loads = Excitation.of({"static": 30.0}, {1: {name: 5.0}})
    return HarmonicBalance.of(model, Joint("contact", "jenkins", parameters), basis, loads, 1200.0).with_gap(
        np.full(3, -5e-5)
    )


def test_constant_response_with_friction_goes_through_the_states_of_constant_force():
    balance = rubbing()
    name = balance.compliance.output_names[0]
    fixed = constant_response(balance, name, 1.5e-5)
    result = driven(fixed, arc_length.follow(fixed, 250.0, 400.0))
    assert str(result.end).startswith("reached")
    assert result.energy.max() > 0
    np.testing.assert_allclose(np.abs(result.fundamental(name)), 1.5e-5, rtol=1e-8)
    assert max(_missed(balance, result, i) for i in range(0, len(result.omega), 4)) < 1e-6


def test_phase_resonance_with_friction_goes_through_the_states_of_constant_force():
    balance = rubbing()
    name = balance.compliance.output_names[0]
    result = phase_resonance(balance, name, 950.0, 1200.0, 1e-9, 1e-5, BackboneOptions(20))
    assert str(result.end).startswith("reached")
    assert result.energy[-1] > 0
    turned = np.abs(np.angle(result.fundamental(name)))
    np.testing.assert_allclose(turned, np.pi / 2, atol=1e-6)
    assert max(_missed(balance, result, i) for i in range(len(result.omega))) < 1e-6


def test_phase_resonance_goes_round_a_sharp_turn_of_its_amplitude():
    """Where a pair begins to slip the curve leaves backwards, and ends in small amplitudes of another mode."""
    balance = rubbing()
    name = balance.compliance.output_names[0]
    result = phase_resonance(balance, name, 700.0, 950.0, 1e-9, 1e-5, BackboneOptions(20))
    assert str(result.end).startswith("turned back")
    top = int(result.parameter.argmax())
    assert result.parameter[[0, -1]].max() < 1e-8
    assert result.parameter[top] > 3e-7
    assert result.omega[-1] > 1.01 * result.omega[0]
    assert np.abs(result.energy[: top + 1]).max() < 1e-12 < 1e-7 < result.energy[top + 1]
    np.testing.assert_allclose(np.abs(np.angle(result.fundamental(name))), np.pi / 2, atol=1e-6)
    assert max(_missed(balance, result, i) for i in range(len(result.omega))) < 1e-6


def _missed(balance: HarmonicBalance, branch, i: int) -> float:
    """How far the solution of constant force, found from a disturbed state, is from a point under control."""
    x = branch.contact[i].reshape(balance.contact.n_pair, -1, balance.basis.n_coeff)
    driving = balance.with_load(branch.load_factor[i])
    solved = newton.solve(driving, float(branch.omega[i]), 1.0001 * x, newton.NewtonOptions(tolerance=1e-11))
    assert solved.converged
    equal = np.linalg.norm(driving.outputs(solved.state) - branch.response[i]) / np.linalg.norm(branch.response[i])
    return max(float(np.linalg.norm(solved.state.x - x) / np.linalg.norm(x)), float(equal))


def test_slopes_of_the_held_structure_are_finite_differences():
    fixed = constant_response(rubbing(), rubbing().compliance.output_names[0], 3e-5)
    rng, omega, step = np.random.default_rng(2), 331.0, 1e-3
    x = fixed.stuck(omega) + 1e-5 * rng.standard_normal(fixed.stuck(omega).shape)
    state = fixed.evaluate(omega, x)
    high, low = (fixed.evaluate(omega + s, x) for s in (step, -step))
    for at, slope in zip((0, 1), fixed.frequency_slope(state), strict=True):
        ends = [(s.residual, fixed.outputs(s))[at] for s in (high, low)]
        np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2 * step), atol=1e-6 * np.abs(slope).max())
    linear, d = fixed.linearise(state), 1e-9 * rng.standard_normal(x.shape)
    shifted = (fixed.evaluate(omega, x + d).residual - fixed.evaluate(omega, x - d).residual) / 2
    np.testing.assert_allclose(linear.dense() @ d.ravel(), shifted.ravel(), atol=1e-5 * np.abs(shifted).max())
    flat = d.reshape(state.flat.shape)
    np.testing.assert_allclose(
        linear.product(flat[linear.rows]), shifted[linear.rows], atol=1e-4 * np.abs(shifted).max()
    )


def test_slopes_of_the_phase_resonance_are_finite_differences():
    balance = rubbing()
    problem = PhaseResonance(balance, 700.0, 950.0, balance.compliance.output_names[0])
    point = problem.first_guess(2e-5 / problem.per_amplitude)
    rng = np.random.default_rng(1)
    shape = 1e-3 * rng.standard_normal(len(point.coordinates))
    point = problem.evaluate(point.coordinates + shape)
    for i in (-3, -2):
        step = np.zeros(len(shape))
        step[i] = 1e-6
        ends = [problem.evaluate(point.coordinates + sign * step).residual for sign in (1, -1)]
        slope = problem._slopes(point)[{-3: 0, -2: 1}[i]]
        np.testing.assert_allclose(slope, (ends[0] - ends[1]) / 2e-6, atol=1e-5 * np.abs(slope).max())


def test_control_refuses_what_one_force_cannot_be_found_for():
    balance = duffing((1, 3))
    pair = replace(balance, excitation=Excitation.of({}, {1: {"force": 1.0}, 3: {"force": 1.0}}))
    none = replace(balance, excitation=Excitation())
    for other in (pair, none):
        with pytest.raises(ValueError, match="harmonic 1"):
            constant_response(other, "mass", 1e-3)
    with pytest.raises(ValueError, match="no mode"):
        phase_resonance(balance, "mass", 1000.0, 2000.0, 1e-5, 1e-3)


def test_a_blow_on_a_linear_oscillator_rings_as_its_closed_form():
    """v = I / m at the start, then a damped cosine."""
    linear = Joint("contact", "cubic_spring", ContactParameters.of(("n",), [[KT]], cubic=0.0))
    model = oscillator(MASS, STIFFNESS, RATIO, "n")
    basis, load = HarmonicBasis((1,), 64), Excitation.of({}, {1: {"force": FORCE}})
    balance = HarmonicBalance.of(model, linear, basis, load, 1e4)
    omega = np.sqrt((STIFFNESS + KT) / MASS)
    zeta = DASHPOT / (2 * MASS * omega)
    swing = hammer(balance, 0.13, omega, "mass", 20, 256)
    damped = omega * np.sqrt(1 - zeta**2)
    exact = 0.13 / (MASS * damped) * np.exp(-zeta * omega * swing.time) * np.sin(damped * swing.time)
    np.testing.assert_allclose(swing.displacement, exact - exact.mean(), atol=2e-3 * exact.max())
    np.testing.assert_allclose(swing.omega, damped, rtol=1e-4)
    np.testing.assert_allclose(swing.damping, zeta / np.sqrt(1 - zeta**2), rtol=1e-3)
