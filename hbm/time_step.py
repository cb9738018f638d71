"""One period of time steps: generalised alpha in modal coordinates, the contact solved implicitly in every step.

With M = I and K = diag(lam) the step from t_n to t_n+1 is a0 -> a1,

    (1 - am) a1 + am a0 + C v* + lam eta* + U^T f* = F*,    y* = (1 - af) y1 + af y0,
    eta1 = eta0 + h v0 + h^2 ((1/2 - beta) a0 + beta a1),   v1 = v0 + h ((1 - gamma) a0 + gamma a1).

All that is linear is done once; what is left is x1 = x_free - A f(x1) at the contacts, with a constant compliance A.
Newton on it keeps P = (I + A df/dx)^-1: a pair that changes between stick, slip and separation is a low-rank update.
Source  Chung and Hulbert 1993 (generalised alpha); the condensation to the contact is ours
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numba
import numpy as np

MAX_ITERATIONS = 60
TOLERANCE = 1e-12  # of the contact residual, relative to the largest contact displacement
LAZY = 0.05  # relative change of df/dx of a pair below which the first iterations keep the old one
LAZY_ITERATIONS = 8

_VECTOR, _MATRIX = numba.float64[::1], numba.float64[:, ::1]
_LAW = numba.int64(_VECTOR, _VECTOR, _VECTOR, _VECTOR, _MATRIX, _MATRIX, _MATRIX, _MATRIX)


@cache
def pointer(step: Callable) -> Callable:
    """The kernel of a law as a function pointer: one compiled `march`, cached on disk, serves every law."""
    return numba.cfunc(_LAW)(step.py_func) if hasattr(step, "py_func") else step


@numba.njit(cache=True)
def free_acceleration(scheme, lam, damping, inverse, diagonal, eta, v, a, pull, load):
    """S^-1 (F* - what the known state contributes): the end-of-step acceleration without contact force at t_n+1."""
    h, am, af, beta, gamma = scheme
    v_known = v + ((1.0 - af) * h * (1.0 - gamma)) * a
    eta_known = eta + (1.0 - af) * h * (v + (h * (0.5 - beta)) * a)
    r = load - am * a - lam * eta_known - af * pull
    if diagonal:
        return inverse[0] * (r - damping[0] * v_known)
    return np.dot(inverse, r - np.dot(damping, v_known))


@numba.njit(cache=True)
def refactor(A, J):
    """(I + A J)^-1 for the block diagonal J (n_pair, c, c)."""
    n_pair, c, _ = J.shape
    full = np.eye(n_pair * c)
    for i in range(n_pair):
        o = i * c
        full[:, o : o + c] += np.dot(np.ascontiguousarray(A[:, o : o + c]), np.ascontiguousarray(J[i]))
    return np.ascontiguousarray(np.linalg.inv(full))


@numba.njit(cache=True)
def follow_slopes(A, P, J, J_new, threshold):
    """Bring P and J up to the new slopes of every pair that changed by more than the threshold; returns P."""
    n_pair, c, _ = J.shape
    changed = np.zeros(n_pair, np.bool_)
    for i in range(n_pair):
        top = max(np.abs(J[i]).max(), np.abs(J_new[i]).max())
        changed[i] = np.abs(J_new[i] - J[i]).max() > threshold * top
    if np.sum(changed) * c > 8 and np.sum(changed) > n_pair // 3:
        J[:] = J_new
        return refactor(A, J)
    for i in range(n_pair):
        if not changed[i]:
            continue
        o = i * c
        D = J_new[i] - J[i]
        V = np.dot(P, np.dot(np.ascontiguousarray(A[:, o : o + c]), D))
        small = np.eye(c) + V[o : o + c]
        P -= np.dot(V, np.linalg.solve(small, np.ascontiguousarray(P[o : o + c])))  # Woodbury
        J[i] = J_new[i]
    return P


@numba.njit(cache=True)
def evaluate(step, x, s, p, f, J, Fs, Sx, Ss):
    """The law at x for every pair, from memory s, which moves on; returns status bits (n_pair,)."""
    n_pair = x.shape[0]
    bits = np.zeros(n_pair, np.int64)
    J[:] = 0.0
    Fs[:] = 0.0
    Sx[:] = 0.0
    Ss[:] = 0.0
    for i in range(n_pair):
        bits[i] = step(x[i], s[i], p[i], f[i], J[i], Fs[i], Sx[i], Ss[i])
    return bits


@numba.njit(cache=True)
def solve_contact(step, p, A, P, J, x_free, x, s, scale, f, J_new, Fs, Sx, Ss):
    """Newton on x + A f(x) = x_free from the guess x, which is overwritten, as are f and the slopes.

    Returns the memory after the step, the status bits, iterations (negative: failed), scale and P
    """
    for it in range(MAX_ITERATIONS):
        s_new = s.copy()
        bits = evaluate(step, x, s_new, p, f, J_new, Fs, Sx, Ss)
        r = x.ravel() - x_free + np.dot(A, f.ravel())
        scale = max(scale, np.abs(x).max())
        if np.abs(r).max() <= TOLERANCE * scale:
            return s_new, bits, it + 1, scale, P
        P = follow_slopes(A, P, J, J_new, LAZY if it < LAZY_ITERATIONS else 0.0)
        length = 1.0 if it < MAX_ITERATIONS // 2 else 0.5
        x -= length * np.dot(P, r).reshape(x.shape)
    return s_new, bits, -MAX_ITERATIONS, scale, P


@numba.njit(cache=True)
def march(
    step,
    p,
    scheme,
    lam,
    damping,
    inverse,
    diagonal,
    U,
    O,
    A,
    load,
    base,
    eta,
    v,
    a,
    x,
    f,
    s,
    P,
    J,
    xs,
    fs,
    ys,
    bits,
    slopes,
):
    """March one period; the state (eta, v, a, x, f, s) moves on in place, the records are filled.

    load : (n_step, n) weighted modal load F* of each step; base : (n_step, n_pair, c) motion of body 2 at its end
    xs, fs : (n_step, n_pair, c), ys : (n_step, n_output) records at the ends of the steps; bits : (n_pair,) status
    slopes : derivatives (df/dx, df/ds, ds/dx, ds/ds) of each step, or of length 0 where they are not wanted
    Returns the step that failed or -1, the largest |v|, the contact iterations spent, and P
    """
    h, _, af, beta, gamma = scheme
    n_pair, c = x.shape
    n_state = s.shape[1]
    f_new, J_new = np.empty_like(f), np.empty_like(J)
    Fs, Sx = np.empty((n_pair, c, n_state)), np.empty((n_pair, n_state, c))
    Ss = np.empty((n_pair, n_state, n_state))
    pull = np.dot(U.T, f.ravel())
    bits[:] = 0
    scale, speed, spent = np.abs(x).max(), 0.0, 0
    for j in range(load.shape[0]):
        b = free_acceleration(scheme, lam, damping, inverse, diagonal, eta, v, a, pull, load[j])
        eta_free = eta + h * v + h * h * ((0.5 - beta) * a + beta * b)
        x_free = np.dot(U, eta_free) - base[j].ravel()
        on_line = f.copy()  # first guess: every pair stays on the line it is on
        for i in range(n_pair):
            on_line[i] -= np.dot(J[i], x[i])
        x_new = np.dot(P, x_free - np.dot(A, on_line.ravel())).reshape(n_pair, c)
        s_new, now, iterations, scale, P = solve_contact(
            step, p, A, P, J, x_free, x_new, s, scale, f_new, J_new, Fs, Sx, Ss
        )
        spent += abs(iterations)
        if iterations < 0:
            return j, speed, spent, P
        x[:], f[:], s[:] = x_new, f_new, s_new
        pull = np.dot(U.T, f.ravel())
        a_new = b - (1.0 - af) * (inverse[0] * pull if diagonal else np.dot(inverse, pull))
        eta += h * v + h * h * ((0.5 - beta) * a + beta * a_new)
        v += h * ((1.0 - gamma) * a + gamma * a_new)
        a[:] = a_new
        speed = max(speed, np.sqrt(np.sum(v * v)))
        xs[j], fs[j], ys[j] = x, f, np.dot(O, eta)
        bits |= now
        if slopes[0].shape[0] > 0:
            slopes[0][j], slopes[1][j], slopes[2][j], slopes[3][j] = J_new, Fs, Sx, Ss
    return -1, speed, spent, P


@numba.njit(cache=True)
def memory_after(step, xs, p, memory):
    """Memory (n_pair, n_state) after two rounds of a periodic displacement xs (n_step, n_pair, c)."""
    n_step, n_pair, c = xs.shape
    s = memory.copy()
    n_state = s.shape[1]
    f, J = np.zeros((n_pair, c)), np.zeros((n_pair, c, c))
    Fs, Sx = np.zeros((n_pair, c, n_state)), np.zeros((n_pair, n_state, c))
    Ss = np.zeros((n_pair, n_state, n_state))
    for _ in range(2):
        for j in range(n_step):
            evaluate(step, xs[j], s, p, f, J, Fs, Sx, Ss)
    return s, f
