"""Stiff springs against rigid contact in closed form: Den Hartog's mass on a spring with Coulomb friction."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from proof.hard_settings.extremes_models import rigid
from tribodyn.hbm import newton
from tribodyn.hbm.continuation.methods import arc_length
from tribodyn.hbm.newton import NewtonOptions

MASS_SPRING, FORCE, NORMAL, FRICTION = 1e6, 60.0, 100.0, 0.2  # N/m, N, N; natural frequency 1000 rad/s


def den_hartog(ratio: float) -> float:
    """Amplitude [m] of the motion without stops under rigid Coulomb friction; ratio : of driving to natural frequency.

    Source  Den Hartog 1931, Trans. ASME 53, APM-53-9"""
    magnified = 1 / (1 - ratio**2)
    damped = np.sin(np.pi / ratio) / (ratio * (1 + np.cos(np.pi / ratio)))
    return float(FORCE / MASS_SPRING * np.sqrt(magnified**2 - (FRICTION * NORMAL / FORCE * damped) ** 2))


def amplitude(spring: float, highest: int, omega: float) -> float:
    body = rigid(1)
    setting = replace(
        body.ordinary, tangential=spring, normal=1e12, friction=FRICTION, preload=NORMAL, force=FORCE, omega=omega,
        damping=0.0, harmonics=(0, *range(1, highest + 1, 2)),
    )  # fmt: skip
    balance = body.balance(setting)
    nearby = arc_length.solve_along_load(balance, omega)
    # what Newton leaves of the residual counts up to 1e5 times beside springs as stiff as that
    solution = newton.solve(balance, omega, nearby.state.x, NewtonOptions(tolerance=1e-12))
    assert nearby.converged
    assert solution.converged
    angle = np.linspace(0, 2 * np.pi, 20_001)
    return float(np.abs(balance.basis.functions(angle) @ balance.outputs(solution.state)[0]).max())


@pytest.mark.parametrize("omega", [700.0, 1200.0])
def test_stiff_springs_tend_to_rigid_friction(omega: float) -> None:
    """Ten times stiffer springs leave a third of the error: a turning slider sticks for a time as the root of 1/k."""
    limits = []
    for highest in (15, 31):
        rows = [amplitude(spring, highest, omega) for spring in (1e9, 1e10, 1e11)]
        first, second = (b - a for a, b in pairwise(rows))
        assert second / first == pytest.approx(10**-0.5, rel=0.05)
        limits.append(rows[-1] + second * (second / first) / (1 - second / first))
        assert abs(rows[-1] / limits[-1] - 1) < 1e-3  # at 1e5 times the stiffness of the body
    exact = den_hartog(omega / 1000)
    coarse, fine = (abs(limit / exact - 1) for limit in limits)
    assert fine < 0.6 * coarse < 0.003  # the kinks of the motion fall with the highest harmonic
    assert 2 * limits[1] - limits[0] == pytest.approx(exact, rel=2e-4)
