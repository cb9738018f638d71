"""Products of few rows with a matrix in pieces are the product itself."""

import numpy as np
import pytest

from tribodyn.hbm.linear import all_harmonics
from tribodyn.hbm.linear.all_harmonics import few_rows


@pytest.mark.parametrize("kind", [np.float64, np.float32])
@pytest.mark.parametrize(
    "shape", [(1, 30, 40), (2, 507, 1020), (3, 507, 701), (7, 507, 702), (11, 300, 513), (63, 800, 90)]
)
def test_pieces_are_the_product(kind: type, shape: tuple[int, int, int]) -> None:
    rng = np.random.default_rng(0)
    k, n, m = shape
    rows, matrix = rng.normal(size=(k, n)).astype(kind), rng.normal(size=(n, m)).astype(kind)
    assert np.allclose(few_rows(rows, matrix), rows @ matrix, rtol=0, atol=100 * n**0.5 * np.finfo(kind).eps)
    assert few_rows(rows, matrix).dtype == kind


@pytest.mark.parametrize(("n", "n_coeff"), [(40, 7), (507, 7), (507, 3), (600, 11), (1100, 61)])
def test_a_direction_in_pieces_is_the_product(n: int, n_coeff: int) -> None:
    """At rest, where the core is a diagonal, so that the whole is two plain products."""
    rng = np.random.default_rng(1)
    force, w0, b = (rng.normal(size=(n, k)) for k in (n_coeff, n, 9))
    w0, b, static = w0.astype(np.float32), b.astype(np.float32), np.linspace(1.0, 2.0, 9)
    none = np.zeros((0, 9, 9))
    core = np.zeros(n_coeff // 2), True, none, none, np.zeros((0, 9), np.int32), static
    displaced = all_harmonics.nearly_displaced(force, w0, b, np.ascontiguousarray(b.T), *core)
    expected = w0.T @ force + b @ ((b.T @ force) / static[:, None])
    assert np.abs(displaced - expected).max() < 1e-4 * np.abs(expected).max()
