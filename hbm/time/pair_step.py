"""One contact pair within a time step: its law along the straight line between the ends of the step, and its equations.

A pair that closes within the step is first brought to the instant at which it touches, on that line: friction then
begins where the contact does, not at the last step before."""

import warnings

import numba
import numpy as np
from numba.core.errors import NumbaExperimentalFeatureWarning

# a contact law is passed as a function
warnings.filterwarnings("ignore", "First-class function type", NumbaExperimentalFeatureWarning)

LOCAL, DAMPED = 40, 20  # iterations of one pair; from which on its steps are halved
MOST = 3  # components of a pair: loops over min(c, MOST) are unrolled, in a third less time

# of functions that are called pair by pair and make no array: numba's count of references would take half of the time
PLAIN = {"cache": True, "_nrt": False, "error_model": "numpy"}


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
    then holds the derivative of that at the touch with respect to (x1, s, x0)"""
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
    M : inverse of 1 + own J, kept from solution to solution as long as the slope J stays what it was"""
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
