"""The performance curve of a friction damper, peak amplitude over its load, against its closed form (Griffin 1980)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from tests.helpers.jenkins import describing_function
from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.contact.law import ContactParameters
from tribodyn.hbm.continuation.operating_point import AtPeak
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.reduction.model import ReducedModel

DAMPER, DAMPING, FORCE = 0.5, 0.004, 1.0  # stiffness and viscous damping of one blade mode, m = k = 1


def peak(limit: float, harmonics: tuple[int, ...] = (1,)) -> float:
    """Peak amplitude of the mode beside a damper that slips at a limit [N]."""
    one = np.ones((1, 1))
    system = SecondOrderSystem(one, one, DAMPING * one, {"wave": one[0]}, {"tip": one[0]})
    model = ReducedModel(system, interface(one, ("t1",)))
    numbers = ContactParameters.of(("t1",), [[DAMPER]], friction=1.0, normal_load=limit)
    basis = HarmonicBasis(harmonics, 64, "located")
    load = Excitation.of({}, {1: {"wave": FORCE}})
    balance = HarmonicBalance.of(model, Joint("damper", "jenkins_constant", numbers), basis, load, 2.0)
    found = AtPeak("tip", 0.9, 1.4).first(balance)
    assert found.solution.converged
    return float(found.amplitude)


def closed_form(limit: float) -> float:
    """The largest amplitude that the force sustains at any frequency, friction by its describing function."""

    def missing(amplitude: float) -> float:
        stiff, lost = describing_function(amplitude, DAMPER, limit)

        def needed(omega: float) -> float:
            return float(np.hypot((1 - omega**2) * amplitude + stiff, DAMPING * omega * amplitude - lost))

        best = minimize_scalar(needed, bounds=(0.9, 1.4), method="bounded", options={"xatol": 1e-10})
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
