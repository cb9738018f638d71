"""A Duffing oscillator beside closed forms: where a stepped sweep jumps, and a blow on its linear kin."""

import numpy as np
import pytest

from tests.helpers.verification_models import oscillator
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.methods import natural
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.outcome import BranchEnd
from tribodyn.hbm.time.ring_down import hammer

MASS, STIFFNESS, RATIO = 1.3, 4.0e4, 0.01
KT, CUBIC, FORCE = 3.0e4, 2e9, 20.0
DASHPOT = 2 * RATIO * np.sqrt(MASS * STIFFNESS)


def duffing(harmonics: tuple[int, ...] = (1,)) -> HarmonicBalance:
    joint = Joint("contact", "cubic_spring", ContactParameters.of(("n",), [[KT]], cubic=CUBIC))
    load = Excitation.of({}, {1: {"force": FORCE * np.exp(0.3j)}})
    model = oscillator(MASS, STIFFNESS, RATIO, "n")
    return HarmonicBalance.of(model, joint, HarmonicBasis(harmonics, 256), load, 1e4)


@pytest.mark.parametrize("way", [(120.0, 420.0), (420.0, 120.0)], ids=["up", "down"])
def test_a_stepped_sweep_jumps_where_the_closed_form_folds_on_its_way(way):
    """F^2 = ((k_A - m w^2)^2 + (c w)^2) A^2: up the larger, down the smaller frequency of the two vertical tangents."""
    force = 5.0
    branch = natural.follow(duffing().with_load(force / FORCE), *way, natural.Options(n_points=61))
    a = np.linspace(1e-5, 5e-3, 1_000_001)
    half = (STIFFNESS + KT + 0.75 * CUBIC * a**2 - DASHPOT**2 / (2 * MASS)) / MASS
    root = half**2 - ((STIFFNESS + KT + 0.75 * CUBIC * a**2) ** 2 - (force / a) ** 2) / MASS**2
    previous = np.sqrt(half[root > 0] + np.sqrt(root[root > 0]))  # the resonance, by rising amplitude
    low = int(previous.argmin())
    expected = previous[low:].max() if way[0] < way[1] else previous[low]
    assert branch.ended is BranchEnd.JUMPED
    jump = branch.omega[list(branch.folds)]
    assert len(jump) == 1
    np.testing.assert_allclose(jump, expected, rtol=1e-6)


def test_a_blow_on_a_linear_oscillator_rings_as_its_closed_form():
    """v = I / m at the start, then a damped cosine."""
    linear = Joint("contact", "cubic_spring", ContactParameters.of(("n",), [[KT]], cubic=0.0))
    model = oscillator(MASS, STIFFNESS, RATIO, "n")
    basis, load = HarmonicBasis((1,), 64), Excitation.of({}, {1: {"force": FORCE}})
    balance = HarmonicBalance.of(model, linear, basis, load, 1e4)
    omega = np.sqrt((STIFFNESS + KT) / MASS)
    zeta = DASHPOT / (2 * MASS * omega)
    swing = hammer(balance, 0.13, omega, "mass", 20, 256)
    damped = omega * np.sqrt(1 - zeta**2)
    exact = 0.13 / (MASS * damped) * np.exp(-zeta * omega * swing.time) * np.sin(damped * swing.time)
    np.testing.assert_allclose(swing.displacement, exact - exact.mean(), atol=2e-3 * exact.max())
    np.testing.assert_allclose(swing.omega, damped, rtol=1e-4)
    np.testing.assert_allclose(swing.damping, zeta / np.sqrt(1 - zeta**2), rtol=1e-3)
