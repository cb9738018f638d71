"""Margins of a cycle of stress against closed forms."""

import numpy as np
import pytest

from tribodyn.hbm.fatigue import (
    PlaceFatigue,
    Strength,
    StressPlace,
    equivalent_amplitude,
    equivalent_mean,
    largest_von_mises,
    utilisation,
)
from tribodyn.hbm.harmonics import HarmonicBasis

BASIS = HarmonicBasis((0, 1), 64)
STEEL = Strength(200.0, 600.0, 400.0)


def cycle(mean, amplitude, component=0):
    """Coefficients (6, 3) of one component that swings about a mean."""
    stress = np.zeros((6, 3))
    stress[component, :2] = mean, amplitude
    return stress


@pytest.mark.parametrize(
    ("diagram", "mean", "expected"),
    [("goodman", 300.0, 1.0), ("gerber", 300.0, 2 / 3), ("soderberg", 200.0, 1.0), ("goodman", -300.0, 0.5),
     ("goodman", 700.0, np.inf),
     (((-100.0, 300.0), (0.0, 200.0), (400.0, 100.0)), 200.0, 100 / 150)],
)  # fmt: skip
def test_uniaxial_by_haigh(diagram, mean, expected):
    strength = Strength(200.0, 600.0, 400.0, diagram)
    assert utilisation(cycle(mean, 100.0), BASIS, strength) == pytest.approx(expected)


def test_shear_and_compression():
    """Reversed shear counts sqrt(3) times, also where it turns; a cycle into compression has a negative mean."""
    turning = cycle(0.0, 10.0, 5)
    turning[4, 2] = 10.0
    for stress in (cycle(0.0, 10.0, 5), turning):
        assert equivalent_amplitude(stress, BASIS) == pytest.approx(np.sqrt(3) * 10, rel=1e-12)
    assert equivalent_amplitude(cycle(-50.0, 50.0), BASIS) == pytest.approx(50.0)
    assert equivalent_mean(cycle(-50.0, 50.0), BASIS) == pytest.approx(-50.0)
    assert largest_von_mises(cycle(30.0, 50.0), BASIS) == pytest.approx(80.0)


def test_crossland_holds_its_two_limits():
    """It gives 1 in reversed tension and in reversed torsion at their limits, and sees a rotating shear whole."""
    strength = Strength(200.0, 600.0, torsion_limit=130.0)
    assert utilisation(cycle(0.0, 200.0), BASIS, strength) == pytest.approx(1.0, rel=1e-3)
    assert utilisation(cycle(0.0, 130.0, 5), BASIS, strength) == pytest.approx(1.0, rel=1e-3)
    rotating = cycle(0.0, 130.0, 5)
    rotating[4, 2] = 130.0
    assert utilisation(rotating, BASIS, strength) == pytest.approx(1.0, rel=1e-3)
    assert utilisation(cycle(100.0, 130.0, 5) + cycle(60.0, 0.0), BASIS, strength) > 1.0


def test_life_by_limit_and_by_miner():
    """A limit is reached between rows; two duties on an S-N line take shares of the life by a closed integral."""
    rising = np.array([[0.5, 0.0], [0.9, 0.0], [1.4, 0.0]])
    assert PlaceFatigue(STEEL, np.array([0.0, 10, 20]), rising, np.array([0.3, 0.7])).life == pytest.approx(12.0)
    assert PlaceFatigue(STEEL, np.array([0.0, 10, 20]), 0.5 * rising, np.ones(2) / 2).life is None
    line = Strength(200.0, 600.0, knee=1e6, exponent=5.0)
    of_line = PlaceFatigue(line, np.array([0.0, 1e6]), np.array([[1.0, 2.0], [2.0, 2.0]]), np.array([0.25, 0.75]))
    cycles, total = of_line.miner_sum()
    assert total[-1] == pytest.approx(0.25 * (2**6 - 1) / 6 + 0.75 * 32, rel=1e-4)
    assert of_line.life == pytest.approx(np.interp(1.0, total, cycles))
    assert PlaceFatigue(line, np.array([0.0, 1e6]), np.array([[0.5], [0.9]]), np.ones(1)).miner_sum()[1][-1] == 0


def test_heat_weakens_all_strengths():
    """At half of its strengths a material is used as one under twice the stress."""
    strength = Strength(200.0, 600.0, temperatures=((0.0, 1.0), (100.0, 0.0)))
    warm = StressPlace("root", 0, strength=strength, weakening=0.5)
    assert strength.share(np.array([-5.0, 50.0])) == pytest.approx([1.0, 0.5])
    assert warm.utilisation(cycle(60.0, 40.0), BASIS) == pytest.approx(80 / (200 * (1 - 120 / 600)))
