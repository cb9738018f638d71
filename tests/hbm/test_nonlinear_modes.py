"""Backbones: the stuck linear mode at small amplitude, closed forms, and the forced response they organise."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg as sla
from scipy.special import ellipk

from tests.helpers.verification_models import oscillator, random_structure
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.bordered_modes import DenseBordered, DiagonalBordered
from tribodyn.hbm.continuation.nonlinear_modes import BackboneOptions, backbone
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.stuck_modes import stuck_modes
from tribodyn.reduction.model import ReducedModel

MASS, STIFFNESS, RATIO = 1.3, 4.0e4, 0.01
KT, KN, MU, PRESS = 3.0e4, 5.0e6, 0.4, 50.0
LIMIT = MU * PRESS * KN / (KN + STIFFNESS)


def jenkins(n_samples: int = 8192) -> HarmonicBalance:
    parameters = ContactParameters.of(("t1", "n"), [[KT, KN]], friction=MU)
    excitation = Excitation.of({"normal": PRESS})
    return HarmonicBalance.of(
        oscillator(MASS, STIFFNESS, RATIO), Joint("contact", "jenkins", parameters), HarmonicBasis((0, 1), n_samples),
        excitation, 1000.0,
    )  # fmt: skip


SLIP = LIMIT / KT


def closed_form(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequency, damping and energy per cycle over the amplitude."""
    theta = np.arccos(np.where(x > SLIP, 1 - 2 * SLIP / x, -1.0))
    omega = np.sqrt((STIFFNESS + KT / np.pi * (theta - np.sin(theta) * np.cos(theta))) / MASS)
    dissipated = 4 * LIMIT * np.maximum(x - SLIP, 0.0)
    viscous = 2 * RATIO * np.sqrt(MASS * STIFFNESS)
    return omega, viscous / (2 * MASS * omega) + dissipated / (2 * np.pi * MASS * omega**2 * x**2), dissipated


def test_frequency_and_damping_of_a_jenkins_element_are_the_closed_form():
    mode = backbone(jenkins(), 0.1 * SLIP, 100 * SLIP)
    assert str(mode.end).startswith("reached")
    omega, zeta, dissipated = closed_form(mode.amplitude)
    np.testing.assert_allclose(mode.omega, omega, rtol=1e-6)
    np.testing.assert_allclose(mode.damping, zeta, rtol=2e-6)
    np.testing.assert_allclose(mode.response[:, 0, 1], mode.amplitude, rtol=1e-9)
    np.testing.assert_allclose(mode.energy, dissipated, rtol=1e-6, atol=1e-9 * dissipated.max())
    assert mode.damping.max() > 9 * RATIO


@pytest.mark.parametrize("between", [1e-3, 1e-4])
def test_straight_lines_between_points_miss_no_more_than_asked_where_slip_begins(between):
    mode = backbone(jenkins(), 0.1 * SLIP, 100 * SLIP, options=BackboneOptions(between=between))
    log_x = np.linspace(*np.log(mode.amplitude[[0, -1]]), 2001)
    omega, zeta, _ = closed_form(np.exp(log_x))
    exact = np.log(mode.amplitude)
    assert np.abs(np.interp(log_x, exact, mode.omega) / omega - 1).max() < 1.5 * between
    assert np.abs(np.interp(log_x, exact, mode.damping) - zeta).max() < 1.5 * between
    assert len(mode.omega) < 120 * np.sqrt(1e-3 / between)


def duffing(harmonics: tuple[int, ...], ratio: float) -> HarmonicBalance:
    parameters = ContactParameters.of(("n",), [[KT]], cubic=2e9)
    basis = HarmonicBasis(harmonics, 256)
    return HarmonicBalance.of(
        oscillator(MASS, STIFFNESS, ratio, "n"), Joint("contact", "cubic_spring", parameters), basis, Excitation(), 1e4
    )


def test_backbone_of_a_duffing_oscillator_with_one_harmonic_is_the_closed_form():
    mode = backbone(duffing((1,), RATIO), 1e-5, 1e-1)
    assert str(mode.end).startswith("reached")
    omega = np.sqrt((STIFFNESS + KT + 0.75 * 2e9 * mode.amplitude**2) / MASS)
    np.testing.assert_allclose(mode.omega, omega, rtol=1e-8)
    np.testing.assert_allclose(mode.damping, RATIO * np.sqrt(STIFFNESS / MASS) / omega, rtol=1e-7)
    assert omega[-1] > 10 * omega[0]
    assert np.all(np.abs(mode.energy) < 1e-9 * KT * mode.amplitude**2)


def test_backbone_of_a_duffing_oscillator_converges_to_the_exact_period():
    errors = []
    for top in (1, 3, 5, 7, 9):
        mode = backbone(duffing(tuple(range(1, top + 1, 2)), 0.0), 1e-4, 1e-2)
        peak = mode.response[:, 0, 0::2].sum(axis=1)
        stiff = STIFFNESS + KT + 2e9 * peak**2
        exact = np.pi * np.sqrt(stiff / MASS) / (2 * ellipk(2e9 * peak**2 / (2 * stiff)))
        errors.append(np.abs(mode.omega / exact - 1).max())
        np.testing.assert_allclose(mode.damping, 0.0, atol=1e-9)
    assert all(b < 0.1 * a for a, b in pairwise(errors))
    assert errors[-1] < 1e-6


def structure(ratio: float, friction: float = 0.3) -> HarmonicBalance:
    model = random_structure(3, ratio=ratio)
    parameters = ContactParameters.of(("t1", "t2", "n"), model.interface.stiffness(3e6, 5e6), friction=friction)
    basis = HarmonicBasis((0, 1, 2, 3), 512, "located")  # the normal spring then does no work, not even by sampling
    excitation = Excitation.of({"static": 30.0})
    return HarmonicBalance.of(model, Joint("contact", "jenkins", parameters), basis, excitation, 600.0).with_gap(
        np.full(3, -5e-5)
    )


def test_small_amplitude_is_the_linear_mode_and_the_backbone_goes_on():
    balance = structure(ratio=0.01)
    curve = backbone(balance, 1e-9, 3e-5, mode=1, options=BackboneOptions(n_points=25))
    system, b = balance.model.system, np.asarray(balance.model.interface.B)
    stuck = system.stiffness + b.T @ (balance.contact.stiffness.ravel()[:, None] * b)
    lam, phi = sla.eigh(stuck, system.mass)
    assert curve.reference_omega == pytest.approx(np.sqrt(lam[1]), rel=1e-10)
    assert curve.omega[0] == pytest.approx(np.sqrt(lam[1]), rel=1e-4)  # light damping couples modes at second order
    assert curve.damping[0] == pytest.approx(phi[:, 1] @ system.damping @ phi[:, 1] / (2 * np.sqrt(lam[1])), rel=1e-3)
    assert str(curve.end).startswith("reached")
    assert curve.omega[-1] < 0.98 * curve.omega[0]
    assert curve.damping.max() > 2 * curve.damping[0]


def test_damping_is_the_energy_lost_and_a_force_along_the_added_term_holds_the_motion():
    """Forced in phase with its own added term, the structure vibrates in the nonlinear mode: K, M, C and f_c agree."""
    balance = structure(ratio=0.0)
    curve = backbone(balance, 1e-8, 2e-5, mode=0, options=BackboneOptions(n_points=12))
    i = -1
    omega, zeta = curve.omega[i], curve.damping[i]
    system, basis = balance.model.system, balance.basis
    k = balance.contact.stiffness.ravel()
    b = np.asarray(balance.model.interface.B)
    x = curve.contact[i].reshape(3, 3, -1)
    state = balance.evaluate(omega, x)
    # rebuild q from the contact forces with the added term on the left, then apply that term as a load instead
    force = basis.to_complex(b.T @ state.g)
    force[:, 0] += 30.0 * system.loads["static"]
    loads, load_vectors = {(0, "static"): 30.0}, dict(system.loads)
    motion_energy = 0.0
    for p, h in enumerate(basis.harmonics):
        s = 1j * h * omega
        d = system.stiffness + b.T @ (k[:, None] * b) + (s * s - 2 * zeta * omega * s) * system.mass
        q = np.linalg.solve(d, force[:, p])
        added = 2 * zeta * omega * s * (system.mass @ q)
        motion_energy += np.pi * h * np.imag(np.conj(q) @ added)
        for part, unit in ((added.real, 1.0), (added.imag, 1j)):
            load_vectors[f"{h} {unit}"] = part
            loads[(h, f"{h} {unit}")] = unit
    assert motion_energy == pytest.approx(curve.energy[i], rel=1e-6)
    forced_model = ReducedModel(
        type(system)(system.mass, system.stiffness, None, load_vectors, system.outputs), balance.model.interface
    )
    forced = HarmonicBalance.of(forced_model, balance.contact.joints, basis, Excitation(loads), 600.0)
    forced_state = forced.evaluate(omega, x)
    assert newton.relative_residual(forced_state, forced.x_lin(omega)) < 1e-6


def test_refusals():
    balance = jenkins(64)
    with pytest.raises(ValueError, match="no output 'tip'"):
        backbone(balance, 1e-6, 1e-5, output="tip")
    with pytest.raises(ValueError, match="must be > 0"):
        backbone(balance, 0.0, 1e-5)
    with pytest.raises(ValueError, match="no mode 9"):
        backbone(balance, 1e-6, 1e-5, mode=9)
    with pytest.raises(ValueError, match="does not move"):
        backbone(balance, 1e-6, 1e-5, mode=1)


@pytest.mark.parametrize("corner", [0.0, 1.0])
def test_the_bordered_solve_of_proportional_damping_equals_the_dense_one(corner):
    """Also where the dynamic stiffness of the reference mode itself vanishes: at its resonance."""
    rng = np.random.default_rng(7)
    d = rng.normal(size=8) + 1j * rng.normal(size=8)
    border, rhs = rng.normal(size=8), rng.normal(size=9) + 1j * rng.normal(size=9)
    border[3] = 5.0
    if corner:
        border[:] = 0.0
    else:
        d[3] = 0.0
    exact = DenseBordered(np.diag(d), border, corner).solve(rhs)
    np.testing.assert_allclose(DiagonalBordered(d, border, corner).solve(rhs), exact, rtol=1e-12)


def test_modes_of_a_free_chain_are_the_closed_form():
    """n equal masses in a row: omega_i = 2 sqrt(k / m) sin(i pi / 2 n), the first of them a rigid motion."""
    n, k, m = 12, 3e7, 0.2
    chain = k * (np.diag([1.0, *[2.0] * (n - 2), 1.0]) - np.eye(n, k=1) - np.eye(n, k=-1))
    squares, shapes, free = stuck_modes(chain, m * np.eye(n))
    assert free.tolist() == [True] + [False] * (n - 1)
    assert squares[0] == 0.0
    np.testing.assert_allclose(squares[1:], 4 * k / m * np.sin(np.arange(1, n) * np.pi / (2 * n)) ** 2, rtol=1e-10)
    np.testing.assert_allclose(m * shapes.T @ shapes, np.eye(n), atol=1e-10)
    np.testing.assert_allclose(chain @ shapes, m * shapes * squares, atol=1e-9 * k)
