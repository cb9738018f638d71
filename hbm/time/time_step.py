"""Time steps of one period: the linear part exact, the contact solved implicitly in every step.

In modal coordinates of the structure, contact open, a step from t_0 to t_1 = t_0 + h with z = (eta, h v) is

    z_1 = E z_0 + impulse - Q (f_0 + f_1) / 2,      x_1 = U eta_1 + rest_1 - W f_1.

E = exp(A h) and the impulse of the loads are exact, whatever h is. The contact force f acts with its mean over the
step, which keeps the second order and the stability of the trapezoidal rule at any contact stiffness and adds no
damping. Modes far above what a step resolves follow without inertia (W, and `rest` under the loads).
What is left of a step is x_1 = x_free - A f(x_1) with one constant compliance A for all steps (coupled_pairs).
Source  exponential integrators: Hochbruck and Ostermann 2010; trapezoidal rule of the contact: Newmark 1959; the
condensation to the contact is ours"""

from typing import NamedTuple

import numba
import numpy as np

from tribodyn.hbm.contact.compiled_law import stamp_with
from tribodyn.hbm.contact.contact_law import SEPARATES
from tribodyn.hbm.time import coupled_pairs, pair_step
from tribodyn.hbm.time.coupled_pairs import displace, largest, solve_contact
from tribodyn.hbm.time.pair_step import PLAIN, advance, put, room, slopes_of


class Linear(NamedTuple):
    """The linear part of every step of a period.

    E : (2 m, 2 m), Q : (2 m, m), U : (n_contact, m)
    impulse : (n_step, 2 m), rest : (n_step, n_contact) under the loads
    late : share of the force at the end of a step in the mean force of it"""

    E: np.ndarray
    Q: np.ndarray
    U: np.ndarray
    impulse: np.ndarray
    rest: np.ndarray
    late: float


class Moving(NamedTuple):
    """What moves: z (2 m,), x and f (n_pair, c), memory (n_pair, n_state), bits (n_pair,) status after it.

    hold : (k,) force that holds a mean displacement, constant within a period"""

    z: np.ndarray
    x: np.ndarray
    f: np.ndarray
    memory: np.ndarray
    bits: np.ndarray
    hold: np.ndarray


class Record(NamedTuple):
    """One period, at the ends of its steps.

    x, f : (n_step, n_pair, c); z : (n_step, 2 m); bits : (n_pair,) all that happened
    y : (n_step, n_output) outputs, which the stepper adds
    slopes : derivatives of (f, memory) after a step with respect to (x_1, memory before, x_0), as (n_step, n_pair,
        c + n_state, c + n_state + c), or of length 0 where they are not wanted"""

    x: np.ndarray
    f: np.ndarray
    z: np.ndarray
    y: np.ndarray
    bits: np.ndarray
    slopes: np.ndarray


@numba.njit(cache=True)
def march(step, contact, linear, moving, record, space):
    """March one period; `moving` moves on in place, the record is filled.

    Returns the step that failed or -1, the rounds of the contact solver spent, and the largest |h v|"""
    z, x, f, memory, bits, _ = moving
    n_step, m = len(linear.impulse), linear.Q.shape[1]
    spent, scale, speed = 0, largest(x), 0.0
    chained = record.slopes.shape[0] > 0
    space.inverse[0, 0] = 0.0
    record.bits[:] = 0
    f_before, was_open, modal = f, np.empty(x.shape[0], np.bool_), np.empty(m)
    kick, z_free, x_free = np.empty(2 * m), np.empty(2 * m), np.empty(x.size)
    push_modes(f.ravel(), linear, modal, kick)
    for j in range(n_step):
        x_new, f_new = record.x[j], record.f[j]
        np.dot(linear.E, z, z_free)
        z_free += linear.impulse[j]
        z_free -= (1.0 - linear.late) / linear.late * kick
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
        push_modes(f.ravel(), linear, modal, kick)
        speed = max(speed, arrive(z_free, kick, z, record.z[j]))
    put(x.ravel(), moving.x.ravel())
    put(f.ravel(), moving.f.ravel())
    return -1, spent, speed


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
def take_up(step, contact, x, was_open, x_new, memory, bits, space, late):
    """As `pass_on` after `solve_contact`, which has left the memory of all but open pairs.

    late : leave the memory of pairs that stay open as it is"""
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
def push_modes(f, linear, modal, kick):
    """The part `kick` (2 m,) of a step's impulse on the modes by the force f (n_contact,) at its end; modal (m,)."""
    np.dot(f, linear.U, modal)
    modal *= linear.late
    np.dot(linear.Q, modal, kick)


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
    `Record`, to be filled, or empty"""
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


stamp_with(globals(), coupled_pairs, pair_step)
