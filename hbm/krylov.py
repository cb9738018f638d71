"""GMRES for Newton directions: short, matrix-free, deterministic."""

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
) -> tuple[np.ndarray, int, float]:
    """Solve A x = b by flexible GMRES without restart, orthogonalised twice.

    product : A times a vector (n,)
    precondition : an approximate inverse of A, applied from the right; it may be an iteration of its own
    Returns x, products spent, relative residual reached: infinite where a product is no number
    Source  Saad 1993, doi 10.1137/0914028"""
    beta = float(np.linalg.norm(b))
    if beta == 0.0:
        return np.zeros_like(b), 0, 0.0
    size = min(max_products, len(b))
    v = np.empty((min(size, FIRST_ROOM) + 1, len(b)))
    v[0] = b / beta
    cs, sn, rhs = np.zeros(size), np.zeros(size), np.zeros(size + 1)
    rhs[0] = beta
    k = 0
    columns: list[np.ndarray] = []  # of the Hessenberg matrix, turned
    directions: list[np.ndarray] = []
    for k in range(1, size + 1):
        directions.append(v[k - 1] if precondition is None else precondition(v[k - 1]))
        if k == len(v):
            v = np.concatenate([v, np.empty((min(k, size + 1 - k), len(b)))])
        columns.append(np.empty(k))
        radius, norm = _next(product(directions[-1]), v, columns[-1], cs, sn, rhs)
        if not np.isfinite(norm):  # a product beyond all numbers, as single precision has them
            return np.zeros_like(b), k, np.inf
        if radius == 0.0:
            k -= 1
            break
        if abs(rhs[k]) <= tolerance * beta or norm <= 1e-14 * radius:
            break
    if k == 0:
        return np.zeros_like(b), 1, 1.0
    y = rhs[:k].copy()
    for i in range(k - 1, -1, -1):
        y[i] /= columns[i][i]
        y[:i] -= y[i] * columns[i][:i]
    return y @ np.array(directions[:k]), k, abs(rhs[k]) / beta


@numba.njit(cache=True)
def _next(w, v, column, cs, sn, rhs):
    """Vector k of the space, v[k], from the product w of the one before, orthogonalised twice.

    Fills the column (k,) of the Hessenberg matrix, turned upper triangular, and turns the right-hand side with it
    Returns its diagonal, and the size of w outside of the space"""
    k = len(column)
    column[:] = np.dot(v[:k], w)
    w = w - np.dot(column, v[:k])
    correction = np.dot(v[:k], w)
    w -= np.dot(correction, v[:k])
    column += correction
    norm = np.sqrt(np.dot(w, w))
    if norm > 0.0:
        v[k] = w / norm
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
    return radius, norm
