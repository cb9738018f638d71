"""Contact, compliance, wear steps and time steps, each held against a sum, a closed form or an equation of balance."""

from dataclasses import replace

import numpy as np
import pytest

from proof.hard_settings.extremes_models import lattice, rigid
from tests.helpers.pressed_body import wear_problem
from tests.helpers.verification_models import oscillator, random_structure
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact import aft, contact_law
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.contact.laws import jenkins, unilateral
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.expansion import Expansion
from tribodyn.hbm.time import time_integration, verify
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.wear.rules import error_controlled, thesis
from tribodyn.hbm.wear.step_control import Tolerance
from tribodyn.hbm.wear.wear_loop import evolve


@pytest.mark.parametrize("way", ["located", "sampled"])
@pytest.mark.parametrize("name", ["unilateral", "jenkins"])
def test_a_contact_half_of_the_time_closed_pushes_with_a_half_sine(name: str, way: str) -> None:
    """Displacement gap + A cos t: N = k A cos t over half a turn, of mean k A / pi and first harmonic k A / 2."""
    law, k, amplitude, gap = contact_law.load(name), 3.0, 2.0, 0.7
    components = ("n",) if name == "unilateral" else ("t1", "n")
    numbers = {} if name == "unilateral" else {"friction": 0.3}
    parameters = ContactParameters.of(components, [[k] * len(components)], gap=gap, **numbers)
    x = np.zeros((1, len(components), 3))
    x[0, -1] = [gap, amplitude, 0.0]
    result = aft.cycle(law, x, parameters, HarmonicBasis((0, 1), 4096, way)).force[0, -1]
    assert result == pytest.approx([k * amplitude / np.pi, k * amplitude / 2, 0.0], abs=2e-6)


def test_a_contact_that_is_just_open_does_not_pull() -> None:
    p, none = np.array([1e6, 0.0, 0.0, 1e-6]), np.zeros((1, 0))
    force, slope = np.ones(1), np.zeros((1, 1))
    for x, expected in ((1e-6 - 1e-7, 0.0), (1e-6 + 1e-7, 0.1)):
        unilateral.step(np.array([x]), none[0], p, force, slope, none, none.T, np.zeros((0, 0)))
        assert force[0] == pytest.approx(expected, abs=1e-9)


def test_a_slider_is_dragged_and_lets_go_where_it_turns() -> None:
    """Pushed to twice the slip, T = mu N; back by d, T = mu N - k d; back by more than 2 mu N / k, T = -mu N."""
    k, normal, mu = 2.0, 5.0, 0.4
    p, memory = np.array([k, 1.0, 0.0, 0.0, mu]), np.zeros(1)
    force, slopes = np.zeros(2), [np.zeros((2, 2)), np.zeros((2, 1)), np.zeros((1, 2)), np.zeros((1, 1))]
    rows = []
    for x in (2.0, 1.7, -1.0):
        jenkins.step(np.array([x, normal]), memory, p, force, *slopes)
        rows.append(force.copy())
    limit = mu * normal
    np.testing.assert_allclose(rows, [[limit, normal], [limit - 0.3 * k, normal], [-limit, normal]], rtol=1e-12)


def test_friction_that_turns_back_by_a_little_and_goes_on() -> None:
    """sin t + c sin 3 t, c above 1/9, dips by a part of a per cent at its top: it sticks there and slips again."""
    k, limit, c = 2.0, 0.9, 0.128
    basis = HarmonicBasis((0, 1, 3), 64, "located")
    x = np.zeros((1, 1, 5))
    x[0, 0, 2], x[0, 0, 4] = 1.0, c
    law = contact_law.load("jenkins_constant")
    parameters = ContactParameters.of(("t1",), [[k]], friction=1.0, normal_load=limit)
    t = np.linspace(0, 4 * np.pi, 2 * 8192, endpoint=False)
    u = np.sin(t) + c * np.sin(3 * t)
    dip = u.max() - (1.0 - c)
    assert 0.001 < dip / (limit / k) < 0.01
    force, slider = np.zeros_like(u), u[0]
    for j, item in enumerate(u):
        force[j] = np.clip(k * (item - slider), -limit, limit)
        slider = item - force[j] / k
    functions = basis.functions(t[8192:])
    expected = functions.T @ force[8192:] * np.where(basis.order > 0, 2, 1) / 8192
    result = aft.cycle(law, x, parameters, basis).force[0, 0]
    np.testing.assert_allclose(result, expected, atol=1e-5 * limit)


def test_a_mass_between_its_spring_and_a_moving_ground() -> None:
    """(k + k_c - m w2 + i c w) u = k_c g: the contact sees u - g."""
    mass, k, k_c, ratio, omega, ground = 2.0, 1e4, 3e4, 0.05, 100.0, np.array([2e-6, 3e-6, -1e-6])
    base = np.zeros((2, 3))
    base[0] = ground
    excitation = Excitation({(0, "normal"): 5.0}, base)
    parameters = ContactParameters.of(("t1", "n"), [[k_c, k_c]], friction=1e3)
    balance = HarmonicBalance.of(
        oscillator(mass, k, ratio), Joint("contact", "jenkins", parameters), HarmonicBasis((0, 1), 32), excitation, 200
    )
    wave = ground[1] - 1j * ground[2]
    u = k_c * wave / (k + k_c - mass * omega**2 + 2j * ratio * np.sqrt(k * mass) * omega)
    observed = u - wave
    values = balance.x_lin(omega).reshape(2, 3)
    expected = [k_c * ground[0] / (k + k_c) - ground[0], observed.real, -observed.imag]
    np.testing.assert_allclose(values[0], expected, rtol=1e-7)


@pytest.mark.parametrize("damping", [0.0, 0.02])
def test_the_compliance_is_the_inverse_of_the_dynamic_stiffness(damping: float) -> None:
    body = lattice(3, 3)
    balance = body.balance(replace(body.ordinary, damping=damping, harmonics=(0, 1, 2)))
    omega, system, b = 0.9 * body.ordinary.omega, balance.model.system, np.asarray(balance.model.interface.B)
    g = np.random.default_rng(0).normal(size=(len(b), balance.basis.n_coeff))
    result = balance.basis.to_complex(balance.compliance.at(omega).apply(g))
    stuck = system.stiffness + b.T @ (balance.contact.stiffness.ravel()[:, None] * b)
    for place, h in enumerate(balance.basis.harmonics):
        s = 1j * h * omega
        dynamic = stuck + s * s * system.mass + s * (0.0 if system.damping is None else system.damping)
        expected = b @ np.linalg.solve(dynamic, b.T @ balance.basis.to_complex(g)[:, place])
        np.testing.assert_allclose(result[:, place], expected, atol=1e-7 * np.abs(expected).max())


def test_the_modes_left_out_follow_as_their_own_series_says() -> None:
    """1 / (lam + s c + s2) = 1 / lam - s c / lam2 + s2 (c2 / lam3 - 1 / lam2) + ..., c = 2 zeta sqrt(lam) of a mode."""
    n, zeta = 60, 0.05
    lam = np.concatenate([np.linspace(1.0, 10.0, 24), np.geomspace(1e6, 1e7, n - 24)])
    phi = np.linalg.qr(np.random.default_rng(0).normal(size=(n, n)))[0]
    c = 2 * zeta * np.sqrt(lam)
    system = SecondOrderSystem(np.eye(n), (phi * lam) @ phi.T, (phi * c) @ phi.T, {}, {})
    expansion = Expansion(system, np.zeros((0, n)), np.zeros(0), np.eye(n), 2.0)
    assert expansion.n_mode < n
    assert expansion.order >= 3
    assert expansion.error < 1e-9
    omitted, remainder, extra = phi[:, expansion.n_mode :], lam[expansion.n_mode :], c[expansion.n_mode :]
    for power, factor in ((1, -extra / remainder**2), (2, extra**2 / remainder**3 - 1 / remainder**2)):
        ours = expansion.higher[power - 1] * expansion.unit / expansion.s_unit**power
        expected = (omitted * factor) @ omitted.T
        np.testing.assert_allclose(ours, expected, atol=1e-4 * np.abs(expected).max())


def test_cycles_and_depths_of_the_thesis_rule_are_sums_of_its_steps() -> None:
    history = evolve(thesis.Rule(wear_problem(), 2e-7), 4)
    assert len(history.cycles) == 5  # the last row is the state behind the last step
    np.testing.assert_allclose(np.diff(history.cycles), history.cycles_in_step[:-1], rtol=1e-12)
    np.testing.assert_allclose(np.diff(history.depth, axis=0), history.worn[:-1], rtol=1e-9)
    np.testing.assert_allclose(history.work, history.cycles_in_step[:, None] * history.energy, rtol=1e-9)


def test_the_error_of_a_wear_step_is_its_distance_from_an_implicit_euler_step() -> None:
    """depth + h rate(after) is of first order: from the step of second order it is off by the first one's error."""
    share, scale = 0.01, 1e-5
    problem = wear_problem()
    history = evolve(error_controlled.Rule(problem, Tolerance(share, scale)), 4)
    rate = 1e-9 * history.energy / problem.area
    for now in range(3):
        off = history.worn[now] - history.cycles_in_step[now] * rate[now + 1]
        stride, volume = history.cycles_in_step[now], problem.area @ history.worn[now]
        on_life = abs(problem.area @ off) / volume * stride / history.cycles[now + 1]
        expected = max(np.abs(off).max() / scale, on_life) / share
        assert history.step_error[now] == pytest.approx(expected, rel=1e-3)
        spent = problem.area @ history.worn[now]
        assert history.work[now].sum() * 1e-9 == pytest.approx(spent, rel=1e-6)


def test_time_integration_is_in_balance_in_every_harmonic() -> None:
    """What its own contact forces do to the structure, by the dynamic stiffness, is the motion that it found."""
    model = random_structure(2, ratio=0.1)
    parameters = ContactParameters.of(("t1", "t2", "n"), model.interface.stiffness(3e6, 5e6), friction=0.3)
    excitation = Excitation.of({"static": 30.0}, {1: {"shaker": 60.0}})
    basis = HarmonicBasis((0, 1, 2, 3), 128)
    balance = HarmonicBalance.of(model, Joint("contact", "jenkins", parameters), basis, excitation, 400.0)
    omega = 305.3
    motion = time_integration.integrate(balance, omega, None, Options(steps=512))
    assert motion.periodic
    assert motion.energy.sum() > 0
    system, b = model.system, np.asarray(model.interface.B)
    wave = np.exp(-1j * omega * np.outer(motion.time, np.arange(4))) / len(motion.time)
    force, x = (of.reshape(len(b), -1) @ wave for of in (motion.force, motion.x))
    for h in range(4):
        s = 1j * h * omega
        dynamic = system.stiffness + s * system.damping + s * s * system.mass
        load = {0: 30.0 * system.loads["static"], 1: 30.0 * system.loads["shaker"]}.get(h, 0.0)
        expected = b @ np.linalg.solve(dynamic, load - b.T @ force[:, h])
        assert np.abs(x[:, h] - expected).max() < 5e-4 * np.abs(x).max(), h


def test_the_error_of_time_steps_counts_the_energy() -> None:
    """Where the response hardly feels the contact, half the steps tell more in the energy than in the amplitude."""
    body = rigid(1)
    balance = body.balance(replace(body.ordinary, tangential=2e4, preload=3.0))
    state = newton.solve_from_rest(balance, body.ordinary.omega).state
    verification = verify.verify(balance, state, Options(steps=64))
    half, full = (
        time_integration.integrate(balance, state.omega, state, Options(steps=steps)).energy.sum() for steps in (32, 64)
    )
    assert verification.step_error >= abs(half - full) / full / 3 * (1 - 1e-6) > 0
