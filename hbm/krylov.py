"""GMRES for Newton directions: short, matrix-free, deterministic."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np

FIRST_ROOM = 16  # products for which memory is taken at first; most directions need fewer


def gmres(
    product: Callable[[np.ndarray], np.ndarray],
    b: np.ndarray,
    tolerance: float,
    max_products: int,
    precondition: Callable[[np.ndarray], np.ndarray] | None = None,
    flexible: bool = False,
) -> tuple[np.ndarray, int, float]:
    """Solve A x = b by GMRES without restart, orthogonalised twice.

    product : A times a vector (n,); precondition : an approximate inverse of A, applied from the right
    flexible : the preconditioner is no linear map, such as an iteration of its own
    Returns x, products spent, relative residual reached: infinite where a product is no number
    Source  Saad and Schultz 1986; flexible: Saad 1993, doi 10.1137/0914028
    """
    beta = float(np.linalg.norm(b))
    if beta == 0.0:
        return np.zeros_like(b), 0, 0.0
    size = min(max_products, len(b))
    v = np.empty((min(size, FIRST_ROOM) + 1, len(b)))
    h = np.zeros((size, size))
    v[0] = b / beta
    cs, sn = np.zeros(size), np.zeros(size)
    rhs = np.zeros(size + 1)
    rhs[0] = beta
    k = 0
    directions: list[np.ndarray] = []
    for k in range(1, size + 1):
        z = v[k - 1] if precondition is None else precondition(v[k - 1])
        if flexible:
            directions.append(z)
        w = product(z)
        span = v[:k]
        coefficients = span @ w
        w = w - coefficients @ span
        again = span @ w
        w -= again @ span
        column = h[:, k - 1]
        column[:k] = coefficients + again
        norm = float(np.sqrt(w @ w))
        if not np.isfinite(norm):  # a product beyond all numbers, as single precision has them
            return np.zeros_like(b), k, np.inf
        radius = _rotate(column, cs, sn, rhs, k, norm)
        if radius == 0.0:
            k -= 1
            break
        if abs(rhs[k]) <= tolerance * beta or norm <= 1e-14 * radius:
            break
        if k == len(v):
            v = np.concatenate([v, np.empty((min(k, size + 1 - k), len(b)))])
        v[k] = w / norm
    if k == 0:
        return np.zeros_like(b), 1, 1.0
    y = np.zeros(k)
    for i in range(k - 1, -1, -1):
        y[i] = (rhs[i] - h[i, i + 1 : k] @ y[i + 1 :]) / h[i, i]
    if flexible:
        return y @ np.array(directions[:k]), k, abs(rhs[k]) / beta
    x = y @ v[:k]
    return x if precondition is None else precondition(x), k, abs(rhs[k]) / beta


@numba.njit(cache=True)
def _rotate(column, cs, sn, rhs, k, norm):
    """Turn column k of the Hessenberg matrix upper triangular and the right-hand side with it; returns the diagonal."""
    for i in range(k - 1):
        a, b = column[i], column[i + 1]
        column[i] = cs[i] * a + sn[i] * b
        column[i + 1] = cs[i] * b - sn[i] * a
    radius = np.hypot(column[k - 1], norm)
    if radius > 0.0:
        cs[k - 1], sn[k - 1] = column[k - 1] / radius, norm / radius
        column[k - 1] = radius
        rhs[k] = -sn[k - 1] * rhs[k - 1]
        rhs[k - 1] *= cs[k - 1]
    return radius
