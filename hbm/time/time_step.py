"""Time steps of one period: the linear part exact, the contact solved implicitly in every step.

In modal coordinates of the structure, contact open, a step from t_0 to t_1 = t_0 + h with z = (eta, h v) is

    z_1 = E z_0 + impulse - Q (f_0 + f_1) / 2,      x_1 = U eta_1 + rest_1 - W f_1.

E = exp(A h) and the impulse of the loads are exact, whatever h is. The contact force f acts with its mean over the
step, which keeps the second order and the stability of the trapezoidal rule at any contact stiffness and adds no
damping. Modes far above what a step resolves follow without inertia (W, and `rest` under the loads).
What is left of a step is x_1 = x_free - A f(x_1) with one constant compliance A for all steps: pair after pair
(block Gauss-Seidel), and by Newton's method for all of them where the pairs are too stiffly coupled for that.
A pair that closes within the step is first brought to the instant at which it touches, on the straight line between
the ends of the step: friction then begins where the contact does, not at the last step before.
Source  exponential integrators: Hochbruck and Ostermann 2010; trapezoidal rule of the contact: Newmark 1959; pair
by pair: Jean and Moreau 1999 (non-smooth contact dynamics); the condensation to the contact is ours
"""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numba
import numpy as np
from numba.core.errors import NumbaExperimentalFeatureWarning

from tribodyn.hbm.contact.contact_law import SEPARATES

# a contact law is passed as a function
warnings.filterwarnings("ignore", "First-class function type", NumbaExperimentalFeatureWarning)

SWEEPS, SLOW = 60, 0.5  # at most of Gauss-Seidel; factor per sweep from which on it is slow
LOCAL, DAMPED = 40, 20  # iterations of one pair; from which on its steps are halved
NEWTON = 60
MOST = 3  # components of a pair: loops over min(c, MOST) are unrolled, in a third less time
SHORTEST = 0.1  # share of a Newton step that is tried before a worse point is taken all the same


# of functions that are called pair by pair and make no array: numba's count of references would take half of the time
PLAIN = {"cache": True, "_nrt": False, "error_model": "numpy"}


class Contact(NamedTuple):
    """The contact that a step meets.

    p : (n_pair, ...) packed parameters; gap : (n_pair,) [m]; normal : position of the component n, -1 without one
    A : (n_pair * c, n_pair * c) compliance of a step, row i the displacement of all under a unit force i; symmetric
        but for Coriolis forces
    forgets : whether a pair that touches has forgotten its memory, see `forgets`
    accuracy : of the contact's equations, relative to the largest contact displacement
    """

    p: np.ndarray
    gap: np.ndarray
    normal: int
    A: np.ndarray
    forgets: bool = False
    accuracy: float = 1e-12


class Linear(NamedTuple):
    """The linear part of every step of a period.

    E : (2 m, 2 m), Q : (2 m, m), U : (n_contact, m)
    impulse : (n_step, 2 m), rest : (n_step, n_contact) under the loads
    """

    E: np.ndarray
    Q: np.ndarray
    U: np.ndarray
    impulse: np.ndarray
    rest: np.ndarray


class Moving(NamedTuple):
    """What moves: z (2 m,), x and f (n_pair, c), memory (n_pair, n_state), bits (n_pair,) status after it.

    hold : (k,) force that holds a mean displacement, constant within a period
    """

    z: np.ndarray
    x: np.ndarray
    f: np.ndarray
    memory: np.ndarray
    bits: np.ndarray
    hold: np.ndarray


class Space(NamedTuple):
    """Work space of a step: `room` of one pair, two for its equations, y = A f, then of all pairs status bits, slopes
    J = df/dx with the inverse M of 1 + A J of each pair, and memory. All steps with one A share it.

    inverse : (n_contact, n_contact) of the derivative in the last step that needed Newton's method, its first entry
        zero before that; such steps come in a row, and one inverse serves many of them
    """

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


class Record(NamedTuple):
    """One period, at the ends of its steps.

    x, f : (n_step, n_pair, c); z : (n_step, 2 m); bits : (n_pair,) all that happened
    y : (n_step, n_output) outputs, which the stepper adds
    slopes : derivatives of (f, memory) after a step with respect to (x_1, memory before, x_0), as (n_step, n_pair,
        c + n_state, c + n_state + c), or of length 0 where they are not wanted
    """

    x: np.ndarray
    f: np.ndarray
    z: np.ndarray
    y: np.ndarray
    bits: np.ndarray
    slopes: np.ndarray


@numba.njit(**PLAIN)
def put(values, to):
    """Copy a vector; to assign one array to a slice of another takes numba seconds to compile."""
    for i in range(to.size):
        to[i] = values[i]


@numba.njit(cache=True)
def room(c, n_state):
    """Work space of a pair: f, memory, df/dx after `advance`; other slopes of the law; two for a touch; a matrix."""
    return (
        np.zeros(c), np.zeros(n_state), np.zeros((c, c)),
        np.zeros((c, n_state)), np.zeros((n_state, c)), np.zeros((n_state, n_state)),
        np.zeros(c), np.zeros((n_state, 2 * c + n_state)), np.zeros((c, c)),
    )  # fmt: skip


@numba.njit(inline="always", **PLAIN)
def advance(step, x0, was_open, x1, s, p, gap, normal, work, chained):
    """The law of one pair along the straight line from x0 to x1 with memory s before, into `work`.

    chained : whether the slopes of the memory are wanted, too; clearing them is most of the work of laws that have
        much of it
    Returns the status bits, negative where the pair touches on the way and the law has a memory: `before` in `work`
    then holds the derivative of that at the touch with respect to (x1, s, x0)
    """
    f, memory, J, dfs, dsx, dss, touch, before, _ = work
    c, n_state = min(x1.size, MOST), s.size
    for r in range(n_state):
        memory[r] = s[r]
    closes = normal >= 0 and was_open and n_state > 0 and x0[normal] < gap < x1[normal]
    if closes:
        share = (gap - x0[normal]) / (x1[normal] - x0[normal])
        for a in range(c):
            touch[a] = x0[a] + share * (x1[a] - x0[a])
        touch[normal] = gap
        clear(J, dfs, dsx, dss)
        step(touch, memory, p, f, J, dfs, dsx, dss)
        for r in range(n_state):
            for b in range(2 * c + n_state):
                before[r, b] = 0.0
            for q in range(n_state):
                before[r, c + q] = dss[r, q]
            for a in range(c):
                before[r, a] += share * dsx[r, a]
                before[r, c + n_state + a] += (1.0 - share) * dsx[r, a]
                slide = dsx[r, a] * (x1[a] - x0[a]) / (x1[normal] - x0[normal])  # the instant moves, too
                before[r, normal] -= share * slide
                before[r, c + n_state + normal] -= (1.0 - share) * slide
    if chained or closes:
        clear(J, dfs, dsx, dss)
    else:
        for a in range(c):
            for b in range(c):
                J[a, b] = 0.0
    bits = step(x1, memory, p, f, J, dfs, dsx, dss)
    if closes:
        for a in range(c):
            for r in range(n_state):
                for b in range(c):
                    J[a, b] += dfs[a, r] * before[r, b]
        return -bits
    return bits


@numba.njit(**PLAIN)
def clear(J, dfs, dsx, dss):
    """Set all slopes of a law to zero."""
    for M in (J, dfs, dsx, dss):
        for a in range(M.shape[0]):
            for b in range(M.shape[1]):
                M[a, b] = 0.0


@numba.njit(**PLAIN)
def slopes_of(touched, work, D):
    """Derivative D of (f, memory) with respect to (x1, memory before, x0), of what `advance` left in `work`."""
    _, _, J, dfs, dsx, dss, _, before, _ = work
    c = J.shape[0]
    D[:] = 0.0
    add(J, D[:c, :c])
    add(dsx, D[c:, :c])
    if not touched:
        add(dfs, D[:c, c:])
        add(dss, D[c:, c:])
        return
    add_product(dfs, before[:, c:], D[:c, c:])
    add_product(dss, before[:, 0:], D[c:, 0:])


@numba.njit(**PLAIN)
def add(M, D):
    """Add the matrix M to D, a view of a larger one: of one type, so that this compiles once."""
    for a in range(M.shape[0]):
        for b in range(M.shape[1]):
            D[a, b] += M[a, b]


@numba.njit(**PLAIN)
def add_product(A, B, D):
    """Add A B to D, a view of a larger matrix."""
    for a in range(A.shape[0]):
        for b in range(B.shape[1]):
            for k in range(A.shape[1]):
                D[a, b] += A[a, k] * B[k, b]


@numba.njit(**PLAIN)
def differ(A, B):
    """Whether two small matrices differ."""
    for a in range(min(A.shape[0], MOST)):
        for b in range(min(A.shape[1], MOST)):
            if A[a, b] != B[a, b]:
                return True
    return False


@numba.njit(**PLAIN)
def invert(M, R):
    """Inverse R of a small matrix M, which is lost; columns without a pivot are left as they are."""
    n = min(M.shape[0], MOST)
    for i in range(n):
        for q in range(n):
            R[i, q] = 1.0 if i == q else 0.0
    for i in range(n):
        best = i
        for j in range(i + 1, n):
            if abs(M[j, i]) > abs(M[best, i]):
                best = j
        if M[best, i] == 0.0:
            continue
        for q in range(n):
            M[i, q], M[best, q] = M[best, q], M[i, q]
            R[i, q], R[best, q] = R[best, q], R[i, q]
        share = 1.0 / M[i, i]
        for q in range(n):
            M[i, q] *= share
            R[i, q] *= share
        for j in range(n):
            share = M[j, i] if j != i else 0.0
            for q in range(n):
                M[j, q] -= share * M[i, q]
                R[j, q] -= share * R[i, q]


@numba.njit(inline="always", **PLAIN)
def solve_pair(step, x0, was_open, x, s, p, gap, normal, compliance, b, tolerance, bits, work, r, J, M):
    """Newton on x + own f(x) = b for one pair from the guess x, which is overwritten; returns bits, 0: failed.

    bits : of the guess, whose force and memory are in `work` then; 0 where it is not known
    M : inverse of 1 + own J, kept from solution to solution as long as the slope J stays what it was
    """
    f, slope, matrix = work[0], work[2], work[8]
    c = min(x.size, MOST)
    is_evaluated = bits != 0
    for it in range(LOCAL):
        if not is_evaluated:
            bits = advance(step, x0, was_open, x, s, p, gap, normal, work, False)
            if differ(slope, J):
                for a in range(c):
                    for q in range(c):
                        J[a, q], matrix[a, q] = slope[a, q], 1.0 if a == q else 0.0
                        for k in range(c):
                            matrix[a, q] += compliance[a, k] * slope[k, q]
                invert(matrix, M)
        is_evaluated = False
        size = 0.0
        for a in range(c):
            r[a] = x[a] - b[a]
            for q in range(c):
                r[a] += compliance[a, q] * f[q]
            size = max(size, abs(r[a]))
        if size <= tolerance:
            break
        part = 1.0 if it < DAMPED else 0.5
        for a in range(c):
            for q in range(c):
                x[a] -= part * M[a, q] * r[q]
    else:
        bits = 0
    return abs(bits)


@numba.njit(**PLAIN)
def sweep(step, contact, x_free, x0, was_open, s, x, f, y, bits, J, M, memory, tolerance, backward, work, r, b):
    """One round of Gauss-Seidel over all pairs; y = A f and all else moves on in place but x and memory of open pairs.

    Returns the largest displacement of a pair, negative where one failed
    """
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


@numba.njit(cache=True)
def solve_contact(step, contact, x_free, x0, was_open, s, x, f, scale, space):
    """Solve x + A f(x) = x_free for all pairs from the guesses x, f, which are overwritten; s is the memory before.

    space : with y = A f of the guess; the memory at x is left there, but of open pairs
    Returns rounds spent (negative: failed) and the scale of x
    """
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


@numba.njit(**PLAIN)
def pass_on(step, contact, x, was_open, x_new, memory, bits, work, forces, slopes):
    """Memory and bits of all pairs over a step that is known; of forces and slopes (n, ...) the first is filled."""
    chained = slopes.shape[0] > 0
    for i in range(x.shape[0]):
        now = advance(
            step, x[i], was_open[i], x_new[i], memory[i], contact.p[i], contact.gap[i], contact.normal, work, chained
        )
        put(work[1], memory[i])
        if chained:
            slopes_of(now < 0, work, slopes[0, i])
        if forces.shape[0] > 0:
            put(work[0], forces[0, i])
        bits[i] = abs(now)


@numba.njit(**PLAIN)
def foresee(x_free, f, f_before, bits, A, y, x_new, f_new, was_open):
    """Guess of a step: forces go on as before, but of pairs without; with y = A f_new and x_new under them."""
    n_pair, c = f.shape
    for i in range(n_pair):
        was_open[i] = bits[i] == SEPARATES
        for a in range(c):
            f_new[i, a] = 0.0 if f[i, a] == 0.0 else 2.0 * f[i, a] - f_before[i, a]
    displace(A, f_new, y)
    for i in range(n_pair):
        for a in range(c):
            x_new[i, a] = x_free[i * c + a] - y[i * c + a]


@numba.njit(**PLAIN)
def take_up(step, contact, x, was_open, x_new, memory, bits, space, late):
    """As `pass_on` after `solve_contact`, which has left the memory of all but open pairs.

    late : leave the memory of pairs that stay open as it is
    """
    work, normal = space.work, contact.normal
    for i in range(x.shape[0]):
        bits[i] = space.bits[i]
        if bits[i] != SEPARATES:
            put(space.memory[i], memory[i])
            continue
        if late and was_open[i] and x_new[i, normal] < contact.gap[i]:
            continue
        bits[i] = abs(
            advance(step, x[i], was_open[i], x_new[i], memory[i], contact.p[i], contact.gap[i], normal, work, False)
        )
        put(work[1], memory[i])


@numba.njit(cache=True)
def forgets(step, p, gap, normal, memory):
    """Whether pairs that touch stand where they would with another memory (n_pair, n_state) before; normal is last."""
    work, x = room(normal + 1, memory.shape[1]), np.zeros(normal + 1)
    for i in range(len(memory)):
        x[normal] = gap[i]
        advance(step, x, False, x, memory[i], p[i], gap[i], -1, work, False)
        after = work[1].copy()
        advance(step, x, False, x, memory[i] + 1.0, p[i], gap[i], -1, work, False)
        if np.any(work[1] != after):
            return False
    return True


@numba.njit(cache=True)
def march(step, contact, linear, moving, record, space):
    """March one period; `moving` moves on in place, the record is filled.

    Returns the step that failed or -1, the rounds of the contact solver spent, and the largest |h v|
    """
    z, x, f, memory, bits, _ = moving
    n_step, m = len(linear.impulse), linear.Q.shape[1]
    spent, scale, speed = 0, largest(x), 0.0
    chained = record.slopes.shape[0] > 0
    space.inverse[0, 0] = 0.0
    record.bits[:] = 0
    f_before, was_open, half = f, np.empty(x.shape[0], np.bool_), np.empty(m)
    kick, z_free, x_free = np.empty(2 * m), np.empty(2 * m), np.empty(x.size)
    push_modes(f.ravel(), linear.U, linear.Q, half, kick)
    for j in range(n_step):
        x_new, f_new = record.x[j], record.f[j]
        np.dot(linear.E, z, z_free)
        z_free += linear.impulse[j]
        z_free -= kick
        np.dot(linear.U, z_free[:m], x_free)
        x_free += linear.rest[j]
        foresee(x_free, f, f_before, bits, contact.A, space.y, x_new, f_new, was_open)
        rounds, scale = solve_contact(step, contact, x_free, x, was_open, memory, x_new, f_new, scale, space)
        spent += abs(rounds)
        if rounds < 0:
            return j, spent, speed
        if chained:
            pass_on(step, contact, x, was_open, x_new, memory, bits, space.work, record.f[:0], record.slopes[j:])
        else:
            take_up(step, contact, x, was_open, x_new, memory, bits, space, contact.forgets and j + 1 < n_step)
        record.bits[:] |= bits
        x, f, f_before = x_new, f_new, f
        push_modes(f.ravel(), linear.U, linear.Q, half, kick)
        speed = max(speed, arrive(z_free, kick, z, record.z[j]))
    put(x.ravel(), moving.x.ravel())
    put(f.ravel(), moving.f.ravel())
    return -1, spent, speed


@numba.njit(cache=True)
def push_modes(f, U, Q, half, kick):
    """Half the impulse `kick` (2 m,) that forces f (n_contact,) give the modes within a step; half (m,) to work on."""
    np.dot(f, U, half)
    half *= 0.5
    np.dot(Q, half, kick)


@numba.njit(**PLAIN)
def arrive(z_free, kick, z, z_kept):
    """z after a step, moved on and recorded; returns |h v|."""
    speed = 0.0
    for i in range(z.size):
        z[i] = z_kept[i] = z_free[i] - kick[i]
        if 2 * i >= z.size:
            speed += z[i] ** 2
    return np.sqrt(speed)


@numba.njit(cache=True)
def along(step, contact, before, xs, memory, bits, forces, slopes):
    """The law of all pairs through displacements xs (n_step, n_pair, c) that follow `before` (n_pair, c).

    memory (n_pair, n_state) and bits (n_pair,) move on in place; forces : (n_step, n_pair, c) and slopes, as of
    `Record`, to be filled, or empty
    """
    work = room(xs.shape[2], memory.shape[1])
    for j in range(len(xs)):
        x = xs[j - 1] if j > 0 else before
        pass_on(step, contact, x, bits == SEPARATES, xs[j], memory, bits, work, forces[j:], slopes[j:])


@numba.njit(cache=True)
def memory_after(step, xs, contact, memory):
    """Memory (n_pair, n_state) and status after two rounds of a periodic displacement xs (n_step, n_pair, c)."""
    s, bits = memory.copy(), np.zeros(xs.shape[1], np.int64)
    for _ in range(2):
        along(step, contact, xs[-1], xs, s, bits, xs[:0], np.empty((0, 0, 0, 0)))
    return s, bits
