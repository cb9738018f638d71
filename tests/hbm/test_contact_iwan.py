"""Iwan's joint against its closed forms: loss of a cycle, and the one Jenkins element that it can be."""

import numpy as np
import pytest

from tribodyn.hbm.contact import aft, contact_law
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.harmonics import HarmonicBasis

K_T, MU, LOAD = 5e7, 0.3, 40.0


def cycle(amplitude, weak, chi, transitions="located", law="iwan"):
    """Force over a cycle of a pair under a constant load, by the law."""
    numbers = {"weak": weak, "exponent": chi} if law == "iwan" else {}
    parameters = ContactParameters.of(("t1", "n"), [[K_T, 1e8]], friction=MU, **numbers)
    basis = HarmonicBasis((0, 1), 1024, transitions)
    x = np.zeros((1, 2, 3))
    x[0, 0, 1], x[0, 1, 0] = amplitude, LOAD / 1e8
    return basis, x, aft.cycle(contact_law.load(law), x, contact_law.complete(law, parameters), basis)


@pytest.mark.parametrize(("weak", "chi"), [(1.0, 0.0), (0.7, -0.4), (0.5, 0.5)])
def test_loss_and_exponent_are_those_of_the_density(weak, chi):
    """Segalman: 4 R a^(chi + 3) / ((chi + 2) (chi + 3)) below the largest reach, with R of the weak stiffness."""
    largest = MU * LOAD / K_T / (1 - weak + weak * (chi + 1) / (chi + 2))
    swing = largest * np.geomspace(0.02, 1, 25)
    losses = []
    for a in swing:
        basis, x, result = cycle(a, weak, chi)
        losses.append(basis.work_per_cycle(result.force, x)[0, 0])
    density = K_T * weak * (chi + 1) / largest ** (chi + 1)
    exact = 4 * density * swing ** (chi + 3) / ((chi + 2) * (chi + 3))
    assert np.abs(np.array(losses) / exact - 1).max() < 0.1
    exponent = np.polyfit(np.log(swing), np.log(np.array(losses) / swing**2), 1)[0]
    assert exponent == pytest.approx(chi + 1, abs=0.03)


def test_beyond_the_largest_reach_all_of_it_slips():
    """Loss 4 (mu N a - stored), where each slider stores f^2 / k, and the limits add to mu N."""
    amplitude = 20 * MU * LOAD / K_T
    for transitions in ("sampled", "located"):
        basis, x, result = cycle(amplitude, 0.8, 0.0, transitions)
        loss = basis.work_per_cycle(result.force, x)[0, 0]
        # stored: the integral of k reach^2 over the density, a third of its square, and the last slider
        largest = MU * LOAD / K_T / (0.2 + 0.4)
        stored = K_T * largest**2 * (0.2 + 0.8 / 3)
        assert loss == pytest.approx(4 * (MU * LOAD * amplitude - stored), rel=2e-3)


def test_without_weak_sliders_it_is_a_jenkins_element():
    for transitions in ("sampled", "located"):
        for ratio in (0.5, 3.0):
            one, other = (cycle(ratio * MU * LOAD / K_T, 0.0, 0.3, transitions, law)[2] for law in ("iwan", "jenkins"))
            np.testing.assert_array_equal(one.force, other.force)
            np.testing.assert_array_equal(one.jacobian, other.jacobian)
            assert one.status == other.status
