"""One mass on one contact: the balance against closed forms, and against time integration as harmonics are added."""

from itertools import pairwise

import numpy as np
import pytest

from tests.helpers.verification_models import oscillator
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.verify import verify

MASS, STIFFNESS, RATIO = 1.3, 4.0e4, 0.01
KT, KN, MU, PRESS = 3.0e4, 5.0e6, 0.4, 50.0
NORMAL_FORCE = PRESS * KN / (KN + STIFFNESS)  # what the press leaves on the contact spring
SLIP = MU * NORMAL_FORCE / KT  # displacement at which the element begins to slip


def jenkins(harmonics: tuple[int, ...], n_samples: int, force: complex, omega: float) -> HarmonicBalance:
    parameters = ContactParameters.of(("t1", "n"), [[KT, KN]], friction=MU)
    excitation = Excitation.of({"normal": PRESS}, {1: {"force": force}})
    basis = HarmonicBasis(harmonics, n_samples)
    return HarmonicBalance.of(
        oscillator(MASS, STIFFNESS, RATIO), Joint("contact", "jenkins", parameters), basis, excitation, 2 * omega
    )


def closed_form_force(x: float) -> complex:
    """Fundamental of the Jenkins force for x cos(w t), constant normal load: complex amplitude over x [N/m]."""
    if x <= SLIP:
        return complex(KT)
    theta = np.arccos(1 - 2 * SLIP / x)
    in_phase = KT / np.pi * (theta - np.sin(theta) * np.cos(theta))
    return in_phase + 1j * 4 * MU * NORMAL_FORCE * (x - SLIP) / (np.pi * x * x)


def driven(ratio: float, detuning: float = 1.0) -> tuple[float, float, complex]:
    """Amplitude, so many times that of first slip, frequency over that of resonance, and the force that drives it."""
    x = ratio * SLIP
    omega = float(detuning * np.sqrt((STIFFNESS + closed_form_force(x).real) / MASS))
    damping = 2 * RATIO * np.sqrt(MASS * STIFFNESS)
    return x, omega, x * (STIFFNESS - MASS * omega**2 + 1j * omega * damping + closed_form_force(x))


@pytest.mark.parametrize("ratio", [0.5, 1.01, 1.5, 3.0, 30.0])
@pytest.mark.parametrize("detuning", [0.7, 1.0, 1.6])
def test_one_harmonic_of_a_jenkins_element_is_the_closed_form(ratio, detuning):
    x, omega, force = driven(ratio, detuning)
    balance = jenkins((0, 1), 8192, force, omega)
    solution = newton.solve_from_rest(balance, omega, NewtonOptions(tolerance=1e-10))
    assert solution.converged
    response = balance.outputs(solution.state)[0]
    np.testing.assert_allclose(response / x, [0.0, 1.0, 0.0], atol=1e-6)
    dissipated = 4 * MU * NORMAL_FORCE * max(x - SLIP, 0.0)
    assert balance.energy(solution.state).sum() == pytest.approx(dissipated, rel=1e-6, abs=1e-12 * KT * x * x)


def test_jenkins_element_approaches_time_integration_with_more_harmonics():
    omega = 0.42 * np.sqrt((STIFFNESS + KT) / MASS)  # the third harmonic is near the resonance
    waveform, energy = [], []
    for top in (1, 3, 5, 9, 15):
        balance = jenkins(tuple(range(top + 1)), 4096, 45.0, omega)
        solution = newton.solve_from_rest(balance, omega)
        assert solution.converged
        result = verify(balance, solution.state, Options(steps=4096))
        assert result.outcome == CONVERGED
        waveform.append(result.waveform["mass"])
        energy.append(abs(result.energy))
    assert all(b < 0.7 * a for a, b in pairwise(waveform))
    assert waveform[-1] < 1e-3
    assert energy[-1] < 1e-3 < energy[0]
    assert result.step_error < 1e-5


@pytest.mark.parametrize("ratio", [0.5, 1.01, 1.5, 4.0, 30.0])
def test_law_with_constant_normal_load_is_the_closed_form_to_rounding_where_its_transitions_are_located(ratio):
    x, omega, force = driven(ratio)
    parameters = ContactParameters.of(("t1",), [[KT]], friction=MU, normal_load=NORMAL_FORCE)
    model = oscillator(MASS, STIFFNESS, RATIO, "t1")
    basis = HarmonicBasis((1,), 3, "located")
    balance = HarmonicBalance.of(
        model, Joint("contact", "jenkins_constant", parameters), basis, Excitation.of({}, {1: {"force": force}}), omega
    )
    solution = newton.solve_from_rest(balance, omega, NewtonOptions(tolerance=1e-12))
    assert solution.converged
    np.testing.assert_allclose(balance.outputs(solution.state)[0] / x, [1.0, 0.0], atol=1e-9)
    dissipated = 4 * MU * NORMAL_FORCE * max(x - SLIP, 0.0)
    assert balance.energy(solution.state)[0] == pytest.approx(dissipated, rel=1e-9, abs=1e-12 * KT * x * x)


@pytest.mark.parametrize("press", [30.0, 0.0])
def test_unilateral_contact_with_preload_approaches_time_integration(press):
    omega = 0.8 * np.sqrt((STIFFNESS + 0.5 * KN / 100) / MASS)
    errors = []
    for top in (1, 3, 5, 9, 15):
        model = oscillator(MASS, STIFFNESS, 0.05, "n")
        parameters = ContactParameters.of(("n",), [[KN / 100]])
        excitation = Excitation.of({"normal": press}, {1: {"normal": 40.0}})
        basis = HarmonicBasis(tuple(range(top + 1)), 2048)
        balance = HarmonicBalance.of(model, Joint("contact", "unilateral", parameters), basis, excitation, omega)
        solution = newton.solve_from_rest(balance, omega)
        assert solution.converged
        result = verify(balance, solution.state, Options(steps=2048))
        assert result.outcome == CONVERGED
        assert solution.state.cycle.status[0] & 4  # it does separate
        errors.append(max(result.contact, abs(result.preload)))
    assert all(b < a for a, b in pairwise(errors))
    assert errors[-1] < 2e-3
