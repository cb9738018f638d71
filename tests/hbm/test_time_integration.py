"""The time integration itself: against scipy's integrator, its order, linear closed forms, starts and refusals."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.helpers.reduced import HarmonicModel
from tests.helpers.verification_models import interface, oscillator, random_structure
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact import compiled_law, contact_law
from tribodyn.hbm.contact.contact_law import STICKS, ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.time import time_integration
from tribodyn.hbm.time.coupled_pairs import Contact, Space, sweep
from tribodyn.hbm.time.stepper import Options, TimeStepper

OMEGA = 300.0


def random_balance(friction: float, shaker: float = 60.0, ratio: float = 0.01, second: complex = 4j) -> HarmonicBalance:
    model = random_structure(3, ratio=ratio)
    parameters = ContactParameters.of(("t1", "t2", "n"), model.interface.stiffness(3e6, 5e6), friction=friction)
    excitation = Excitation.of({"static": 30.0}, {1: {"shaker": shaker}, 2: {"shaker": second}})
    basis = HarmonicBasis(tuple(range(6)), 512)
    return HarmonicBalance.of(model, Joint("contact", "jenkins", parameters), basis, excitation, 1.2 * OMEGA)


def test_transient_of_lifting_contacts_is_that_of_a_general_integrator():
    balance = random_balance(friction=0.0)
    system, b = balance.model.system, np.asarray(balance.model.interface.B)
    kn = balance.contact.stiffness[:, 2]
    n = system.n_dof
    inverse = np.linalg.inv(system.mass)

    def rate(t, y):
        load = (
            30 * system.loads["static"] + (60 * np.cos(OMEGA * t) - 4 * np.sin(2 * OMEGA * t)) * system.loads["shaker"]
        )
        force = np.zeros(len(b))
        force[2::3] = np.maximum(kn * (b[2::3] @ y[:n]), 0.0)
        return np.r_[y[n:], inverse @ (load - system.stiffness @ y[:n] - system.damping @ y[n:] - b.T @ force)]

    closed = np.ones(len(kn), bool)
    for _ in range(5):  # static equilibrium by active set
        static = system.stiffness + (b[2::3][closed].T * kn[closed]) @ b[2::3][closed]
        start = np.r_[np.linalg.solve(static, 30 * system.loads["static"]), np.zeros(n)]
        closed = b[2::3] @ start[:n] > 0
    period = 2 * np.pi / OMEGA
    reference = solve_ivp(
        rate, (0, 3 * period), start, rtol=1e-9, atol=1e-14, t_eval=2 * period + period * np.array([0.5, 1.0])
    )
    expected = system.outputs["tip"] @ reference.y[:n]
    errors = []
    for steps in (1024, 4096):
        options = Options(steps=steps, max_periods=3, accelerate=False)
        motion = time_integration.integrate(balance, OMEGA, None, options)
        assert str(motion.outcome).startswith("not periodic after 3 periods")
        assert np.any(motion.status & 4)
        scale = np.abs(motion.outputs).max()
        errors.append(np.abs(motion.outputs[0, [steps // 2 - 1, -1]] - expected).max() / scale)
    assert errors[1] < 1e-4
    assert errors[1] < 0.15 * errors[0]


def test_friction_is_that_of_a_general_integrator():
    mass, stiffness, kt, kn, mu, press = 1.0, 2e4, 5e4, 1e6, 0.5, 20.0
    model = oscillator(mass, stiffness, 0.02)
    parameters = ContactParameters.of(("t1", "n"), [[kt, kn]], friction=mu)
    excitation = Excitation.of({"normal": press}, {1: {"force": 25.0, "normal": 8.0j}})
    balance = HarmonicBalance.of(
        model, Joint("contact", "jenkins", parameters), HarmonicBasis((0, 1, 2, 3), 256), excitation, OMEGA
    )
    damping = 2 * 0.02 * np.sqrt(mass * stiffness)

    def rate(t, y):  # friction as a rate: T' = k_t v, or mu N' while T is at the limit and pushed against it
        x, v, n, w, friction = y
        normal = kn * n
        limit, limit_rate = mu * normal, mu * kn * w
        side = np.sign(friction)
        slips = abs(friction) >= limit and side * kt * v >= limit_rate
        return [
            v,
            (25 * np.cos(OMEGA * t) - stiffness * x - damping * v - friction) / mass,
            w,
            (press - 8 * np.sin(OMEGA * t) - stiffness * n - damping * w - normal) / mass,
            side * limit_rate if slips else kt * v,
        ]

    period = 2 * np.pi / OMEGA
    y0 = [0.0, 0.0, press / (kn + stiffness), 0.0, 0.0]
    times = 2 * period + period * np.linspace(1 / 8, 1, 8)
    reference = solve_ivp(
        rate, (0, 3 * period), y0, rtol=1e-8, atol=1e-13, max_step=period / 20000, t_eval=times, method="RK23"
    )
    options = Options(steps=8192, max_periods=3, accelerate=False)
    motion = time_integration.integrate(balance, OMEGA, None, options)
    assert motion.status[0] == 3  # sticks and slips, in contact throughout
    np.testing.assert_allclose(motion.x[0, 0, 1023::1024], reference.y[0], atol=2e-4 * np.abs(reference.y[0]).max())
    np.testing.assert_allclose(motion.force[0, 0, 1023::1024], reference.y[4], atol=2e-3 * np.abs(reference.y[4]).max())


def test_order_is_two_for_a_smooth_law():
    mass, stiffness, k, cubic = 1.0, 3e4, 2e4, 5e9
    parameters = ContactParameters.of(("n",), [[k]], cubic=cubic)
    excitation = Excitation.of({"normal": 10.0}, {1: {"force": 40.0}, 3: {"force": 15.0j}})
    model = oscillator(mass, stiffness, 0.02, "n")
    balance = HarmonicBalance.of(
        model, Joint("contact", "cubic_spring", parameters), HarmonicBasis((0, 1, 2, 3), 64), excitation, OMEGA
    )
    damping = 2 * 0.02 * np.sqrt(mass * stiffness)

    def rate(t, y):
        load = 10 + 40 * np.cos(OMEGA * t) - 15 * np.sin(3 * OMEGA * t)
        return [y[1], (load - (stiffness + k) * y[0] - cubic * y[0] ** 3 - damping * y[1]) / mass]

    start = np.roots([cubic, 0.0, stiffness + k, -10.0])
    start = float(start[np.abs(start.imag) < 1e-12].real[0])
    end = 3 * 2 * np.pi / OMEGA
    reference = solve_ivp(rate, (0, end), [start, 0.0], method="DOP853", rtol=1e-12, atol=1e-18).y[0, -1]
    errors = []
    for steps in (256, 512, 1024):
        options = Options(steps=steps, max_periods=3, accelerate=False)
        motion = time_integration.integrate(balance, OMEGA, None, options)
        errors.append(abs(motion.x[0, 0, -1] - reference))
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2.0, atol=0.1)


def test_error_falls_with_the_square_of_the_step_even_with_stick_slip_and_separation():
    balance = random_balance(friction=0.3, second=0.0)
    reference = time_integration.integrate(balance, OMEGA, None, Options(steps=16384))
    assert np.all(reference.status == 7)
    exact = reference.coefficients(reference.outputs, balance.basis)
    errors = []
    grid = np.array([256, 512, 1024, 2048])
    for steps in grid:
        motion = time_integration.integrate(balance, OMEGA, None, Options(steps=int(steps)))
        assert motion.outcome == CONVERGED
        errors.append(np.abs(motion.coefficients(motion.outputs, balance.basis) - exact).max())
    order = -np.polyfit(np.log(grid), np.log(errors), 1)[0]
    assert order == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize(("steps", "within"), [(4096, 2e-5), (64, 1e-2)])
def test_stuck_contact_is_the_linear_response(steps, within):
    """Modes that 64 steps do not resolve follow statically."""
    balance = random_balance(friction=1e6, shaker=3.0)
    solution = newton.solve_from_rest(balance, OMEGA)
    dynamic = TimeStepper(balance, OMEGA, Options(steps=steps)).n_dynamic
    assert (dynamic < balance.model.system.n_dof) == (steps == 64)
    motion = time_integration.integrate(balance, OMEGA, solution.state, Options(steps=steps))
    ours = motion.coefficients(motion.outputs, balance.basis)
    theirs = balance.outputs(solution.state)
    assert np.abs(ours - theirs).max() < within * np.abs(theirs).max()
    assert np.all(np.abs(motion.energy) < 1e-9 * np.abs(motion.force).max() * np.ptp(motion.x))


def test_mixing_and_patience_find_the_same_motion_from_rest_and_from_the_balance():
    balance = random_balance(friction=0.3)
    solution = newton.solve_from_rest(balance, OMEGA)
    options = Options(steps=512, tolerance=1e-9)
    mixed = time_integration.integrate(balance, OMEGA, solution.state, options)
    patient = time_integration.integrate(
        balance, OMEGA, solution.state, Options(steps=512, tolerance=1e-9, accelerate=False)
    )
    rested = time_integration.integrate(balance, OMEGA, None, options)
    assert mixed.outcome == patient.outcome == rested.outcome == CONVERGED
    assert mixed.periods < 0.7 * patient.periods
    for other in (patient, rested):
        assert np.abs(other.outputs - mixed.outputs).max() < 1e-6 * np.abs(mixed.outputs).max()


def test_full_damping_matrix_and_moving_ground():
    model = random_structure(2)
    rng = np.random.default_rng(1)
    a = rng.normal(size=(10, 10))
    model = model.with_damping(lambda system, B: a @ a.T * 20.0)
    base = np.zeros((6, 3))
    base[:, 1:] = 2e-7 * rng.normal(size=(6, 2))
    parameters = ContactParameters.of(("t1", "t2", "n"), np.full((2, 3), 2e6), friction=1e6)
    excitation = Excitation({(0, "static"): 30.0}, base)
    balance = HarmonicBalance.of(
        model, Joint("contact", "jenkins", parameters), HarmonicBasis((0, 1), 64), excitation, 2 * OMEGA
    )
    solution = newton.solve_from_rest(balance, OMEGA)
    motion = time_integration.integrate(balance, OMEGA, solution.state, Options(steps=4096))
    assert np.all(motion.status == 1)
    ours, theirs = motion.coefficients(motion.outputs, balance.basis), balance.outputs(solution.state)
    assert np.abs(ours - theirs).max() < 1e-5 * np.abs(theirs).max()


def test_light_damping_needs_few_periods():
    balance = random_balance(friction=0.3, shaker=6.0, ratio=1e-3)
    solution = newton.solve_from_rest(balance, OMEGA)
    motion = time_integration.integrate(balance, OMEGA, solution.state, Options(steps=512))
    assert motion.outcome == CONVERGED
    assert motion.periods < 120  # the transient alone would need ln(1e8) / (2 pi 1e-3) = 2900


def test_what_has_no_equation_of_motion_is_refused():
    model = oscillator(1.0, 1e4, 0.01)
    parameters = ContactParameters.of(("t1", "n"), [[1e4, 1e4]], friction=0.0)
    excitation = Excitation.of({"normal": 1.0}, {1: {"force": 1.0}})
    cyclic = HarmonicModel(
        model.system, model.interface, system_of=lambda h: (model.system, np.asarray(model.interface.B))
    )
    balance = HarmonicBalance.of(
        cyclic, Joint("contact", "jenkins", parameters), HarmonicBasis((0, 1), 32), excitation, 200.0
    )
    with pytest.raises(ValueError, match="one system for all harmonics"):
        time_integration.integrate(balance, 100.0)
    with pytest.raises(ValueError, match="steps per period"):
        Options(steps=2)
    assert interface(np.eye(2), ("t1", "n")).n_pair == 1


def test_a_pair_that_rounding_solves_keeps_its_own_memory():
    """Its equation holds before the law is asked: what the pair before has left in the work space is not its own."""
    law = compiled_law.pointer(contact_law.load("jenkins").step)
    parameters = ContactParameters.of(("t1", "t2", "n"), np.ones((2, 3)), friction=0.5)
    contact = Contact(parameters.packed(), parameters.gap, 2, np.eye(6))
    s = np.array([[1e-4, 2e-4], [3e-4, 4e-4]])
    x, f = np.array([[1e-3, 1e-3, 1e-2], [0.5, 0.5, 0.5]]), np.array([[0.0, 0.0, 0.0], [1e3, 1e3, 1e3]])
    x_free = np.concatenate([np.full(3, 2e-2), np.full(3, 0.5 + 4e-16)])  # less than what rounds 1000 off
    space, memory = Space.of(2, 3, 2), s.copy()
    space.bits[1] = STICKS
    work, r, b, y, bits, J, M = space[:7]
    sweep(law, contact, x_free, x.copy(), np.zeros(2, bool), s, x, f, y, bits, J, M, memory, 2e-15, False, work, r, b)
    assert bits.all()
    assert np.isfinite(x).all()
    assert np.array_equal(memory[1], s[1])


def test_memory_of_open_pairs_is_left_where_a_touch_forgets_it() -> None:
    """A period in which pairs separate is the same, bit for bit, with the law asked at every step of an open pair."""
    balance = random_balance(0.3, shaker=600.0)
    stepper = TimeStepper(balance, OMEGA, Options(256))
    assert stepper.contact.forgets
    start = stepper.start_from(balance.evaluate(OMEGA, balance.stuck(OMEGA)))
    current, record, *_ = stepper.period(start)
    stepper.contact = stepper.contact._replace(forgets=False)
    refined, *_ = stepper.period(start)
    assert 0 < np.mean(record.f[..., 2] == 0) < 1
    for item, other in zip(current, refined, strict=True):
        assert np.array_equal(item, other)
