"""The contact of one time step: all pairs, coupled by the compliance of the step.

Solved is x + A f(x) = x_free: pair after pair (block Gauss-Seidel), and by Newton's method for all of them where the
pairs are too stiffly coupled for that.
Source  pair by pair: Jean and Moreau 1999 (non-smooth contact dynamics)"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from tribodyn.hbm.contact.compiled_law import stamp_with
from tribodyn.hbm.contact.contact_law import SEPARATES
from tribodyn.hbm.time import pair_step
from tribodyn.hbm.time.pair_step import MOST, PLAIN, add, advance, put, room, solve_pair

SWEEPS, SLOW = 60, 0.5  # at most of Gauss-Seidel; factor per sweep from which on it is slow
NEWTON = 60
SHORTEST = 0.1  # share of a Newton step that is tried before a worse point is taken all the same


class Contact(NamedTuple):
    """The contact that a step meets.

    p : (n_pair, ...) packed parameters; gap : (n_pair,) [m]; normal : position of the component n, -1 without one
    A : (n_pair * c, n_pair * c) compliance of a step, row i the displacement of all under a unit force i; symmetric
        but for Coriolis forces
    forgets : whether a pair that touches has forgotten its memory, see `forgets`
    accuracy : of the contact's equations, relative to the largest contact displacement"""

    p: np.ndarray
    gap: np.ndarray
    normal: int
    A: np.ndarray
    forgets: bool = False
    accuracy: float = 1e-12


class Space(NamedTuple):
    """Work space of a step: `room` of one pair, two for its equations, y = A f, then of all pairs status bits, slopes
    J = df/dx with the inverse M of 1 + A J of each pair, and memory. All steps with one A share it.

    inverse : (n_contact, n_contact) of the derivative in the last step that needed Newton's method, its first entry
        zero before that; such steps come in a row, and one inverse serves many of them"""

    work: tuple[np.ndarray, ...]
    r: np.ndarray
    b: np.ndarray
    y: np.ndarray
    bits: np.ndarray
    J: np.ndarray
    M: np.ndarray
    memory: np.ndarray
    inverse: np.ndarray

    @classmethod
    def of(cls, n_pair: int, c: int, n_state: int) -> Space:
        """For so many pairs, components and states of the memory."""
        small = np.zeros(c), np.zeros(c), np.zeros(n_pair * c)
        J, M = np.full((2, n_pair, c, c), np.nan)
        memory, inverse = np.zeros((n_pair, n_state)), np.zeros((n_pair * c, n_pair * c))
        return cls(room(c, n_state), *small, np.zeros(n_pair, np.int64), J, M, memory, inverse)


@numba.njit(cache=True)
def solve_contact(step, contact, x_free, x0, was_open, s, x, f, scale, space):
    """Solve x + A f(x) = x_free for all pairs from the guesses x, f, which are overwritten; s is the memory before.

    space : with y = A f of the guess; the memory at x is left there, but of open pairs
    Returns rounds spent (negative: failed) and the scale of x"""
    if space.inverse[0, 0] == 0.0:
        rounds, scale = sweeps(step, contact, x_free, x0, was_open, s, x, f, scale, space)
    else:
        rounds, scale = chord(step, contact, x_free, x0, was_open, s, x, f, scale, space)
    if rounds > 0:
        return rounds, scale
    return newton(step, contact, x_free, x0, was_open, s, x, f, scale, space)


@numba.njit(**PLAIN)
def sweeps(step, contact, x_free, x0, was_open, s, x, f, scale, space):
    """As `solve_contact`, pair after pair."""
    n_pair, c = x.shape
    work, r, b, y, bits, J, M, memory, _ = space
    for i in range(n_pair):
        bits[i] = SEPARATES if contact.normal >= 0 and was_open[i] and f[i, contact.normal] == 0.0 else 0
    before = np.inf
    slow = 0
    for it in range(SWEEPS):
        tolerance = contact.accuracy * scale
        largest_move = sweep(
            step, contact, x_free, x0, was_open, s, x, f, y, bits, J, M, memory, tolerance, it % 2 == 1, work, r, b
        )
        if it == 0:
            scale = max(scale, largest(x))
        if 0.0 <= largest_move <= contact.accuracy * scale:
            for i in range(n_pair):
                if bits[i] == SEPARATES:
                    for a in range(c):
                        x[i, a] = x_free[i * c + a] - y[i * c + a]
            return it + 1, scale
        slow += largest_move > SLOW * before
        if largest_move < 0.0 or slow > 5:
            break
        before = largest_move
    return -1, scale


@numba.njit(**PLAIN)
def sweep(step, contact, x_free, x0, was_open, s, x, f, y, bits, J, M, memory, tolerance, backward, work, r, b):
    """One round of Gauss-Seidel over all pairs; y = A f and all else moves on in place but x and memory of open pairs.

    Returns the largest displacement of a pair, negative where one failed"""
    n_pair, c = x.shape[0], min(x.shape[1], MOST)
    normal, A, gap = contact.normal, contact.A, contact.gap
    largest_move, onward, i = (0.0, -1, n_pair) if backward else (0.0, 1, -1)
    while True:
        i += onward
        while 0 <= i < n_pair and bits[i] == SEPARATES and x_free[i * c + normal] - y[i * c + normal] < gap[i]:
            i += onward  # exerts no force
        if not 0 <= i < n_pair:
            return largest_move
        o = i * c
        opened = bits[i] == SEPARATES
        compliance = A[o : o + c, o : o + c].T
        x_i, f_i, free, under = x[i], f[i], x_free[o : o + c], y[o : o + c]
        status = 0 if opened else bits[i]
        off = 0.0
        for a in range(c):
            b[a] = free[a] - under[a]
            off = max(off, abs(b[a] - x_i[a]))
            for q in range(c):
                b[a] += compliance[a, q] * f_i[q]
        if opened:
            put(b, x_i)
        elif off <= 0.1 * tolerance and status != 0:
            continue
        if status != 0:
            put(f_i, work[0])
            put(memory[i], work[1])
        bits[i] = solve_pair(
            step, x0[i], was_open[i], x_i, s[i], contact.p[i], gap[i], normal, compliance, b, 0.1 * tolerance, status,
            work, r, J[i], M[i],
        )  # fmt: skip
        if bits[i] == 0:
            return -1.0
        largest_move = max(largest_move, off)
        for a in range(c):
            b[a] = work[0][a] - f_i[a]
            f_i[a] = work[0][a]
        put(work[1], memory[i])
        add_rows(A, o, b, y)


@numba.njit(**PLAIN)
def add_rows(A, o, f, y):
    """Add f A[o : o + c] to y, in one pass over y where there are three rows."""
    if f.size == 3:
        f0, f1, f2 = f[0], f[1], f[2]
        r0, r1, r2 = A[o], A[o + 1], A[o + 2]
        for q in range(y.size):
            y[q] = y[q] + f0 * r0[q] + f1 * r1[q] + f2 * r2[q]
        return
    for a in range(f.size):
        row = A[o + a]
        for q in range(y.size):
            y[q] += f[a] * row[q]


@numba.njit(**PLAIN)
def largest(x):
    """Largest absolute value of x (n_pair, c)."""
    maximum = 0.0
    for i in range(x.shape[0]):
        for a in range(x.shape[1]):
            maximum = max(maximum, abs(x[i, a]))
    return maximum


@numba.njit(**PLAIN)
def displace(A, f, y):
    """Displacement y (n,) under forces f (n_pair, c), of which many vanish; A as in `Contact`."""
    c = f.shape[1]
    for q in range(y.size):
        y[q] = 0.0
    for i in range(f.shape[0]):
        pushed = False
        for a in range(c):
            pushed |= f[i, a] != 0.0
        if pushed:
            add_rows(A, i * c, f[i], y)


@numba.njit(cache=True)
def residual(step, contact, x_free, x0, was_open, s, x, f, J, space):
    """x + A f(x) - x_free (n_contact,); forces and slopes of all pairs into f and J, status and memory into `space`."""
    work, y = space.work, space.y
    for i in range(x.shape[0]):
        space.bits[i] = abs(
            advance(step, x0[i], was_open[i], x[i], s[i], contact.p[i], contact.gap[i], contact.normal, work, False)
        )
        put(work[0], f[i])
        put(work[2].ravel(), J[i].ravel())
        put(work[1], space.memory[i])
    displace(contact.A, f, y)
    return x.ravel() - x_free + y


@numba.njit(cache=True)
def chord(step, contact, x_free, x0, was_open, s, x, f, scale, space):
    """As `newton` with the inverse of an earlier step; x stays where it was if that does not get there."""
    J, start, inverse = np.empty(space.J.shape), x.copy(), space.inverse
    before, slow = np.inf, 0
    move, r_before = np.zeros(x.size), np.zeros(x.size)
    for it in range(SWEEPS):
        r = residual(step, contact, x_free, x0, was_open, s, x, f, J, space)
        scale = max(scale, np.abs(x).max())
        error = np.abs(r).max()
        if error <= contact.accuracy * scale:
            return it + 1, scale
        slow += error > SLOW * before
        if slow > 2:
            break
        before = error
        if it > 0:  # Broyden's update: the inverse learns what the last step has shown
            u = np.dot(inverse, r - r_before)
            projection = move @ u
            if abs(projection) > SHORTEST**2 * (move @ move):
                row = np.dot(move, inverse)
                for a in range(move.size):
                    share = (move[a] - u[a]) / projection
                    for b in range(move.size):
                        inverse[a, b] += share * row[b]
        move = -np.dot(inverse, r)
        r_before = r
        x += move.reshape(x.shape)
    put(start.ravel(), x.ravel())
    return -1, scale


@numba.njit(cache=True)
def newton(step, contact, x_free, x0, was_open, s, x, f, scale, space):
    """As `solve_contact`, all pairs at once, where they are too stiffly coupled to be solved in turn."""
    n_pair, c = x.shape
    A = contact.A
    J = np.empty((n_pair, c, c))
    full = np.eye(n_pair * c)
    best, length = np.inf, 1.0
    x_best, direction = x.copy(), np.zeros(x.size)
    for it in range(NEWTON):
        r = residual(step, contact, x_free, x0, was_open, s, x, f, J, space)
        scale = max(scale, np.abs(x).max())
        error = np.abs(r).max()
        if error <= contact.accuracy * scale:
            put(np.linalg.inv(full).ravel(), space.inverse.ravel())
            return SWEEPS + it + 1, scale
        if error >= best and length > SHORTEST:  # a kink lies on the way: go less far
            length *= 0.5
        else:
            best, length = error, 1.0
            put(x.ravel(), x_best.ravel())
            full = np.eye(n_pair * c)
            for i in range(n_pair):
                o = i * c
                add(np.dot(np.ascontiguousarray(A[o : o + c].T), np.ascontiguousarray(J[i])), full[0:, o : o + c])
            direction = np.linalg.solve(full, r)
        put(x_best.ravel() - length * direction, x.ravel())
    return -1, scale


stamp_with(globals(), pair_step)
