"""Quantities with units: exact factors, dimensions, and sentences for what is wrong."""

import math

import pytest

from tribodyn.workflows.scene.units import to_si


@pytest.mark.parametrize(("given", "unit", "expected"), [
    ("20 kN", "N", 2e4),
    ("470 N/um", "N/m", 470e6),
    ("583 N/µm", "N/m", 583e6),
    ("2e3 um3/J", "m3/J", 2e-15),
    ("2e3 um^3/J", "m3/J", 2e-15),
    ("7860 kg/m3", "kg/m3", 7860.0),
    ("210 GPa", "Pa", 210e9),
    ("0.3mm", "m", 3e-4),
    ("-5 kN", "N", -5e3),
    ("1 %", "", 0.01),
    ("90 deg", "rad", math.pi / 2),
    ("3000 rpm", "Hz", 50.0),
    ("2 ms", "s", 2e-3),
    ("3 N m/rad", "N m/rad", 3.0),
    (20, "N", 20.0),
    (0.5, "", 0.5),
])  # fmt: skip
def test_converts_to_the_last_bit(given: object, unit: str, expected: float) -> None:
    assert to_si(given, unit) == expected


def test_angular_frequency_is_a_frequency() -> None:
    assert to_si(f"{2 * math.pi * 410} rad/s", "Hz") == pytest.approx(410, rel=1e-15)


@pytest.mark.parametrize(("given", "unit", "words"), [
    ("20 mm", "N", 'expected a force such as "20 kN" or a bare number in N, got "20 mm" which is a length'),
    ("20", "N", '"20" without a unit'),
    ("20 foo", "N", '"foo" is not a unit'),
    ("3 1/s", "Hz", "which is a rate"),
    ("abc", "m", 'got "abc"'),
    (True, "N", "got True"),
    ([1], "m", "got [1]"),
    (float("nan"), "m", "got nan"),
    (float("inf"), "m", "got inf"),
    ("1e400 m", "m", "beyond what a structure has"),
    ("1e99999999 m", "m", "expected a length"),
    ("5 mm", "", "which is a length"),
])  # fmt: skip
def test_says_what_is_wrong(given: object, unit: str, words: str) -> None:
    with pytest.raises(ValueError, match="expected a") as caught:
        to_si(given, unit)
    assert words in str(caught.value)
