"""The compliance of models whose harmonics see different systems, complex Hermitian ones among them."""

import numpy as np
import pytest

from tests.helpers.reduced import HarmonicModel
from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear import expansion
from tribodyn.hbm.linear.compliance import ContactCompliance
from tribodyn.reduction.model import ReducedModel

N_PAIR, N = 4, 40
HARMONICS = (0, 1, 2, 3, 5)
SYSTEM_OF = {0: 0, 1: 1, 2: 2, 3: 1, 5: 0}  # 1 and 3 share a complex system, 0 and 5 a real one
OMEGA = 40.0


def random_system(rng, is_complex):
    """A Hermitian system with eigenfrequencies from 20 to 4000 rad/s and a contact map, loads and an output."""

    def matrix(n, m):
        real = rng.normal(size=(n, m))
        return real + 1j * rng.normal(size=(n, m)) if is_complex else real

    basis = matrix(N, N) + 6 * np.eye(N)
    omega = np.geomspace(20, 4000, N)
    half = matrix(N, N)
    damping = basis.conj().T @ (np.diag(0.03 * omega) + 1e-3 * half @ half.conj().T) @ basis
    return SecondOrderSystem(
        basis.conj().T @ basis,
        basis.conj().T @ np.diag(omega**2) @ basis,
        damping,
        {"rest": matrix(N, 1)[:, 0], "shaker": matrix(N, 1)[:, 0]},
        {"tip": matrix(N, 1)[:, 0]},
    ), matrix(3 * N_PAIR, N)


@pytest.fixture(scope="module")
def balance():
    rng = np.random.default_rng(3)
    systems = [random_system(rng, c) for c in (False, True, False)]
    interface = ContactInterface(
        ("t1", "t2", "n"), np.zeros((N_PAIR, 3)), np.tile(np.eye(3), (N_PAIR, 1, 1)), np.ones(N_PAIR),
        np.zeros(N_PAIR), systems[1][1], np.zeros((0, 4), int),
    )  # fmt: skip
    model = HarmonicModel(systems[1][0], interface, system_of=lambda h: systems[SYSTEM_OF[h]])
    parameters = ContactParameters.of(interface.components, np.full((N_PAIR, 3), 3e3), friction=0.4)
    load = Excitation.of({"rest": 2e3}, {1: {"shaker": 900 - 300j}, 3: {"shaker": 200j}})
    return HarmonicBalance.of(model, Joint("contact", "jenkins", parameters), HarmonicBasis(HARMONICS, 64), load, OMEGA)


def direct(balance, omega, force, loads):
    """Contact displacement and output, one dense solve per harmonic; force (n_contact, n_coeff)."""
    basis = balance.basis
    amplitudes = basis.to_complex(force)
    x, y = [], []
    for position, h in enumerate(basis.harmonics):
        system, b = balance.model.at_harmonic(h)
        s = 1j * h * omega
        stuck = system.stiffness + b.conj().T @ (balance.compliance.k[:, None] * b)
        D = stuck + s * system.damping + s * s * system.mass
        total = b.conj().T @ amplitudes[:, position]
        for (order, name), value in loads.items():
            if order == h:
                total = total + value * system.loads[name]
        q = np.linalg.solve(D, total)
        x.append(b @ q)
        y.append(system.outputs["tip"] @ q)
    return basis.to_real(np.stack(x, axis=-1)), basis.to_real(np.array([y]))


def test_compliance_equals_a_dense_solve(balance):
    point = balance.at(0.7 * OMEGA)
    x, y = direct(balance, 0.7 * OMEGA, np.zeros((3 * N_PAIR, balance.basis.n_coeff)), balance.excitation.loads)
    assert np.abs(point.x_lin - x).max() < 1e-8 * np.abs(x).max()
    assert np.abs(point.outputs_lin - y).max() < 1e-8 * np.abs(y).max()
    g = np.random.default_rng(0).normal(size=(3 * N_PAIR, balance.basis.n_coeff))
    x, y = direct(balance, 0.7 * OMEGA, g, {})
    scale = np.abs(x).max()
    assert np.abs(point.apply(g) - x).max() < 1e-8 * scale
    assert np.abs(point.outputs(g) - y).max() < 1e-8 * np.abs(y).max()
    rows = np.arange(3, 9)
    subset = np.zeros_like(g)
    subset[rows] = g[rows]
    product = point.jacobian_product(rows)(g[rows])
    assert np.abs(product - point.apply(subset)[rows]).max() < 1e-5 * scale  # single precision


def test_expansion_holds_up_to_the_highest_harmonic_of_each_system(balance):
    """Harmonics 0 and 5 share a system: its expansion must reach 5 omega_max, not 0."""
    assert balance.compliance.error < 1e-9
    g = np.random.default_rng(1).normal(size=(3 * N_PAIR, balance.basis.n_coeff))
    x, _ = direct(balance, OMEGA, g, {})
    assert np.abs(balance.at(OMEGA).apply(g) - x).max() < 1e-7 * np.abs(x).max()


@pytest.mark.parametrize("harmonics", [HARMONICS, (0, 5)])  # the last two share one real system
def test_slopes_equal_finite_differences(balance, harmonics):
    compliance, omega, step = balance.compliance.restricted(HarmonicBasis(harmonics, 64)), 0.6 * OMEGA, 2e-4
    g = np.random.default_rng(2).normal(size=(3 * N_PAIR, compliance.basis.n_coeff))
    for factor, part in ((1.0, 0.0), (0.0, 1.0), (0.7, 1.0)):  # of the loads and of g
        rows = []
        for at in (omega + step, omega - step):
            point, loads = compliance.at(at), np.where(compliance.basis.order, factor, 1.0)
            rows.append(
                (point.x_lin * loads + point.apply(part * g), point.outputs_lin * loads + point.outputs(part * g))
            )
        slopes = compliance.at(omega).slope(part * g, factor)
        for slope, (up, down) in zip(slopes, zip(*rows, strict=True), strict=True):
            assert np.abs(slope - (up - down) / (2 * step)).max() <= 1e-6 * np.abs(slope).max()


def test_newton_direction_equals_the_derivative(balance):
    omega = 0.6 * OMEGA
    rng = np.random.default_rng(5)
    x = balance.stuck(omega) * 3
    state = balance.evaluate(omega, x)
    assert (state.cycle.status & 2).any()
    direction = rng.normal(size=x.shape)
    step = 1e-7 * np.abs(x).max()
    up, down = (balance.evaluate(omega, x + sign * step * direction).residual for sign in (1, -1))
    dense = balance.linearise(state).dense() @ direction.ravel()
    assert np.abs((up - down).ravel() / (2 * step) - dense).max() < 1e-5 * np.abs(dense).max()


@pytest.mark.parametrize("is_complex", [False, True])
def test_coriolis_forces_in_few_modes_against_a_direct_solve(is_complex):
    """The expansion leaves modes out though damping and Coriolis forces couple them; its slope too."""
    rng = np.random.default_rng(5)
    n = 120
    omega = np.geomspace(20, 4e4, n)

    def matrix(rows, columns):
        real = rng.normal(size=(rows, columns))
        return real + 1j * rng.normal(size=(rows, columns)) if is_complex else real

    basis = np.linalg.qr(matrix(n, n))[0]
    half = matrix(n, n)
    damping = basis.conj().T @ (np.diag(0.03 * omega) + 1e-2 * half @ half.conj().T) @ basis
    gyroscopic = basis.conj().T @ (half - half.conj().T) @ basis
    stiffness = basis.conj().T @ np.diag(omega**2) @ basis
    system = SecondOrderSystem(np.eye(n), stiffness, damping, gyroscopic=gyroscopic)
    ports = matrix(9, n)
    result = expansion.Expansion(system, ports[:3], np.full(3, 1e3), ports, OMEGA)
    assert result.n_mode < n
    assert result.order > 2
    dynamic = stiffness + ports[:3].conj().T @ (1e3 * ports[:3])
    force = rng.normal(size=9) + 1j * rng.normal(size=9)
    for w in (0.0, 0.3 * OMEGA, OMEGA):
        s = 1j * w
        q = np.linalg.solve(dynamic + s * (damping + gyroscopic) + s**2 * np.eye(n), ports.conj().T @ force)
        exact = ports @ q
        assert np.abs(result.at(s).matrix() @ force - exact).max() < 1e-8 * np.abs(exact).max()
    step = 1e-5 * OMEGA
    ahead, previous = (result.at(1j * (0.5 * OMEGA + d)).matrix() @ force for d in (step, -step))
    slope = result.at(0.5j * OMEGA).slope(force, 1.0)
    assert np.abs(slope - (ahead - previous) / (2j * step)).max() < 1e-5 * np.abs(slope).max()


def test_all_harmonics_of_one_real_system_in_few_modes_have_the_slopes_of_each():
    rng = np.random.default_rng(6)
    n, rows = 120, 3
    basis, half = np.linalg.qr(rng.normal(size=(n, n)))[0], rng.normal(size=(n, n))
    omega = np.geomspace(20, 4e4, n)
    damping = basis.T @ (np.diag(0.03 * omega) + 1e-2 * half @ half.T) @ basis
    loads, outputs = {"shaker": rng.normal(size=n), "rest": rng.normal(size=n)}, {"y": rng.normal(size=n)}
    system = SecondOrderSystem(np.eye(n), basis.T @ np.diag(omega**2) @ basis, damping, loads, outputs)
    nodes = np.zeros((1, 3)), np.eye(3)[None], np.ones(1), np.zeros(1)
    contact = ContactInterface(("t1", "t2", "n"), *nodes, rng.normal(size=(rows, n)), np.zeros((0, 4), int))
    model, load = ReducedModel(system, contact), Excitation.of({"rest": 2e3}, {1: {"shaker": 900 - 300j}})
    compliance = ContactCompliance(model, np.full((1, rows), 1e3), HarmonicBasis((0, 1, 2), 64), load, 0.5 * OMEGA)
    (truncated, _), g = compliance.groups[0], rng.normal(size=(rows, compliance.basis.n_coeff))
    assert compliance.shared_real
    assert truncated.order > 2
    point = compliance.at(0.3 * OMEGA)
    force = compliance.basis.to_complex(compliance.excited + compliance.pushed(g))
    each = [port.slope(f, 1j * h) for h, port, f in zip((0, 1, 2), point.ports[0], force.T, strict=True)]
    expected = compliance.basis.to_real(np.stack(each, axis=1))
    for result, target in zip(point.slope(g, 1.0), (expected[:rows], expected[-1:]), strict=True):
        np.testing.assert_allclose(result, target, atol=1e-13 * np.abs(target).max())


@pytest.mark.parametrize("harmonics", [HARMONICS, (0, 5)])  # the last two share one real system
def test_the_transpose_is_that_of_the_same_product(balance, harmonics):
    """<a, G b> = <G^T a, b>."""
    compliance = balance.compliance.restricted(HarmonicBasis(harmonics, 64))
    assert compliance.shared_real == (harmonics != HARMONICS)
    point = compliance.at(0.7 * OMEGA)
    a, b = np.random.default_rng(3).normal(size=(2, 3 * N_PAIR, compliance.basis.n_coeff))
    size = np.linalg.norm(a) * np.linalg.norm(point.apply(b))
    assert abs(np.vdot(a, point.apply(b)) - np.vdot(point.transposed(a), b)) < 1e-12 * size
