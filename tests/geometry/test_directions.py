"""Axes of a material that a deck turns, against CalculiX."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.small_decks import ENDING, bricks, by_calculix, frequencies, straight
from tribodyn.geometry.sources.directions import System, axis_rotation

TENSOR = """*ELASTIC, TYPE=ANISO
150000., 4000., 12000., 5000., 4200., 13000., 3000., 100.,
200., 5000., -400., 150., 90., 60., 4500., 80.,
70., 50., 40., 30., 3500.
"""
Z30, Z_30 = (
    f"{np.cos(a):.9f}, {np.sin(a):.9f}, 0., {-np.sin(a):.9f}, {np.cos(a):.9f}, 0." for a in (np.pi / 6, -np.pi / 6)
)


def swept(x: np.ndarray) -> np.ndarray:
    return straight(x) + np.outer(x[:, 0], [0.0, 40.0, 0.0])


def ring(x: np.ndarray) -> np.ndarray:
    r, a = 20.0 + 8.0 * x[:, 1], np.pi * (1 - x[:, 0])
    return np.stack([r * np.cos(a) + 3.0, r * np.sin(a), 10.0 * x[:, 2]], axis=1)


CASES = {
    "30": (straight, f"*ORIENTATION, NAME=OWN\n{Z30}\n"),
    "-30": (straight, f"*ORIENTATION, NAME=OWN\n{Z_30}\n"),
    "swept 30": (swept, f"*ORIENTATION, NAME=OWN\n{Z30}\n"),
    "swept -30": (swept, f"*ORIENTATION, NAME=OWN\n{Z_30}\n"),
    "turned": (straight, "*ORIENTATION, NAME=OWN\n1., 0., 0., 0., 1., 0.\n3, 30.\n"),
    "turned twice": (straight, f"*ORIENTATION, NAME=OWN\n{Z30}\n1, 40.\n"),
    "ring": (ring, "*ORIENTATION, NAME=OWN, SYSTEM=CYLINDRICAL\n3., 0., 0., 3., 0., 1.\n"),
    "by element": (
        straight,
        f"*DISTRIBUTION, NAME=D\n, {Z30}\n"
        + "".join(f"{e}, {Z_30}\n" for e in range(1, 100, 2))
        + "*ORIENTATION, NAME=OWN\nD\n",
    ),
}


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
@pytest.mark.parametrize("case", CASES)
def test_directions_are_those_of_calculix(case: str, tmp_path: Path) -> None:
    shape, cards = CASES[case]
    deck = bricks((30, 8, 2), shape) + cards + ENDING
    np.testing.assert_allclose(frequencies(deck, 4, tmp_path), by_calculix(deck, 4, tmp_path), rtol=5e-3)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_an_anisotropic_material_is_that_of_calculix(tmp_path: Path) -> None:
    head, _, tail = ENDING.partition("*ELASTIC")
    deck = bricks((30, 8, 2), straight) + CASES["30"][1] + head + TENSOR + tail[tail.index("*DENSITY") :]
    np.testing.assert_allclose(frequencies(deck, 4, tmp_path), by_calculix(deck, 4, tmp_path), rtol=5e-3)


def test_a_turned_deck_is_the_same_structure(tmp_path: Path) -> None:
    """Body and orientation turned together change nothing; the orientation alone does."""
    deck = bricks((4, 1, 1), straight) + "{}" + ENDING
    path = frequencies(deck.format("*ORIENTATION, NAME=OWN\n1., 0., 0., 0., 1., 0.\n"), 3, tmp_path)
    other = frequencies(deck.format(CASES["30"][1]), 3, tmp_path)
    a = np.pi / 6
    R = np.array([[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]])
    shifted = bricks((4, 1, 1), lambda x: straight(x) @ R) + CASES["30"][1] + ENDING
    np.testing.assert_allclose(frequencies(shifted, 3, tmp_path), path, rtol=1e-6)
    assert abs(other[0] / path[0] - 1) > 0.05


def test_a_cylinder_has_radial_tangential_and_axial_directions() -> None:
    system = System.of_points("cylindrical", (1, 0, 0), (1, 0, 2), (2, 0, 0))
    at = system.places(np.array([[2.0, 90.0, 5.0]]))
    np.testing.assert_allclose(at, [[1, 2, 5]], atol=1e-12)
    np.testing.assert_allclose(system.at(at)[0], [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(axis_rotation(2, 90.0), [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-12)
