"""The other contact laws on one mass: against time integration with the same law, and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.verify import verify
from tribodyn.reduction.model import ReducedModel

STIFFNESS = np.array([4.0e4, 5.0e4, 6.0e4])
LOADS = ("along", "across", "press")


def mass_on_contact(components: tuple[str, ...]) -> ReducedModel:
    """m = 1.3 kg on springs t1, t2, n of its own, 2 % damping, loads and outputs named along, across, press."""
    used = [i for i, c in enumerate(("t1", "t2", "n")) if c in components]
    n, k = len(used), STIFFNESS[used]
    vectors = {LOADS[i]: np.eye(n)[j] for j, i in enumerate(used)}
    damping = np.diag(2 * 0.02 * np.sqrt(1.3 * k))
    system = SecondOrderSystem(1.3 * np.eye(n), np.diag(k), damping, vectors, vectors)
    return ReducedModel(system, interface(np.eye(n), components))


def solved(law, components, parameters, excitation, omega, top, transitions="sampled", n_samples=1024):
    basis = HarmonicBasis(tuple(range(top + 1)), n_samples, transitions)
    balance = HarmonicBalance.of(
        mass_on_contact(components), Joint("contact", law, parameters), basis, excitation, omega
    )
    solution = newton.solve_from_rest(balance, omega, NewtonOptions(tolerance=1e-10))
    assert solution.converged
    return balance, solution.state


@pytest.mark.parametrize("across", [2.0e4, 6.0e4], ids=["isotropic", "unequal springs"])
def test_planar_friction_on_an_ellipse_agrees_with_time_integration(across):
    """Rotating load and swinging press: the direction of slip turns all the time."""
    components = ("t1", "t2", "n")
    parameters = ContactParameters.of(components, [[2.0e4, across, 1.0e6]], friction=0.4)
    excitation = Excitation.of({"press": 80.0, "along": 5.0}, {1: {"along": 40.0, "across": 30.0j, "press": 20.0}})
    errors = []
    for top in (1, 3, 7):
        balance, state = solved("coulomb_planar", components, parameters, excitation, 190.0, top)
        assert state.cycle.status[0] & SLIPS
        result = verify(balance, state, Options(steps=2048))
        assert result.outcome == CONVERGED
        errors.append(result.largest)
    assert errors[-1] < 5e-3
    assert errors[-1] < errors[0]


@pytest.mark.parametrize("transitions", ["sampled", "located"])
def test_constant_load_agrees_with_time_integration(transitions):
    parameters = ContactParameters.of(("t1",), [[3.0e4]], friction=0.4, normal_load=50.0)
    excitation = Excitation.of(harmonic={1: {"along": 45.0}})
    balance, state = solved("jenkins_constant", ("t1",), parameters, excitation, 100.0, 9, transitions)
    assert state.cycle.status[0] == STICKS | SLIPS
    result = verify(balance, state, Options(steps=2048))
    assert result.outcome == CONVERGED
    assert result.largest < 2e-3


@pytest.mark.parametrize("transitions", ["sampled", "located"])
def test_normal_contact_alone_agrees_with_time_integration(transitions):
    parameters = ContactParameters.of(("n",), [[6.0e4]], gap=1e-4)
    excitation = Excitation.of({"press": 20.0}, {1: {"press": 25.0}})
    balance, state = solved("unilateral", ("n",), parameters, excitation, 210.0, 9, transitions)
    assert state.cycle.status[0] == STICKS | SEPARATES
    result = verify(balance, state, Options(steps=2048))
    assert result.outcome == CONVERGED
    assert result.largest < 2e-3
    assert balance.energy(state)[0] == 0.0


def test_duffing_oscillator_of_one_harmonic_is_its_closed_form():
    """(k + k_c + 3/4 k_3 A^2 - m w^2)^2 + (c w)^2 = (F / A)^2."""
    amplitude, omega = 2e-3, 230.0
    k, cubic = STIFFNESS[0] + 3.0e4, 5.0e9
    damping = 2 * 0.02 * np.sqrt(1.3 * STIFFNESS[0])
    dynamic = k + 0.75 * cubic * amplitude**2 - 1.3 * omega**2 + 1j * damping * omega
    parameters = ContactParameters.of(("t1",), [[3.0e4]], cubic=cubic)
    excitation = Excitation.of(harmonic={1: {"along": amplitude * dynamic}})
    basis = HarmonicBasis((1,), 16)
    balance = HarmonicBalance.of(
        mass_on_contact(("t1",)), Joint("contact", "cubic_spring", parameters), basis, excitation, omega
    )
    start = np.array([[[0.9 * amplitude, 0.0]]])
    solution = newton.solve(balance, omega, start, NewtonOptions(tolerance=1e-13))
    assert solution.converged
    assert balance.outputs(solution.state)[0] == pytest.approx([amplitude, 0.0], abs=1e-12 * amplitude)


def test_one_harmonic_of_a_jenkins_element_is_its_closed_form_to_rounding():
    """Located transitions: the describing function without an error of sampling, at 3 samples."""
    kt, limit = 3.0e4, 20.0
    slip = limit / kt
    omega = 200.0
    for ratio in (1.01, 1.5, 3.0, 30.0):
        x = ratio * slip
        theta = np.arccos(1 - 2 / ratio)
        force = kt / np.pi * (theta - np.sin(theta) * np.cos(theta)) + 4j * limit * (x - slip) / (np.pi * x * x)
        damping = 2 * 0.02 * np.sqrt(1.3 * STIFFNESS[0])
        dynamic = STIFFNESS[0] - 1.3 * omega**2 + 1j * damping * omega + force
        parameters = ContactParameters.of(("t1",), [[kt]], friction=0.4, normal_load=50.0)
        excitation = Excitation.of(harmonic={1: {"along": x * dynamic}})
        balance, state = solved("jenkins_constant", ("t1",), parameters, excitation, omega, 1, "located", 3)
        assert balance.outputs(state)[0] == pytest.approx([0.0, x, 0.0], abs=1e-9 * x)
        assert balance.energy(state)[0] == pytest.approx(4 * limit * (x - slip), rel=1e-9)
