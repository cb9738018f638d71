"""The highest peak of several outputs, from the points of a scan."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers.continuation_models import rubbing_mass
from tests.helpers.pressed_body import balance_of, pressed_body
from tribodyn.hbm.continuation import highest_peak
from tribodyn.hbm.continuation.methods import adaptive
from tribodyn.hbm.continuation.resonance_peak import AtPeak


def resonance(omega: np.ndarray, at: float, width: float, height: float) -> np.ndarray:
    """Amplitude of a single resonance."""
    return height * width / np.hypot(omega - at, width)


def test_one_resonance_is_a_parabola() -> None:
    omega = np.array([990.0, 1001.5, 1004.0])
    assert highest_peak.vertex(omega, resonance(omega, 1000.0, 3.0, 2e-3)) == pytest.approx((1000.0, 2e-3), rel=1e-9)


def test_points_that_are_no_resonance_are_taken_as_they_are() -> None:
    omega, heights = np.array([990.0, 1000.0, 1020.0]), np.array([1e-6, 1.0, 0.999])
    assert highest_peak.vertex(omega, heights) == (1000.0, 1.0)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("omega", [(1.0, 2.0, 2.0), (2.0, 2.0, 2.0), (2.0, 3.0, 2.0), (1.0, 2.0, 2.0 + 1e-15)])
def test_points_where_a_curve_stands_or_turns_back_have_no_parabola(omega: tuple[float, ...]) -> None:
    """Met by arc length of two blocks out of a CAD file, which came back on the frequencies it had been at."""
    assert highest_peak.vertex(np.array(omega), np.array([1.0, 2.0, 1.5])) == (omega[1], 2.0)


def test_the_higher_of_two_outputs_comes_first_and_a_low_one_not_at_all() -> None:
    omega = np.linspace(900.0, 1100.0, 41)
    heights = np.stack([resonance(omega, at, 8.0, high) for at, high in ((951.0, 1.0), (1003.0, 1.06), (1060.0, 0.5))])
    peaks = highest_peak.candidates(omega, heights.T)
    assert [(abs(omega[point] - at) < 5.0, output) for (point, output), at in zip(peaks, (1003, 951), strict=True)] == [
        (True, 1),
        (True, 0),
    ]


def test_the_peak_is_the_one_that_its_slope_finds() -> None:
    balance, site = balance_of(pressed_body(), (0, 1)), AtPeak("tip", 300.0, 700.0)
    branch = adaptive.follow(balance, site.start, site.stop, adaptive.Options(tolerance=0.03, newton=site.newton))
    result, selection = highest_peak.highest(balance, branch, [site.output], replace(site, output="none"))
    exact = site.solve(balance)
    assert selection == 0
    assert result.amplitude == pytest.approx(exact.amplitude, rel=1e-4)
    assert result.state.omega == pytest.approx(exact.state.omega, rel=1e-3)


def test_a_resonance_that_nothing_limits_is_no_peak():
    """Above 4 mu N / pi the force works more than friction, and without damping the response has no bound."""
    site, undamped = AtPeak("mass", 0.5, 3.0), rubbing_mass(zeta=0.0)
    assert site.solve(rubbing_mass().with_load(2.0)).solution.converged
    assert site.solve(undamped.with_load(1.5)).solution.converged
    unbounded = site.solve(undamped.with_load(2.0))
    assert "nothing limits the resonance at 0.159" in str(unbounded.solution.outcome)
    assert unbounded.solves < 150
