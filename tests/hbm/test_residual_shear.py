"""Residual shear: extreme starts against a closed form, the rim of the friction cone, and the spread of a response."""

import numpy as np
import pytest

from tests.helpers.verification_models import interface, random_structure
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.residual_shear import amplitude_slope, response_bounds
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis, amplitude
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.reduction.model import ReducedModel

TIGHT = NewtonOptions(tolerance=1e-11)


def stuck_oscillator(transitions):
    """m = 1, k = 3, c = 0.2 on a Jenkins element k_t = 2, mu N = 1.5 that sticks; static load 0.4, harmonic 0.5."""
    item = np.eye(1)
    system = SecondOrderSystem(item, 3 * item, 0.2 * item, {"force": np.ones(1)}, {"mass": np.ones(1)})
    return HarmonicBalance.of(
        ReducedModel(system, interface(item, ("t1",))),
        Joint("contact", "jenkins_constant", ContactParameters.of(("t1",), [[2.0]], friction=0.5, normal_load=3.0)),
        HarmonicBasis((0, 1), 4096, transitions),
        Excitation.of({"force": 0.4}, {1: {"force": 0.5}}),
        10.0,
    )


@pytest.mark.parametrize(("transitions", "tolerance"), [("sampled", 2e-6), ("located", 1e-10)])
def test_a_stuck_oscillator_against_its_closed_form(transitions, tolerance):
    """T_0 = +-(mu N - k_t |X|), x_0 = (F_0 - T_0) / k; the vibration of an all-stuck contact does not depend on it."""
    omega = 1.5
    bounds = response_bounds(stuck_oscillator(transitions), omega, options=TIGHT)
    vibration = 0.5 / abs(3 + 2 - omega**2 + 0.2j * omega)
    room = 1.5 - 2 * vibration
    assert bounds.converged.all()
    assert bounds.stuck.all()
    assert bounds.shear[:, 0, 0] == pytest.approx([2 * 0.4 / 5, -room, room], abs=tolerance)
    static = bounds.response[:, 0, 0]
    assert (static.min(), static.max()) == pytest.approx(((0.4 - room) / 3, (0.4 + room) / 3), abs=tolerance)
    assert bounds.amplitude_range("mass") == pytest.approx((vibration, vibration), abs=tolerance)
    assert bounds.energy_range() == pytest.approx((0, 0), abs=tolerance)


def mixed_contact(law="jenkins", transitions="located"):
    """Four pairs on a random structure: some stick, some slip, and static shear is coupled with the normal loads."""
    parameters = ContactParameters.of(("t1", "t2", "n"), np.full((4, 3), 3e6), friction=0.5)
    excitation = Excitation.of({"static": 4000}, {1: {"shaker": 400}})
    joint, basis = Joint("contact", law, parameters), HarmonicBasis((0, 1, 2, 3), 64, transitions)
    return HarmonicBalance.of(random_structure(4, seed=2), joint, basis, excitation, 2500.0)


@pytest.fixture(scope="module")
def mixed():
    """The mixed contact near a resonance, and its bounds for the tip."""
    balance = mixed_contact()
    omega = 1100.0
    return balance, omega, response_bounds(balance, omega, output="tip", options=TIGHT)


def test_stuck_pairs_end_on_the_rim_of_the_friction_cone(mixed):
    balance, _, bounds = mixed
    assert bounds.converged.all()
    unloaded = bounds.stuck[0]
    assert 0 < unloaded.sum() < unloaded.size
    for sign, solution, is_stuck in zip((-1, 1), bounds.solutions[1:], bounds.stuck[1:], strict=True):
        fine = HarmonicBasis(balance.basis.harmonics, 4096)
        far = -sign * bounds.direction * 1e3
        _, force = balance.contact.history(solution.state.x, fine, far)
        room = 0.5 * force[:, 2:] - np.abs(force[:, :2])
        assert room.min() > -1e-9
        assert np.all(room.min(axis=2)[is_stuck] < 1e-4 * np.abs(force).max())
        shear = sign * bounds.direction * force[:, :2].mean(axis=2)
        assert np.all(shear[is_stuck & unloaded] > 0)


def test_the_unloaded_start_and_any_other_lie_between_the_extremes(mixed):
    balance, omega, bounds = mixed
    low, high = bounds.amplitude_range("tip")
    assert high > 1.002 * low
    rng = np.random.default_rng(0)
    x = bounds.solutions[0].state.x
    observed = []
    for _ in range(12):
        memory = rng.normal(size=balance.memory.shape) * np.abs(x).max()
        other = newton.solve(balance.with_memory(memory), omega, x, TIGHT)
        assert other.converged
        observed.append(float(amplitude(balance.outputs(other.state), balance.basis.harmonics)[0]))
    spread = high - low
    assert low - 0.2 * spread < min(observed)  # the extremes are found to first order
    assert max(observed) < high + 0.1 * spread
    assert max(observed) - min(observed) > 0.1 * spread
    energy_low, energy_high = bounds.energy_range()
    assert 0 < energy_low < energy_high


def test_amplitude_slope_equals_differences(mixed):
    balance, omega, bounds = mixed
    state, free = bounds.solutions[0].state, bounds.stuck[0]
    k = balance.contact.stiffness[:, :2]
    tight = NewtonOptions(tolerance=1e-13)
    inside = np.where(free, state.x[:, :2, 0] - 0.99 * state.cycle.force[:, :2, 0] / k, 0.0)
    for _ in range(3):  # a slider that was pushed is moved on a little: off the rim
        state = newton.solve(balance.with_memory(inside), omega, state.x, tight).state
        slider = state.x[:, :2, 0] - state.cycle.force[:, :2, 0] / k
        inside = np.where(free, slider + 0.1 * (slider - inside), 0.0)
    slope = amplitude_slope(balance, state, "tip", tolerance=1e-10)
    assert np.all(slope[~free] == 0)
    shear = 1e-5 * np.abs(state.cycle.force).max()
    for pair, c in np.argwhere(free):
        size = []
        for sign in (1, -1):
            memory = inside.copy()
            memory[pair, c] -= sign * shear / k[pair, c]
            solution = newton.solve(balance.with_memory(memory), omega, state.x, tight)
            size.append(float(amplitude(balance.outputs(solution.state), balance.basis.harmonics)[0]))
        difference = (size[0] - size[1]) / (2 * shear)
        assert difference == pytest.approx(slope[pair, c], rel=1e-3, abs=1e-3 * np.abs(slope).max())


def test_planar_friction_has_bounds_too():
    balance = mixed_contact("coulomb_planar", "sampled")
    bounds = response_bounds(balance, 1100.0)
    assert bounds.converged.all()
    assert bounds.amplitude_range("tip")[0] < bounds.amplitude_range("tip")[1]


def test_refusals():
    item = np.eye(1)
    system = SecondOrderSystem(item, item, item, {"force": np.ones(1)}, {"mass": np.ones(1)})
    model = ReducedModel(system, interface(item, ("n",)))
    basis = HarmonicBasis((0, 1), 16)
    parameters = ContactParameters.of(("n",), [[1.0]])
    balance = HarmonicBalance.of(
        model, Joint("contact", "unilateral", parameters), basis, Excitation.of({"force": 1.0}), 2.0
    )
    with pytest.raises(ValueError, match="'unilateral' keeps no slider"):
        response_bounds(balance, 1.0)
    model = ReducedModel(system, interface(item, ("t1",)))
    parameters = ContactParameters.of(("t1",), [[1.0]], friction=0.5, normal_load=1.0)
    basis = HarmonicBasis((1,), 16)
    balance = HarmonicBalance.of(
        model, Joint("contact", "jenkins_constant", parameters), basis, Excitation.of(harmonic={1: {"force": 1.0}}), 2.0
    )
    with pytest.raises(ValueError, match="keep harmonic 0"):
        response_bounds(balance, 1.0)
