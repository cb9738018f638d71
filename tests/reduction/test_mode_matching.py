"""Modes matched by shape and by kind of motion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh

from proof.mode_matching import mac, match_kinds, match_modes


def chain(n: int, heavy: int | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies, shapes and mass matrix of a chain of masses, one of them heavier."""
    stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    mass = np.eye(n)
    if heavy is not None:
        mass[heavy, heavy] = 1.3
    squares, shapes = eigh(stiffness, mass)
    return np.sqrt(squares), shapes, mass


def test_mac_of_a_set_of_modes_with_itself_is_one_on_the_diagonal_and_by_the_mass_zero_beside_it() -> None:
    _, shapes, mass = chain(7, heavy=2)
    np.testing.assert_allclose(mac(shapes, shapes, mass), np.eye(7), atol=1e-12)
    plain = mac(shapes, 3.0 * shapes * np.exp(0.3j))  # neither size nor phase counts
    np.testing.assert_allclose(np.diag(plain), 1.0)
    a, b = shapes[:, 0], shapes[:, 3]
    assert plain[0, 3] == pytest.approx((a @ b) ** 2 / ((a @ a) * (b @ b)))


def test_modes_that_have_changed_places_are_found() -> None:
    _, first, _ = chain(8)
    _, second, _ = chain(8, heavy=4)
    order = np.array([3, 0, 7, 1, 5, 2, 6, 4])
    np.testing.assert_array_equal(order[match_modes(first, second[:, order])], np.arange(8))
    np.testing.assert_array_equal(match_modes(first[:, 2:4], second), [2, 3])


def test_kinds_keep_modes_apart_that_their_frequencies_would_mix() -> None:
    frequency = np.array([90.0, 300.0, 310.0, 900.0])
    share = np.array([[0.9, 0.1, 0.0], [0.0, 1.0, 0.0], [0.8, 0.2, 0.0], [0.1, 0.0, 0.9]])
    np.testing.assert_array_equal(match_kinds(frequency, share, [(0, 91.0), (0, 300.0), (1, 305.0)]), [0, 2, 1])


def test_what_cannot_be_matched_is_refused() -> None:
    with pytest.raises(ValueError, match="take common points"):
        mac(np.eye(3), np.eye(4))
    with pytest.raises(ValueError, match="shape without motion"):
        mac(np.zeros((3, 1)), np.eye(3))
    with pytest.raises(ValueError, match="compute more of the second"):
        match_modes(np.eye(3), np.eye(3)[:, :2])
    with pytest.raises(ValueError, match="compute more modes"):
        match_kinds(np.ones(1), np.ones((1, 1)), [(0, 1.0), (0, 2.0)])
