"""The slope of the contact forces, one block for each pair, in one pass: at many harmonics nothing is larger.

D is block diagonal, with `slopes` (n_active, m, m) for its blocks, m = n_component * n_coeff, coefficients innermost.
U (n_active * n_component, r) and A (r * n_coeff, same) are the coarse part of the compliance, G ~ U A U^T."""

import numba
import numpy as np

NOTHING = 1e-14  # slope over the stiffness of a pair from which on it counts


@numba.njit(cache=True)
def departures(jacobian, stiffness):
    """Pairs whose force departs from the stuck one, and the slope of the departure, k - d f / d x.

    jacobian : (n_pair, m, m) with coefficients innermost [N/m]; stiffness : (n_pair, n_component) [N/m]
    Returns (n_active,) pairs and (n_active, m, m) slopes"""
    n_pair, m, _ = jacobian.shape
    n_coeff = m // stiffness.shape[1]
    active, slopes, n = np.empty(n_pair, np.int64), np.empty(jacobian.shape), 0
    for i in range(n_pair):
        out, largest = slopes[n], 0.0
        for a in range(m):
            for b in range(m):
                out[a, b] = -jacobian[i, a, b]
            out[a, a] += stiffness[i, a // n_coeff]
            for value in out[a]:
                largest = max(largest, abs(value))
        if largest > NOTHING * stiffness[i].max():
            active[n] = i
            n += 1
    return active[:n].copy(), slopes[:n]


@numba.njit(cache=True)
def projected(slopes, u, n_coeff):
    """(r n_coeff, r n_coeff) U^T D U, in the single precision of u."""
    n, m, _ = slopes.shape
    r, n_comp = u.shape[1], m // n_coeff
    through = np.zeros((n * n_comp, n_coeff * n_coeff * r), u.dtype)
    for i in range(n):
        for c in range(n_comp):
            row = through[i * n_comp + c]
            for a in range(n_coeff):
                for d in range(n_comp):
                    shape = u[i * n_comp + d]
                    for b in range(n_coeff):
                        slope = slopes[i, c * n_coeff + a, d * n_coeff + b]
                        if slope != 0.0:
                            first = (a * n_coeff + b) * r
                            value = u.dtype.type(slope)
                            for q in range(r):
                                row[first + q] += value * shape[q]
    inside = np.dot(u.T, through)
    products = np.ascontiguousarray(inside.reshape(r, n_coeff, n_coeff, r).transpose(0, 1, 3, 2))
    return products.reshape(r * n_coeff, r * n_coeff)


@numba.njit(cache=True)
def times(slopes, d):
    """D d for d (n_active * n_component, n_coeff), of its shape."""
    n, m, _ = slopes.shape
    products, out = d.ravel(), np.zeros(n * m)
    for i in range(n):
        for a in range(m):
            for b in range(m):
                out[i * m + a] += slopes[i, a, b] * products[i * m + b]
    return out.reshape(d.shape)


@numba.njit(cache=True)
def preconditioned(d, slopes, u, a, lower_upper, pivots):
    """d + U (I - A U^T D U)^-1 A U^T D d for d (n_active * n_component, n_coeff).

    lower_upper, pivots : factors of the matrix in brackets; row j of the first holds column j of L and U"""
    x = np.dot(a, np.dot(u.T, times(slopes, d)).ravel())
    for j in range(len(x)):
        x[j], x[pivots[j]] = x[pivots[j]], x[j]
    for j in range(len(x)):
        column, value = lower_upper[j], x[j]
        for i in range(j + 1, len(x)):
            x[i] -= column[i] * value
    for j in range(len(x) - 1, -1, -1):
        column = lower_upper[j]
        x[j] /= column[j]
        value = x[j]
        for i in range(j):
            x[i] -= column[i] * value
    return d + np.dot(u, x.reshape(u.shape[1], d.shape[1]))
