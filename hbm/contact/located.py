"""Jenkins family with located transitions: events are roots of trigonometric polynomials, forces closed-form integrals.

In slider coordinates a tangential direction is a play with moving walls: lo = u - r N <= w <= hi = u + r N with
r = mu / k_t, and w moves only where a wall pushes it. Between two neighbours among {contact and separation: roots of N;
turning points of the walls: roots of lo' and hi'} both walls are monotone, so each such interval holds at most one
transition, the crossing of one wall with a constant. T is k_t (u - w), +-mu N or 0: always in the span of the basis
functions and 1, whose products are integrated exactly. T and N are continuous at every transition, so transitions add
nothing to the Jacobian but the derivative of the slider position at which a stick began.

The result does not depend on the number of time samples: it is the Fourier integral itself, to rounding. Roots are
isolated by Taylor bounds, so no number of events in one sample interval, nor a grazing one, is missed. Samples are of
second order, of first order for friction that lifts, where the sampled Jacobian does not converge at all (measured in
test_contact_located). Cost, measured: as 128 samples where most pairs stick; where all slip, twice that at H = 3, eight
times at H = 15. A response curve with lifting pairs took as long either way: Newton needed 15 % fewer steps.
Source  Petrov and Ewins 2003 (friction element exact between transitions); moving walls and root isolation ours.
"""

from __future__ import annotations

import functools
import math

import numba
import numpy as np

from tribodyn.hbm.contact.law import SEPARATES, SLIPS, STICKS, ContactCycle, ContactParameters
from tribodyn.hbm.harmonics import HarmonicBasis

TURN = 2 * math.pi
STICK = 0.0  # kinds of segment; slip is the sign of T
CELLS_PER_HARMONIC = 8  # of the grid on which roots are isolated: a polynomial of degree H has at most 2 H roots
MOST_CELLS = 256  # that are looked into, for each cell of the grid: a double root takes some hundred
SEGMENT_COLUMNS = 6  # of a segment: start, stop, kind, w, origin (-1: memory), d w / d N at the origin
SHORT = 0.5  # rad of the highest harmonic, below which a force is integrated by Gauss's rule: six points leave 1e-16
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(6)


def cycle(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool = True
) -> ContactCycle:
    """The periodic cycle of a law of the Jenkins family; without the component n the normal load is constant.

    x : (n_pair, n_component, n_coeff) [m]; memory : (n_pair, n_tangential) slider positions at the start [m]
    """
    n_pair, n_comp, n_coeff = x.shape
    skip = 0 if basis.has_static else 1  # inside, the constant is always there
    full = np.zeros((n_pair, n_comp, n_coeff + skip))
    full[..., skip:] = x
    load = np.zeros((n_pair, n_coeff + skip))
    normal = "n" in parameters.components
    if normal:
        kn = parameters.stiffness[:, -1]
        load[:] = kn[:, None] * full[:, -1]
        load[:, 0] -= kn * parameters.gap
    else:
        load[:, 0] = parameters.numbers["normal_load"]
    grid = _grid(basis.dynamic)
    n = grid.shape[1] // 5  # given, as there may be no pair
    x_grid, load_grid = (full @ grid).reshape(n_pair, n_comp, 5, n), (load @ grid).reshape(n_pair, 5, n)
    # of one layout, as numba compiles the kernel for each that it meets
    k, memory = np.ascontiguousarray(parameters.stiffness), np.ascontiguousarray(memory)
    mu = np.ascontiguousarray(parameters.numbers.get("friction", np.zeros(n_pair)))
    hs = np.asarray(basis.dynamic, np.int64)
    force = np.zeros_like(full)
    jac = np.zeros((n_pair, n_comp * n_coeff, n_comp * n_coeff)) if jacobian else np.zeros((0, 0, 0))
    status = np.zeros(n_pair, np.int64)
    _cycle(full, load, x_grid, load_grid, normal, k, mu, memory, hs, skip, force, jac, status)
    return ContactCycle(force[..., skip:].copy(), jac if jacobian else None, status)


@functools.cache
def _grid(harmonics: tuple[int, ...]) -> np.ndarray:
    """(n_coeff, 5 * n_cell) values, slopes, curvatures in the middle of equal cells; values, slopes at their ends."""
    basis = HarmonicBasis((0, *harmonics), 2 * harmonics[-1] + 1)
    right = TURN * np.arange(1, CELLS_PER_HARMONIC * harmonics[-1] + 1) / (CELLS_PER_HARMONIC * harmonics[-1])
    middle, end = basis.functions(right - 0.5 * right[0]), basis.functions(right)
    slope = basis.rate.T  # coefficients of x' = c @ R, so functions of x' = functions @ R^T
    return np.concatenate([middle, middle @ slope, middle @ slope @ slope, end, end @ slope]).T.copy()


@numba.njit(cache=True)
def _cycle(x, load, x_grid, load_grid, normal, k, mu, memory, hs, skip, force, jac, status):
    """All pairs; what one pair needs is allocated once. m counts the constant, whether kept or not."""
    n_pair, n_comp, m = x.shape
    want = jac.shape[0] > 0
    room = 4 * hs[-1] + 16  # a polynomial has at most 2 H roots
    contact, closed = np.empty(room), np.empty(room, np.bool_)
    edges, touching, at_edge = np.empty(3 * room), np.empty(3 * room, np.bool_), np.empty((3 * room, 4))
    segments = np.empty((6 * room, SEGMENT_COLUMNS))
    span, table = np.empty((2, 2 * hs[-1] + 1)), np.empty((2, 2, 2 * hs[-1] + 1))
    slope = np.empty((2, m, m))  # of the force with respect to u and N
    n_tangential = n_comp - 1 if normal else n_comp
    for i in range(n_pair):
        N = load[i]
        n_contact, n_closed = _contact(N, load_grid[i], hs, contact, closed)
        status[i] = 0 if n_closed == n_contact else SEPARATES
        kn = k[i, n_comp - 1] if normal else 0.0
        if normal:
            _normal(N, contact, closed, n_contact, hs, span, table, force[i, n_comp - 1], slope)
            if want:
                _store(slope[1], kn, skip, n_comp - 1, n_comp - 1, jac[i])
        if n_closed == 0:
            continue
        if n_tangential == 0:
            status[i] |= STICKS
        for c in range(n_tangential):
            u, kt, w = x[i, c], k[i, c], memory[i, c]
            if _cannot_slip(kt, mu[i], w, u, N, hs):
                n_segment = _append(segments, np.int64(0), 0.0, TURN, STICK, w, -1.0, 0.0)
            else:
                r = mu[i] / kt
                n_edge = _edges(r, u, N, x_grid[i, c], load_grid[i], contact, closed, n_contact, hs, edges, touching)
                n_segment = _segments(w, r, u, N, hs, edges, touching, n_edge, at_edge, segments)
            for s in range(n_segment):
                status[i] |= STICKS if segments[s, 2] == STICK else SLIPS
            _tangential(kt, mu[i], u, N, segments, n_segment, hs, span, table, force[i, c], slope)
            if want:
                _store(slope[0], 1.0, skip, c, c, jac[i])
                if normal:
                    _store(slope[1], kn, skip, c, n_comp - 1, jac[i])


@numba.njit(cache=True)
def _store(slope, factor, skip, row, column, jac):
    """Put factor x slope, without the constant where it is not kept, into one block of the Jacobian of a pair."""
    m = len(slope) - skip
    for a in range(m):
        for b in range(m):
            jac[row * m + a, column * m + b] = factor * slope[a + skip, b + skip]


@numba.njit(cache=True)
def _at(c, hs, angle):
    """Value and slope of the trigonometric polynomial c at an angle."""
    co, si = math.cos(angle), math.sin(angle)
    pc, ps, n = 1.0, 0.0, 0
    value, slope = c[0], 0.0
    for q in range(hs.size):
        while n < hs[q]:
            pc, ps = pc * co - ps * si, pc * si + ps * co
            n += 1
        a, b = c[1 + 2 * q], c[2 + 2 * q]
        value += a * pc + b * ps
        slope += n * (b * pc - a * ps)
    return value, slope


@numba.njit(cache=True)
def _size(c, hs, power):
    """Sum of h^power |c_h| over the harmonics h >= 1: no derivative of that order is larger."""
    total = 0.0
    for q in range(hs.size):
        total += hs[q] ** power * math.hypot(c[1 + 2 * q], c[2 + 2 * q])
    return total


@numba.njit(cache=True)
def _crossing(c, hs, level, rising, left, right):
    """Angle in [left, right] where the polynomial, monotone there, crosses a level; Newton inside a bracket."""
    angle = 0.5 * (left + right)
    for _ in range(80):
        value, slope = _at(c, hs, angle)
        value -= level
        if value == 0.0:
            break
        if (value < 0.0) == rising:
            left = angle
        else:
            right = angle
        change = value / slope if slope != 0.0 else TURN
        if abs(change) <= 4e-16 * (1.0 + angle) or right - left <= 4e-16 * (1.0 + angle):
            break
        angle -= change
        if not left < angle < right:
            angle = 0.5 * (left + right)
    return angle


@numba.njit(cache=True)
def _roots(c, hs, value_grid, slope_grid, end_grid, out, n):
    """Append all sign changes of a polynomial in (0, 2 pi] to out[n:], ascending; returns the new count.

    A cell of width d without a root or with a monotone polynomial is recognised by Taylor's bound about its middle,
    |f(t) - f(m) - f'(m) (t - m)| <= F d^2 / 8 with F = sum h^2 |c_h|; every other cell is halved. The depth is limited:
    at 1e-9 rad only a double root is left, which changes nothing. So is the number of cells: a harmonic has at most two
    roots, and what is no number has none.
    """
    bound = _size(c, hs, 2)
    if not abs(c[0]) <= _size(c, hs, 0) or not 0.0 < bound < math.inf:
        return n
    cells = value_grid.size
    cell, level = 0, 0
    left, positive = 0.0, end_grid[-1] >= 0.0
    for _ in range(MOST_CELLS * (cells + hs[-1])):
        if cell >= cells << level:
            break
        width = TURN / (cells << level)
        if level == 0:
            value, slope = value_grid[cell], slope_grid[cell]
        else:
            value, slope = _at(c, hs, left + 0.5 * width)
        free = abs(value) > 0.5 * width * abs(slope) + bound * width**2 / 8
        monotone = 2 * abs(slope) > bound * width
        if not free and not monotone and level < 28:
            level += 1
            cell *= 2
            continue
        cell += 1
        right = TURN * cell / (cells << level)
        if free:
            after = value >= 0.0
        elif level == 0:
            after = end_grid[cell - 1] >= 0.0
        else:
            after = _at(c, hs, right)[0] >= 0.0
        if after != positive and n < out.size - 2:
            out[n] = left if free else _crossing(c, hs, 0.0, after, left, right) if monotone else 0.5 * (left + right)
            n += 1
        left, positive = right, after
        while cell % 2 == 0 and level > 0:
            cell //= 2
            level -= 1
    return n


@numba.njit(cache=True)
def _contact(load, grid, hs, contact, closed):
    """Split the period where the load changes sign; returns the number of intervals and of the closed ones."""
    contact[0] = 0.0
    n = _roots(load, hs, grid[0], grid[1], grid[3], contact, np.int64(1))  # of the type of the call below
    contact[n] = TURN
    n_closed = 0
    for j in range(n):  # without a change of sign the mean decides, else the signs alternate
        closed[j] = load[0] > 0.0 if n == 1 else (grid[3, -1] >= 0.0) == (j % 2 == 0)
        n_closed += closed[j]
    return n, n_closed


@numba.njit(cache=True)
def _cannot_slip(kt, mu, w, u, load, hs):
    """Whether the sizes of the harmonics alone show that the slider stays where it is."""
    return kt == 0.0 or kt * (abs(u[0] - w) + _size(u, hs, 0)) <= mu * (load[0] - _size(load, hs, 0))


@numba.njit(cache=True)
def _edges(r, u, load, u_grid, load_grid, contact, closed, n_contact, hs, edges, touching):
    """Angles between which the contact keeps its state and both walls are monotone; returns the number of intervals."""
    n = n_contact
    for j in range(n):
        edges[j] = contact[j]
    turning = np.zeros(u.size)
    for side in (-1.0, 1.0):
        for q in range(1, u.size, 2):
            h = hs[q // 2]
            turning[q] = h * (u[q + 1] + side * r * load[q + 1])
            turning[q + 1] = -h * (u[q] + side * r * load[q])
        g = u_grid + side * r * load_grid
        n = _roots(turning, hs, g[1], g[2], g[4], edges, n)
        if _size(load, hs, 0) == 0.0:  # the other wall turns with it
            break
    for j in range(n_contact, n):  # insertion sort
        angle = edges[j]
        at = j
        while edges[at - 1] > angle:
            edges[at] = edges[at - 1]
            at -= 1
        edges[at] = angle
    edges[n] = TURN
    now = 0
    for j in range(n):
        while now < n_contact - 1 and contact[now + 1] <= edges[j]:
            now += 1
        touching[j] = closed[now]
    return n


@numba.njit(cache=True)
def _pushed(w, origin, tilt, r, angle, at, touching):
    """Slider at the end of an interval, the angle that determines it, and d w / d N there; at: u, u', N, N'."""
    if not touching:
        return at[0], angle, -at[1] / at[3] if abs(at[1]) < r * abs(at[3]) else 0.0  # else slips as soon as it touches
    if w < at[0] - r * at[2]:
        return at[0] - r * at[2], angle, -r
    if w > at[0] + r * at[2]:
        return at[0] + r * at[2], angle, r
    return w, origin, tilt


@numba.njit(cache=True)
def _segments(w, r, u, load, hs, edges, touching, n_edge, at, segments):
    """Sticks and slips of the periodic cycle; returns their number.

    A cycle maps w to a clamp of w, so one cycle, for which the ends of the intervals suffice, settles it.
    """
    for j in range(n_edge + 1):
        at[j, 0], at[j, 1] = _at(u, hs, edges[j])
        at[j, 2], at[j, 3] = _at(load, hs, edges[j])
    w, origin, tilt = _pushed(w, -1.0, 0.0, r, 0.0, at[0], touching[0])
    for j in range(n_edge):
        w, origin, tilt = _pushed(w, origin, tilt, r, edges[j + 1], at[j + 1], touching[j])
    n = 0
    for j in range(n_edge):
        left, right = edges[j], edges[j + 1]
        before, before_origin, before_tilt = w, origin, tilt
        w, origin, tilt = _pushed(w, origin, tilt, r, right, at[j + 1], touching[j])
        if not touching[j]:
            continue
        side = 1.0 if w > before else -1.0  # of the force, should the slider have moved
        slip = right
        if w != before:
            slip = left
            if side * (before - at[j, 0]) + r * at[j, 2] > 0.0:
                slip = _crossing(u - side * r * load, hs, before, side > 0.0, left, right)
            if slip - left < 1e-12:
                slip = left
        if slip > left:
            n = _append(segments, n, left, slip, STICK, before, before_origin, before_tilt)
        if slip < right:
            n = _append(segments, n, slip, right, side, 0.0, 0.0, 0.0)
    return n


@numba.njit(cache=True)
def _append(segments, n, start, stop, kind, w, origin, tilt):
    """Append a segment, or lengthen the last one where it continues unchanged."""
    if n > 0:
        last = segments[n - 1]
        if last[1] == start and last[2] == kind and last[3] == w and last[4] == origin:
            last[1] = stop
            return n
    new = segments[n]
    new[0], new[1], new[2], new[3], new[4], new[5] = start, stop, kind, w, origin, tilt
    return n + 1


@numba.njit(cache=True)
def _span(start, stop, span):
    """Integrals over [start, stop] of cos n t and sin n t for n = 0, 1, ..."""
    span[0, 0], span[1, 0] = stop - start, 0.0
    ca, sa, cb, sb = math.cos(start), math.sin(start), math.cos(stop), math.sin(stop)
    cna, sna, cnb, snb = 1.0, 0.0, 1.0, 0.0
    for n in range(1, span.shape[1]):
        cna, sna = cna * ca - sna * sa, cna * sa + sna * ca
        cnb, snb = cnb * cb - snb * sb, cnb * sb + snb * cb
        span[0, n] = (snb - sna) / n
        span[1, n] = (cna - cnb) / n


@numba.njit(cache=True)
def _add(factor, span, table):
    """table += factor span; in the short form numba takes seconds to compile."""
    for a in range(span.shape[0]):
        for b in range(span.shape[1]):
            table[a, b] += factor * span[a, b]


@numba.njit(cache=True)
def _products(table, hs, out):
    """Fourier coefficients a of basis function b over the spans summed in the table: (m, m)."""
    C, S = table  # of cos n t and of sin n t
    for a in range(out.shape[0]):
        h = hs[(a - 1) // 2] if a > 0 else 0
        weight = 1.0 / math.pi if a > 0 else 0.5 / math.pi
        for b in range(out.shape[0]):
            g = hs[(b - 1) // 2] if b > 0 else 0
            a_sine, b_sine = a > 0 and a % 2 == 0, b > 0 and b % 2 == 0
            if a_sine and b_sine:
                value = C[abs(h - g)] - C[h + g]
            elif a_sine or b_sine:
                difference = h - g if a_sine else g - h
                value = S[h + g] + (S[difference] if difference >= 0 else -S[-difference])
            else:
                value = C[abs(h - g)] + C[h + g]
            out[a, b] = 0.5 * weight * value


@numba.njit(cache=True)
def _short(start, stop, hs):
    """Whether integrals over [start, stop] are differences of nearly equal numbers; their products even more so."""
    return (stop - start) * hs[-1] < SHORT


@numba.njit(cache=True)
def _add_short(factor, c, level, start, stop, hs, force):
    """Add the Fourier coefficients of factor (c - level) over [start, stop], c a polynomial small beside its parts.

    A stiff contact touches so shortly that its force is a 1e-8 of what its spring would bear over the whole cycle
    """
    half = 0.5 * (stop - start)
    for p in range(POINTS.size):
        angle = start + half * (1.0 + POINTS[p])
        value = factor * (_at(c, hs, angle)[0] - level) * WEIGHTS[p] * half / math.pi
        force[0] += 0.5 * value
        for q in range(hs.size):
            force[1 + 2 * q] += value * math.cos(hs[q] * angle)
            force[2 + 2 * q] += value * math.sin(hs[q] * angle)


@numba.njit(cache=True)
def _normal(load, contact, closed, n_contact, hs, span, table, force, slope):
    """Coefficients of max(N, 0) and their derivative with respect to those of N."""
    out = slope[1]
    n_short = 0
    if n_contact == 1:  # one state all the time: no integral, no rounding
        out[:] = 0.0
        if closed[0]:
            for a in range(len(out)):
                out[a, a] = 1.0
    else:
        table[0] = 0.0
        for j in range(n_contact):
            if closed[j] and _short(contact[j], contact[j + 1], hs):
                n_short += 1
            elif closed[j]:
                _span(contact[j], contact[j + 1], span)
                _add(1.0, span, table[0])
        _products(table[0], hs, out)
    for a in range(len(out)):
        force[a] = 0.0
        for b in range(len(out)):
            force[a] += out[a, b] * load[b]
    if n_short == 0:
        return
    for j in range(n_contact):
        if closed[j] and _short(contact[j], contact[j + 1], hs):
            _add_short(1.0, load, 0.0, contact[j], contact[j + 1], hs, force)
            _span(contact[j], contact[j + 1], span)
            _add(1.0, span, table[0])
    _products(table[0], hs, out)


@numba.njit(cache=True)
def _tangential(kt, mu, u, load, segments, n_segment, hs, span, table, force, slope):
    """Coefficients of T and their derivatives with respect to those of u and N."""
    m = u.size
    n_short = 0
    stuck = n_segment == 1 and segments[0, 2] == STICK and segments[0, 1] - segments[0, 0] == TURN
    if stuck:  # linear, no integral, no rounding
        slope[:] = 0.0
        for a in range(m):
            slope[0, a, a] = 1.0
    else:
        table[:] = 0.0
        for s in range(n_segment):
            if _short(segments[s, 0], segments[s, 1], hs):
                n_short += 1
            else:
                _add_segment(segments[s], span, table)
        _products(table[0], hs, slope[0])
        _products(table[1], hs, slope[1])
    for a in range(m):
        force[a] = 0.0
        for b in range(m):
            force[a] += kt * slope[0, a, b] * u[b] + mu * slope[1, a, b] * load[b]
    if n_short > 0:
        for s in range(n_segment):
            start, stop, kind = segments[s, 0], segments[s, 1], segments[s, 2]
            if _short(start, stop, hs):
                if kind == STICK:
                    _add_short(kt, u, segments[s, 3], start, stop, hs, force)
                else:
                    _add_short(kind * mu, load, 0.0, start, stop, hs, force)
                _add_segment(segments[s], span, table)
        _products(table[0], hs, slope[0])
        _products(table[1], hs, slope[1])
    for a in range(m):
        for b in range(m):
            slope[0, a, b] *= kt
            slope[1, a, b] *= mu
    for s in range(n_segment):
        if segments[s, 2] == STICK:
            _span(segments[s, 0], segments[s, 1], span)
            if stuck:
                span[:, 1:] = 0.0
            subtracted = 0.0 if not stuck and _short(segments[s, 0], segments[s, 1], hs) else kt * segments[s, 3]
            _subtract_slider(kt, subtracted, segments[s], hs, span, force, slope)


@numba.njit(cache=True)
def _add_segment(segment, span, table):
    """The integrals of one segment to those of stick, or to those of slip by its sign."""
    _span(segment[0], segment[1], span)
    if segment[2] == STICK:
        _add(1.0, span, table[0])
    else:
        _add(segment[2], span, table[1])


@numba.njit(cache=True)
def _subtract_slider(kt, pull, segment, hs, span, force, slope):
    """Minus the pull k_t w of one stick, and the derivative of k_t w through the instant that determines w."""
    origin, tilt = segment[4], segment[5]
    m = force.size
    for a in range(m):
        h = hs[(a - 1) // 2] if a > 0 else 0
        part = span[1, h] / math.pi if a > 0 and a % 2 == 0 else span[0, h] / (math.pi if a > 0 else TURN)
        force[a] -= pull * part
        if origin < 0.0 or part == 0.0:
            continue
        for b in range(m):
            g = hs[(b - 1) // 2] * origin if b > 0 else 0.0
            phi = math.sin(g) if b > 0 and b % 2 == 0 else math.cos(g)
            slope[0, a, b] -= kt * part * phi
            slope[1, a, b] -= kt * part * tilt * phi
