"""Kernels for one real system that all harmonics share: coefficients are rows [x_0, a_1, b_1, ...] of real matrices.

A row pair (a_h, b_h) is the amplitude a_h - i b_h; `ratio` is h w over the largest one asked for, of each h >= 1.
The core S(i h w) of harmonic h >= 1 (see `expansion`) comes as its factors: `real` and `imag` (n, m, m), of which row j
holds column j of L and U, and `pivots` (n, m). At rest the core is the diagonal `static` (m,): at h = 0, or everywhere
where n = 0."""

import numba
import numpy as np

# Multiplications up to which OpenBLAS takes the operands as they lie. Beyond, it copies the matrix first, which takes
# as long again where few rows meet it, and 4 or 8 of them take less than 3 or 7. Measured: 172 us for 7 rows times
# 507 x 702, 117 us for 8 in pieces. Pieces narrower than the second number are slower again
AS_IT_LIES, NARROW = 1_000_000, 64


def few_rows(rows: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """rows (k, n) @ matrix (n, m) for few rows, in pieces of columns."""
    count, (n, m) = len(rows), matrix.shape
    if rows.size * m <= AS_IT_LIES:
        return rows @ matrix
    size = -(-count // 4) * 4
    width = AS_IT_LIES // (size * n) // 16 * 16
    if width < NARROW:
        return rows @ matrix
    padded, out = np.zeros((size, n), matrix.dtype), np.empty((size, m), matrix.dtype)
    padded[:count] = rows
    for start in range(0, m, width):
        np.matmul(padded, matrix[:, start : start + width], out=out[:, start : start + width])
    return out[:count]


@numba.njit(cache=True)
def modal_forces(rows, n_e, ratio, has_static):
    """Amplitudes (n_harmonic, m) of L' f from rows (n_coeff, m + n_e m): modes and what damping adds to them."""
    m = rows.shape[1] // (n_e + 1)
    s = 1 if has_static else 0
    z = np.empty((len(ratio) + s, m), np.complex128)
    if has_static:
        z[0] = rows[0, :m]
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
def solve_core(z, real, imag, pivots, static, has_static):
    """S^-1 z in place, for z (n_harmonic, m)."""
    s, m = 1 if has_static else 0, z.shape[1]
    for h in range(len(z) if len(real) == 0 else s):
        z[h] /= static
    x, y = np.empty(m), np.empty(m)  # real and imaginary part: loops over both are vectorised
    for h in range(len(real)):
        for j in range(m):
            x[j], y[j] = z[s + h, j].real, z[s + h, j].imag
        for j in range(m):
            other = pivots[h, j]
            x[j], x[other] = x[other], x[j]
            y[j], y[other] = y[other], y[j]
        for j in range(m):
            a, b, p, q = real[h, j], imag[h, j], x[j], y[j]
            for i in range(j + 1, m):
                x[i] -= a[i] * p - b[i] * q
                y[i] -= a[i] * q + b[i] * p
        for j in range(m - 1, -1, -1):
            a, b = real[h, j], imag[h, j]
            value = complex(x[j], y[j]) / complex(a[j], b[j])
            p, q = value.real, value.imag
            z[s + h, j] = value
            for i in range(j):
                x[i] -= a[i] * p - b[i] * q
                y[i] -= a[i] * q + b[i] * p


@numba.njit(cache=True)
def modal(forces, n_e, ratio, has_static, real, imag, pivots, static):
    """Modal displacements (n_coeff, m + n_e m) from modal forces (n_coeff, m + n_e m)."""
    z = modal_forces(forces, n_e, ratio, has_static)
    solve_core(z, real, imag, pivots, static, has_static)
    return modal_rows(z, n_e, ratio, has_static)


@numba.njit(cache=True)
def displaced(products, higher, to_ports, n, n_e, unit, ratio, has_static, real, imag, pivots, static):
    """Displacement (n, n_coeff) from forces times [W_0, modes] and the W_k, as rows; to_ports : (m + n_e m, n_port)."""
    n_port = to_ports.shape[1]  # this copy and the typed 0 below make one kernel of `modal` serve both: a second each
    y = modal(products[:, n_port:].copy(), n_e, ratio, has_static, real, imag, pivots, static)
    return gathered(np.dot(y, to_ports), products, higher, n, n_port, unit, ratio, has_static)


@numba.njit(cache=True)
def displaced_slope(forces, higher, to_ports, unit, omega, s_unit, c, t, ratio, has_static, real, imag, pivots, static):
    """d / d omega of `displaced`: of (i ratio)^k it is k / omega times that, of the core d S / d s times i h.

    forces, higher : times modes and e (n_coeff, m + n_e m), times the W_k; c (m, m), t (n_e, m, m) : of the core"""
    m, n_port, s = len(c), to_ports.shape[1], 1 if has_static else 0
    n_e = len(to_ports) // m - 1
    of_powers = np.repeat(np.arange(n_e + 1) / omega, m)
    y = modal_forces(forces, n_e, ratio, has_static)
    dy = modal_forces(forces * of_powers, n_e, ratio, has_static)
    solve_core(y, real, imag, pivots, static, has_static)
    for h in range(len(ratio)):
        at = complex(0.0, ratio[h] * s_unit)
        for i in range(m):
            pushed = 2.0 * at * y[s + h, i]
            for j in range(m):
                by, power = complex(c[i, j], 0.0), at
                for k in range(n_e):
                    by -= (k + 2) * power * t[k, i, j]
                    power *= at
                pushed += by * y[s + h, j]
            dy[s + h, i] -= at / omega * pushed
    solve_core(dy, real, imag, pivots, static, has_static)
    rows = modal_rows(dy, n_e, ratio, has_static) + modal_rows(y, n_e, ratio, has_static) * of_powers
    by_powers = higher * np.repeat(np.arange(1, higher.shape[1] // n_port + 1) / omega, n_port)
    displacement = np.dot(rows, to_ports)
    return gathered(displacement, np.zeros(displacement.shape), by_powers, n_port, n_port, unit, ratio, has_static)


@numba.njit(cache=True)
def nearly_displaced(force, w0, b, b_turned, ratio, has_static, real, imag, pivots, static):
    """Displacement (n, n_coeff) by W_0, which may be empty, and modes alone, in the single precision of these.

    b : (n, m); b_turned : (m, n) the same transposed"""
    n, n_coeff = force.shape
    size = n_coeff if n_coeff < 4 else (n_coeff + 3) // 4 * 4
    pieces = 1 + size * n * n // AS_IT_LIES
    step = (n + pieces - 1) // pieces
    if step < NARROW:
        step = n
    pushed, still = np.zeros((size, b.shape[1]), b.dtype), np.zeros((size, len(w0)), b.dtype)
    for start in range(0, n, step):
        stop = min(start + step, n)
        rows = np.zeros((size, stop - start), b.dtype)
        rows[:n_coeff] = force[start:stop].T
        pushed += np.dot(rows, b[start:stop])
        if len(w0):
            still += np.dot(rows, w0[start:stop])
    y = modal(pushed[:n_coeff].astype(np.float64), np.int64(0), ratio, has_static, real, imag, pivots, static)
    displacement = np.dot(y.astype(b.dtype), b_turned)
    if len(w0):
        displacement += still[:n_coeff]
    return np.ascontiguousarray(displacement[:n_coeff].T).astype(np.float64)


@numba.njit(cache=True)
def modal_rows(y, n_e, ratio, has_static):
    """Rows (n_coeff, m + n_e m) that meet [b, e_0, ...]: modal displacements and their share in what damping adds."""
    m = y.shape[1]
    s = 1 if has_static else 0
    rows = np.zeros((s + 2 * len(ratio), m * (n_e + 1)))
    if has_static:
        rows[0, :m] = y[0].real
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
def gathered(modal, static, higher, n, n_port, unit, ratio, has_static):
    """Displacement (n, n_coeff): modes, W_0 f and sum_k (i ratio)^k unit W_k f, rows of `moved` and `higher`.

    The rows of `higher` are those of the harmonics >= 1."""
    s = 1 if has_static else 0
    n_power = higher.shape[1] // n_port
    out = np.ascontiguousarray((modal[:, :n] + static[:, :n]).T)
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
