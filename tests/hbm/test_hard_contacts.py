"""Small problems with hard contacts, or with nothing but their contact: solved from rest and followed past grazing."""

import numpy as np
import pytest

from tests.helpers.verification_models import oscillator
from tribodyn import matrices as own
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis


def stopped(hardness: float) -> HarmonicBalance:
    """An oscillator that would swing to 2.5 gaps against a stop harder than its spring by a factor."""
    joint = Joint("stop", "unilateral", ContactParameters.of(("n",), [[hardness]], gap=1.0))
    basis, load = HarmonicBasis((0, 1, 2, 3, 4, 5), 128, "located"), Excitation.of(harmonic={1: {"force": 0.1}})
    return HarmonicBalance.of(oscillator(1.0, 1.0, 0.02, "n"), joint, basis, load, 10.0)


def test_a_hard_stop_is_followed_past_grazing_from_both_ends():
    hardness = 1e7
    up, down = (arc_length.follow(stopped(hardness), *ends) for ends in ((0.5, 2.0), (2.0, 0.5)))
    for branch, end in ((up, 2.0), (down, 0.5)):
        assert branch.omega[-1] == end, branch.end
    ups, downs = (np.sort(branch.omega[list(branch.folds)]) for branch in (up, down))
    assert len(ups) >= 2
    np.testing.assert_allclose([ups[0], ups[-1]], [downs[0], downs[-1]], rtol=1e-6)
    softer = arc_length.follow(stopped(1e4), 0.5, 2.0)
    limit = 1.5847  # to which the stops tend, as hardness^-1/2: 1.5891 at 1e4, 1.5849 at 1e7
    assert abs(up.amplitude("mass").max() - limit) < 0.1 * abs(softer.amplitude("mass").max() - limit)
    for omega, contact in list(zip(up.omega, up.contact, strict=True))[::20]:
        balance = stopped(hardness)
        state = balance.evaluate(omega, contact.reshape(1, 1, -1), jacobian=False)
        motion = contact.ravel() @ HarmonicBasis((0, 1, 2, 3, 4, 5), 20_000).synthesis.T
        pushed = hardness * np.maximum(motion - 1.0, 0.0)  # sampled closely: the force is that of the law
        assert state.cycle.force[0, 0, 0] == pytest.approx(pushed.mean(), rel=0.05, abs=1e-6)


def on_friction(
    stiffness: float, spring: float, force: float, harmonics: tuple[int, ...], damping: float
) -> own.Balance:
    inputs = own.from_arrays(np.eye(1), np.array([[stiffness]]), np.array([[damping]]))
    numbers = {"friction": 0.5, "normal_load": 2.0}
    rub = own.Contact(
        "rub", inputs.contact([[0]], components=("t1",), area=1.0), "jenkins_constant", spring, numbers=numbers
    )
    reduced = own.reduce(inputs, rub, loads={"f": 0}, outputs={"x": 0})
    return reduced.balance(harmonics, up_to=3.0, harmonic={1: {"f": force}})


@pytest.mark.parametrize(
    ("spring", "force", "harmonics", "frequency", "damping"),
    [(38.20359, 0.4148268, (1,), 0.8204728, 1e-3), (3.832306, 0.7733444, (1, 3, 5, 7, 9, 11), 0.2853203, 0.0)],
)
def test_an_oscillator_on_friction_is_solved_from_rest_where_newton_and_its_ramp_fail(
    spring, force, harmonics, frequency, damping
):
    balance = on_friction(1.0, spring, force, harmonics, damping)
    omega = 2 * np.pi * frequency
    assert not newton.solve_from_rest(balance.problem, omega).converged, "an easier problem: take another"
    solution = balance.solve(frequency)
    assert solution.converged
    assert newton.relative_residual(solution.state, balance.problem.x_lin(omega)) < 1e-8


def test_a_mass_that_friction_alone_holds_is_the_closed_form():
    """M x'' + c x' + Jenkins(x) = F, one harmonic: its complex stiffness is known."""
    spring, force, frequency = 1.0, 2.0, 0.2
    balance = on_friction(0.0, spring, force, (1,), 0.1)
    solution = balance.solve(frequency)
    size, slip, omega = solution.amplitude("x"), 1.0 / spring, 2 * np.pi * frequency
    theta = np.arccos(1 - 2 * slip / size)
    complex_spring = spring / np.pi * (theta - np.sin(theta) * np.cos(theta)) + 4j * (size - slip) / (np.pi * size**2)
    assert size > 1.2 * slip
    assert abs(complex_spring - omega**2 + 0.1j * omega) * size == pytest.approx(force, rel=1e-8)


@pytest.mark.parametrize("stiffness", [0.0, 1e-9])
def test_a_pure_cubic_spring_has_a_first_point_and_a_whole_curve(stiffness):
    inputs = own.from_arrays(np.eye(1), np.array([[stiffness]]), np.array([[0.05]]))
    spring = own.Contact("spring", inputs.contact([[0]], area=1.0), "cubic_spring", 0.0, 0.0, numbers={"cubic": 1.0})
    reduced = own.reduce(inputs, spring, loads={"f": 0}, outputs={"x": 0})
    balance = reduced.balance((1,), up_to=1.0, harmonic={1: {"f": 0.1}})
    for ends in ((0.02, 0.4), (0.4, 0.02)):
        branch: Branch = balance.response(*ends, method="arc_length")
        assert branch.frequency[-1] == pytest.approx(ends[1])
        omega, size = 2 * np.pi * branch.frequency, branch.amplitude("x")
        equation = np.hypot(0.75 * size**2 + stiffness - omega**2, 0.05 * omega) * size
        np.testing.assert_allclose(equation, 0.1, rtol=1e-5)
        assert len(branch.folds) == 2
