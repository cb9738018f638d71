"""Kernels for one real system that all harmonics share: coefficients are rows [x_0, a_1, b_1, ...] of real matrices.

A row pair (a_h, b_h) is the amplitude a_h - i b_h; `ratio` is h w over the largest one asked for, of each h >= 1.
"""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def modal_forces(rows, n_e, ratio, has_static):
    """Amplitudes (n_harmonic, m) of L' f from rows (n_coeff, m + n_e m): modes and what damping adds to them."""
    m = rows.shape[1] // (n_e + 1)
    s = 1 if has_static else 0
    z = np.empty((len(ratio) + s, m), np.complex128)
    if has_static:
        for j in range(m):
            z[0, j] = rows[0, j]
    for h in range(len(ratio)):
        a, b = rows[s + 2 * h], rows[s + 2 * h + 1]
        for j in range(m):
            value = complex(a[j], -b[j])
            power = complex(1.0, 0.0)
            for k in range(1, n_e + 1):
                power *= complex(0.0, ratio[h])
                value -= power * complex(a[k * m + j], -b[k * m + j])
            z[s + h, j] = value
    return z


@numba.njit(cache=True)
def modal_rows(y, n_e, ratio, has_static):
    """Rows (n_coeff, m + n_e m) that meet [b, e_0, ...]: modal displacements and their share in what damping adds."""
    m = y.shape[1]
    s = 1 if has_static else 0
    rows = np.zeros((s + 2 * len(ratio), m * (n_e + 1)))
    if has_static:
        for j in range(m):
            rows[0, j] = y[0, j].real
    for h in range(len(ratio)):
        a, b = rows[s + 2 * h], rows[s + 2 * h + 1]
        for j in range(m):
            value = y[s + h, j]
            a[j], b[j] = value.real, -value.imag
            for k in range(1, n_e + 1):
                value *= complex(0.0, ratio[h])
                a[k * m + j], b[k * m + j] = -value.real, value.imag
    return rows


@numba.njit(cache=True)
def gathered(modal, moved, higher, n, n_port, unit, ratio, has_static):
    """Displacement (n, n_coeff): modes, W_0 f and sum_k (i ratio)^k unit W_k f, rows of `moved` and `higher`.

    The rows of `higher` are those of the harmonics >= 1.
    """
    n_coeff = len(modal)
    s = 1 if has_static else 0
    n_power = higher.shape[1] // n_port
    out = np.empty((n, n_coeff))
    for c in range(n_coeff):
        for i in range(n):
            out[i, c] = modal[c, i] + moved[c, i]
    for h in range(len(ratio)):
        a, b, p, q = s + 2 * h, s + 2 * h + 1, 2 * h, 2 * h + 1
        size, odd_sign, even_sign = unit, 1.0, 1.0
        for k in range(n_power):
            size *= ratio[h]
            first = k * n_port
            if k % 2 == 0:
                for i in range(n):
                    out[i, a] += odd_sign * size * higher[q, first + i]
                    out[i, b] -= odd_sign * size * higher[p, first + i]
                odd_sign = -odd_sign
            else:
                even_sign = -even_sign
                for i in range(n):
                    out[i, a] += even_sign * size * higher[p, first + i]
                    out[i, b] += even_sign * size * higher[q, first + i]
    return out
