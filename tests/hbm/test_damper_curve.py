"""The performance curve of a friction damper, peak amplitude over its load, against its closed form (Griffin 1980)."""

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from tests.helpers.jenkins import describing_function
from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.continuation.resonance_peak import AtPeak
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.reduction.model import ReducedModel

DAMPER, DAMPING, FORCE = 0.5, 0.004, 1.0  # stiffness and viscous damping of one blade mode, m = k = 1


def peak(limit: float, harmonics: tuple[int, ...] = (1,)) -> float:
    """Peak amplitude of the mode beside a damper that slips at a limit [N]."""
    item = np.ones((1, 1))
    system = SecondOrderSystem(item, item, DAMPING * item, {"wave": item[0]}, {"tip": item[0]})
    model = ReducedModel(system, interface(item, ("t1",)))
    numbers = ContactParameters.of(("t1",), [[DAMPER]], friction=1.0, normal_load=limit)
    basis = HarmonicBasis(harmonics, 64, "located")
    load = Excitation.of({}, {1: {"wave": FORCE}})
    balance = HarmonicBalance.of(model, Joint("damper", "jenkins_constant", numbers), basis, load, 2.0)
    peak_point = AtPeak("tip", 0.9, 1.4).solve(balance)
    assert peak_point.solution.converged
    return float(peak_point.amplitude)


def chain_peak(limit: float, waves: int, blades: int = 6) -> tuple[float, float]:
    """Peak amplitude of a chain without symmetry of blades, a shroud between neighbours; and how far blades differ.

    Every blade is a mode as above; the force is a wave of so many nodal diameters, shrouds slip at a limit [N]"""
    item, angle = np.eye(blades), 2 * np.pi * waves / blades * np.arange(blades)
    observed = {f"tip {k}": item[k] for k in range(blades)}
    system = SecondOrderSystem(item, item, DAMPING * item, {"cos": np.cos(angle), "sin": np.sin(angle)}, observed)
    model = ReducedModel(system, interface(np.roll(item, 1, axis=1) - item, ("t1",)))
    numbers = ContactParameters.of(("t1",), [[DAMPER]] * blades, friction=1.0, normal_load=limit)
    basis = HarmonicBasis((1,), 64, "located")
    load = Excitation.of({}, {1: {"cos": FORCE, "sin": -1j * FORCE}})
    balance = HarmonicBalance.of(model, Joint("shroud", "jenkins_constant", numbers), basis, load, 3.0)
    peak_point = AtPeak("tip 0", 0.9, 1.9).solve(balance)
    assert peak_point.solution.converged
    heights = np.linalg.norm(peak_point.response, axis=1)
    return float(peak_point.amplitude), float(np.ptp(heights) / heights.max())


def closed_form(limit: float, damper: float = DAMPER) -> float:
    """The largest amplitude that the force sustains at any frequency, friction by its describing function."""

    def missing(amplitude: float) -> float:
        stiff, lost = describing_function(amplitude, damper, limit)

        def needed(omega: float) -> float:
            return float(np.hypot((1 - omega**2) * amplitude + stiff, DAMPING * omega * amplitude - lost))

        best = minimize_scalar(
            needed, bounds=(0.9, 0.2 + np.sqrt(1 + damper)), method="bounded", options={"xatol": 1e-10}
        )
        return float(best.fun) - FORCE

    return float(brentq(missing, 1e-2, 300.0))


@pytest.mark.parametrize("limit", [0.9, 1.2, np.pi / 2, 2.0, 4.0])
def test_peak_over_damper_load_is_griffins(limit: float) -> None:
    assert peak(limit) == pytest.approx(closed_form(limit), rel=2e-6)


def test_optimum_without_other_damping_is_half_pi_of_the_force() -> None:
    """p = mu N: the peak is p^2 / (k_d (p - pi F / 4)), lowest at p = pi F / 2, where it is pi F / k_d."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tests.hbm.test_damper_curve.DAMPING", 1e-9)
        for limit in (1.2, np.pi / 2, 2.5):
            assert peak(limit) == pytest.approx(limit**2 / (DAMPER * (limit - np.pi / 4)), rel=1e-6)
        assert peak(np.pi / 2) == pytest.approx(np.pi / DAMPER, rel=1e-6)


@pytest.mark.parametrize("waves", [1, 2, 3])
@pytest.mark.parametrize("share", [0.8, 1.0, 1.6])
def test_peak_over_shroud_load_is_that_of_a_damper_between_neighbours(waves: int, share: float) -> None:
    """Neighbours move by s = 2 sin(pi n / N) of the amplitude: a damper of s^2 k slips at s p, best at pi F / 2."""
    s = 2 * np.sin(np.pi * waves / 6)
    height, differ = chain_peak(share * np.pi * FORCE / (2 * s), waves)
    assert height == pytest.approx(closed_form(share * np.pi * FORCE / 2, s**2 * DAMPER), rel=1e-7)
    assert differ < 1e-8


def test_optimum_of_a_shroud_without_other_damping(monkeypatch: pytest.MonkeyPatch) -> None:
    """The optimum pi F / (2 s) has the amplitude pi F / (s^2 k), and is lower than either side."""
    monkeypatch.setattr("tests.hbm.test_damper_curve.DAMPING", 1e-9)
    s = 2 * np.sin(np.pi * 2 / 6)
    lower, best, above = (chain_peak(share * np.pi * FORCE / (2 * s), 2)[0] for share in (0.9, 1.0, 1.1))
    assert best == pytest.approx(np.pi * FORCE / (s**2 * DAMPER), rel=1e-6)
    assert best < min(lower, above)
