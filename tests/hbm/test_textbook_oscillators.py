"""Oscillators of the textbooks: a curve in closed form, grazing, doubled periods, motions that are not periodic."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, fsolve

from tests.helpers.verification_models import interface, oscillator
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.stability.branch_stability import stability_along
from tribodyn.reduction.model import ReducedModel

SLIP_FORCE, KT = 2.0, 3.0


def jenkins_force(amplitude: np.ndarray) -> np.ndarray:
    """Fundamental of the Jenkins force for amplitude x cos(w t), complex, over x."""
    slip = SLIP_FORCE / KT
    theta = np.arccos(np.clip(1 - 2 * slip / amplitude, -1, 1))
    lost = 4 * SLIP_FORCE * np.maximum(amplitude - slip, 0) / (np.pi * amplitude**2)
    return KT / np.pi * (theta - np.sin(theta) * np.cos(theta)) + 1j * lost


@pytest.mark.parametrize("way", [(0.2, 3.0), (3.0, 0.2)], ids=["up", "down"])
def test_jenkins_oscillator_at_fifty_times_its_slip_load_is_the_closed_form(way):
    zeta, force = 0.01, 50 * SLIP_FORCE
    parameters = ContactParameters.of(("t1",), [[KT]], friction=0.5, normal_load=2 * SLIP_FORCE)
    joint = Joint("joint", "jenkins_constant", parameters)
    basis = HarmonicBasis((1,), 16, "located")
    model = oscillator(1.0, 1.0, zeta, "t1")
    balance = HarmonicBalance.of(model, joint, basis, Excitation.of({}, {1: {"force": force}}), 3.0)
    branch = arc_length.follow(balance, *way)
    assert str(branch.end).startswith("reached")
    assert branch.converged.all()
    assert branch.folds == ()
    assert len(branch.omega) < 150
    amplitude = branch.amplitude("mass")
    stiffness = 1 - branch.omega**2 + 2j * zeta * branch.omega + jenkins_force(amplitude)
    np.testing.assert_allclose(np.abs(stiffness) * amplitude, force, rtol=1e-6)
    assert amplitude.max() > 5000 * SLIP_FORCE / KT


GAP, KN = 1.0, 8.0


def test_gapped_oscillator_departs_from_the_linear_one_where_it_grazes_by_the_three_halves_law():
    """Before the spring is touched the response is linear. Beyond, to leading order in the penetration d, the first
    harmonic of its force is 4 sqrt(2) / (3 pi) kn d sqrt(d / gap)."""
    zeta, force = 0.05, 0.3
    joint = Joint("stop", "unilateral", ContactParameters.of(("n",), [[KN]]))
    model = oscillator(1.0, 1.0, zeta, "n")
    basis = HarmonicBasis((0, 1, 2, 3), 128, "located")
    balance = HarmonicBalance.of(model, joint, basis, Excitation.of({}, {1: {"force": force}}), 3.0)
    balance = balance.with_gap(np.array([GAP]))

    def linear(omega):
        return force / np.hypot(1 - omega**2, 2 * zeta * omega)

    grazing = [brentq(lambda w: linear(w) - GAP, *span) for span in ((0.5, 0.99), (1.0, 1.5))]
    for way in ((0.5, 2.0), (2.0, 0.5)):
        branch = arc_length.follow(balance, *way)
        assert str(branch.end).startswith("reached")
        touched = np.array([_force(balance, branch, i)[1] != 0.0 for i in range(len(branch.omega))])
        free = branch.amplitude("mass")[~touched]
        np.testing.assert_allclose(free, linear(branch.omega[~touched]), rtol=1e-7)
        assert free.max() <= GAP * (1 + 1e-7)
        assert np.all(branch.amplitude("mass")[touched] >= GAP * (1 - 1e-7))
        assert branch.omega[touched].min() >= grazing[0] * (1 - 1e-7)  # the upper side hangs over: it hardens
        assert branch.amplitude("mass").max() > 1.3 * GAP
    ratios = []
    for step in (1e-5, 1e-4, 1e-3):
        nearby = arc_length.follow(balance, 0.9 * grazing[0], grazing[0] * (1 + step))
        x = nearby.contact[-1, 0]
        depth = float((basis.functions(np.linspace(0, 2 * np.pi, 100_001)) @ x).max()) - GAP
        law = 4 * np.sqrt(2) / (3 * np.pi) * KN * depth * np.sqrt(depth / GAP)
        ratios.append(float(np.hypot(*_force(balance, nearby, -1)[1:3])) / law)
    assert np.abs(np.array(ratios) - 1).max() < 0.03
    assert abs(ratios[0] - 1) < 0.002


def _force(balance: HarmonicBalance, branch: Branch, i: int) -> np.ndarray:
    """(n_coeff,) contact force at a point."""
    return balance.evaluate(branch.omega[i], branch.contact[i].reshape(1, 1, -1)).cycle.force[0, 0]


def test_impact_oscillator_doubles_its_period_where_its_exact_flow_says():
    """x'' + 2 zeta x' + x + kn max(x, 0) = cos(w t) is linear on either side of x = 0: one touch and one flight per
    period are matched exactly, and the period doubles where an eigenvalue of the product of both flows is -1."""
    zeta, kn = 0.1, 4.0
    joint = Joint("stop", "unilateral", ContactParameters.of(("n",), [[kn]]))
    basis = HarmonicBasis(tuple(range(16)), 256, "located")
    model = oscillator(1.0, 1.0, zeta, "n")
    balance = HarmonicBalance.of(model, joint, basis, Excitation.of({}, {1: {"force": 1.0}}), 5.0)
    branch = arc_length.follow(balance, 1.9, 4.5)
    result = stability_along(balance, branch)
    assert [b.kind for b in result.bifurcations] == ["flip", "flip"]

    def flow(k, omega, time):
        return expm(time * np.array([[0, 1, 0, 0], [-k, -2 * zeta, 1, 0], [0, 0, 0, -omega], [0, 0, omega, 0.0]]))

    def orbit(omega):
        """Speed and phase at the touch, and time until the flight, from the nearest point of the branch."""
        x = branch.contact[int(np.argmin(np.abs(branch.omega - omega))), 0]
        angle = np.linspace(0, 2 * np.pi, 4001)
        high = basis.functions(angle) @ x >= 0
        touch, leave = (np.flatnonzero(high[1:] & ~high[:-1]), np.flatnonzero(~high[1:] & high[:-1]))
        assert len(touch) == len(leave) == 1
        speed = omega * float(basis.functions(angle[touch[0]]) @ (basis.rate.T @ x))

        def defect(u):
            end = flow(1 + kn, omega, u[2]) @ [0.0, u[0], np.cos(u[1]), np.sin(u[1])]
            back = flow(1, omega, 2 * np.pi / omega - u[2]) @ [0.0, *end[1:]]
            return [end[0], back[0], back[1] - u[0]]

        start = [speed, angle[touch[0]], float((angle[leave[0]] - angle[touch[0]]) % (2 * np.pi)) / omega]
        solved, _, flag, _ = fsolve(defect, start, full_output=True, xtol=1e-13)
        assert flag == 1
        return solved

    def doubling(omega):
        time = orbit(omega)[2]
        product = (flow(1, omega, 2 * np.pi / omega - time) @ flow(1 + kn, omega, time))[:2, :2]
        return 1 + np.trace(product) + np.linalg.det(product)

    exact = [brentq(doubling, 2.1, 2.5, xtol=1e-10), brentq(doubling, 3.5, 4.0, xtol=1e-10)]
    np.testing.assert_allclose([b.value for b in result.bifurcations], exact, rtol=3e-6)
    assert not result.stable[(branch.omega > exact[0]) & (branch.omega < exact[1])].any()
    assert result.stable[(branch.omega < exact[0]) | (branch.omega > exact[1])].all()


def test_a_nonlinear_energy_sink_loses_its_period_where_a_complex_pair_of_multipliers_leaves_the_unit_circle():
    """A light mass on a cubic spring beside a linear resonator (Gendelman 2001, Starosvetsky and Gendelman 2008)."""
    light, damping, sink, across, cubic, spring, force = 0.05, 0.002, 0.005, 1e-4, 1.0, 1e-3, 0.005
    pull = np.array([[1.0, -1.0], [-1.0, 1.0]])
    mass, stiffness = np.diag([1.0, light]), np.diag([1.0, 0.0]) + across * pull
    dashpots = np.diag([damping, 0.0]) + sink * pull
    first = np.array([1.0, 0.0])
    system = SecondOrderSystem(mass, stiffness, dashpots, {"force": first}, {"mass": first})
    joint = Joint("sink", "cubic_spring", ContactParameters.of(("n",), [[spring]], cubic=cubic))
    model = ReducedModel(system, interface(np.array([[-1.0, 1.0]]), ("n",)))
    basis, loads = HarmonicBasis((1, 3, 5), 32), Excitation.of(harmonic={1: {"force": force}})
    balance = HarmonicBalance.of(model, joint, basis, loads, 1.5)
    branch = arc_length.follow(balance, 0.9, 1.02)
    result = stability_along(balance, branch)
    assert [b.kind for b in result.bifurcations] == ["Neimark-Sacker"]

    inverse = np.diag([1.0, 1.0 / light])

    def rates(omega, varied=True):
        def rate(t, y):
            q, v, shifted = y[:2], y[2:4], y[4:].reshape(4, -1)
            stretch = q[1] - q[0]
            slope = spring + 3 * cubic * stretch**2
            push = (spring * stretch + cubic * stretch**3) * np.array([-1.0, 1.0])
            acceleration = inverse @ (force * np.cos(omega * t) * first - dashpots @ v - stiffness @ q - push)
            if not varied:
                return np.concatenate([v, acceleration])
            change = -inverse @ (dashpots @ shifted[2:] + (stiffness + slope * pull) @ shifted[:2])
            return np.concatenate([v, acceleration, np.vstack([shifted[2:], change]).ravel()])

        return rate

    def start(omega, i):
        """State at time zero of the motion next to a point, both masses: one is observed, the other is the stretch."""
        solution = newton.solve(balance, omega, branch.contact[i].reshape(1, 1, -1))
        assert solution.converged
        x, y = solution.state.x[0, 0], balance.outputs(solution.state)[0]
        at, turn = basis.functions(0.0), omega * basis.rate.T
        return np.array([y @ at, (x + y) @ at, (turn @ y) @ at, (turn @ (x + y)) @ at])

    def leading(omega, i):
        """The largest multiplier, by the variational equation over one period."""
        y0 = np.concatenate([start(omega, i), np.eye(4).ravel()])
        end = solve_ivp(rates(omega), (0, 2 * np.pi / omega), y0, rtol=1e-9, atol=1e-12).y[:, -1]
        assert np.abs(end[:4] - y0[:4]).max() < 1e-4 * np.abs(y0[:4]).max()
        multipliers = np.linalg.eigvals(end[4:].reshape(4, 4))
        return multipliers[np.argmax(np.abs(multipliers))]

    place = result.bifurcations[0]
    before = int(place.position)
    low, high = (abs(leading(branch.omega[i], i)) - 1 for i in (before, before + 1))
    assert low < 0 < high
    refined = leading(place.value, before)
    assert abs(abs(refined) - 1) < 1e-3 * (high - low)
    assert abs(refined.imag) > 0.01  # a pair, neither at +1 nor at -1

    outside = int(np.argmin(np.abs(branch.omega - 1.0)))
    assert not result.stable[outside]
    omega, periods = branch.omega[outside], 200
    times = np.linspace(0, 2 * np.pi * periods / omega, 40 * periods)
    march = solve_ivp(
        rates(omega, False), (0, times[-1]), 1.02 * start(omega, outside), t_eval=times, rtol=1e-7, atol=1e-10
    )
    peaks = np.abs(march.y[0].reshape(periods, 40)).max(axis=1)[periods // 2 :]
    assert peaks.min() < 0.9 * peaks.max()  # strongly modulated: no periodic motion is left
