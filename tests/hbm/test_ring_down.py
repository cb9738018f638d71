"""A free decay: a known oscillation, and a friction element against its backbone."""

import numpy as np
import pytest

from tests.helpers.verification_models import oscillator
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.nonlinear_modes import BackboneOptions, backbone
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.time.decrement import decrement
from tribodyn.hbm.time.ring_down import from_decay, ring_down
from tribodyn.hbm.time.stepper import IntegrationFailed

MASS, STIFFNESS, RATIO = 1.3, 4.0e4, 0.003


def test_a_linear_decay_gives_its_frequency_and_damping():
    omega, zeta = 150.0, 0.01
    t = np.arange(6000) * 2 * np.pi / omega / 256
    damped = omega * np.sqrt(1 - zeta**2)
    clean = 3e-6 + 2e-4 * np.exp(-zeta * omega * t) * np.cos(damped * t)
    ringing = clean + 2e-7 * np.cos(6.93 * omega * t)  # another mode, a thousandth as large
    for y, exact in ((clean, 1e-6), (ringing, 1e-3)):
        result = from_decay(t, y, 1.03 * omega)
        np.testing.assert_allclose(result.omega, damped, rtol=exact)
        np.testing.assert_allclose(result.damping, zeta / np.sqrt(1 - zeta**2), rtol=3 * exact)
        assert result.amplitude[0] > result.amplitude[-1]
    middle = t[2 * 256]  # of the first window
    assert from_decay(t, clean, omega).amplitude[0] == pytest.approx(2e-4 * np.exp(-zeta * omega * middle), rel=1e-3)
    with pytest.raises(ValueError, match="too short"):
        from_decay(t[:1100], np.cos(omega * t[:1100]), omega)
    lopsided = np.exp(-zeta * omega * t) * (np.cos(omega * t) + 0.2 * np.cos(2 * omega * t))
    np.testing.assert_allclose(from_decay(t, lopsided, omega).omega, omega, rtol=1e-3)
    with pytest.raises(IntegrationFailed, match="harmonics above 3 or other modes"):
        from_decay(t, np.cos(omega * t) + 0.3 * np.cos(4.3 * omega * t), omega)


def test_a_friction_element_decays_along_its_backbone():
    """Its frequency is the backbone's; its amplitude falls faster than the damping there says, by (k + k_eq) / k.

    From one turning point to the next k (a_1^2 - a_2^2) / 2 is lost to friction, 2 F (a - s): the slider's own spring
    holds the same energy at both. The damping of a nonlinear mode counts the same loss against m w^2 a^2."""
    kt, kn, mu, press = 4.0e3, 5.0e6, 0.4, 50.0
    parameters = ContactParameters.of(("t1", "n"), [[kt, kn]], friction=mu)
    balance = HarmonicBalance.of(
        oscillator(MASS, STIFFNESS, RATIO),
        Joint("contact", "jenkins", parameters),
        HarmonicBasis((0, 1, 2, 3), 512),
        Excitation.of({"normal": press}),
        1000.0,
    )
    slip = mu * press / kt
    mode = backbone(balance, 0.5 * slip, 20 * slip, options=BackboneOptions(60))
    decay = ring_down(balance, mode, 150, 256, least=0.6 * slip)
    inside = (decay.amplitude > 2.5 * slip) & (decay.amplitude < 15 * slip)
    assert inside.sum() > 10
    at = np.log(decay.amplitude[inside])
    columns = (mode.omega, mode.damping, decrement(balance, mode))
    omega, zeta, expected = (np.interp(at, np.log(mode.first_harmonic), values) for values in columns)
    np.testing.assert_allclose(decay.omega[inside], omega, rtol=1e-3)
    friction = zeta - RATIO * np.sqrt(STIFFNESS / MASS) / omega  # the dashpot's part keeps its ratio
    faster = friction * MASS * omega**2 / STIFFNESS + zeta - friction
    np.testing.assert_allclose(decay.damping[inside], faster, rtol=1e-2)
    np.testing.assert_allclose(expected, faster, rtol=5e-3)  # the same from the energy that the mode stores
    assert np.abs(decay.damping[inside] / zeta - 1).max() > 0.015
