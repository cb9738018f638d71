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
test_contact_located). Cost, measured from H = 1 to 15: two to three times that of 128 samples where all slip, less
where most pairs cannot. A response curve with lifting pairs took as long either way: Newton needed 15 % fewer steps.
Source  Petrov and Ewins 2003 (friction element exact between transitions); moving walls and root isolation ours.
"""

from __future__ import annotations

import functools
import math

import numba
import numpy as np

from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactCycle, ContactParameters
from tribodyn.hbm.harmonics import HarmonicBasis

TURN = 2 * math.pi
STICK = 0.0  # kinds of segment; slip is the sign of T
CELLS_PER_HARMONIC = 8  # of the grid on which roots are isolated: a polynomial of degree H has at most 2 H roots
MOST_CELLS = 256  # that are looked into, for each cell of the grid: a double root takes some hundred
SHORT = 0.5  # rad of the highest harmonic, below which a force is integrated by Gauss's rule: six points leave 1e-16
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(6)

# no array is made within, so none is counted; where a division by zero would be, another branch is taken
compiled = numba.njit(cache=True, _nrt=False, error_model="numpy")
_inlined = numba.njit(cache=True, _nrt=False, error_model="numpy", forceinline=True)


def cycle(
    x: np.ndarray,
    parameters: ContactParameters,
    memory: np.ndarray,
    basis: HarmonicBasis,
    jacobian: bool = True,
    *,
    friction: np.ndarray | float = 0.0,
    normal_load: np.ndarray | float = 0.0,
) -> ContactCycle:
    """The periodic cycle of a law of the Jenkins family.

    x : (n_pair, n_component, n_coeff) [m]; memory : (n_pair, n_tangential) slider positions at the start [m]
    friction : (n_pair,) coefficient; normal_load : (n_pair,) constant, of a contact without the component n [N]
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
        load[:, 0] = normal_load
    # of one layout, as numba compiles the kernel for each that it meets
    k, memory = np.ascontiguousarray(parameters.stiffness), np.ascontiguousarray(memory)
    mu = np.array(np.broadcast_to(np.asarray(friction, float), (n_pair,)))
    hs = np.asarray(basis.dynamic, np.int64)
    force = np.zeros_like(full)
    jac = np.zeros((n_pair, n_comp * n_coeff, n_comp * n_coeff)) if jacobian else np.zeros((0, 0, 0))
    status = np.zeros(n_pair, np.int64)
    _cycle(full, load, _grid(basis.dynamic), normal, k, mu, memory, hs, skip, force, jac, status)
    return ContactCycle(force[..., skip:].copy(), jac if jacobian else None, status)


@functools.cache
def _grid(harmonics: tuple[int, ...]) -> np.ndarray:
    """(n_coeff, 4 * n_cell) values at the ends of equal cells; values, slopes and curvatures in their middle."""
    basis = HarmonicBasis((0, *harmonics), 2 * harmonics[-1] + 1)
    right = TURN * np.arange(1, CELLS_PER_HARMONIC * harmonics[-1] + 1) / (CELLS_PER_HARMONIC * harmonics[-1])
    middle, end = basis.functions(right - 0.5 * right[0]), basis.functions(right)
    slope = basis.rate.T  # coefficients of x' = c @ R, so functions of x' = functions @ R^T
    return np.concatenate([end, middle, middle @ slope, middle @ slope @ slope]).T.copy()


@numba.njit(cache=True)
def _cycle(x, load, grid, normal, k, mu, memory, hs, skip, force, jac, status):
    """All pairs; what one pair needs is allocated once. m counts the constant, whether kept or not.

    knots, waves : angles, and cos n t and sin n t there; ends, segments : knots of start, stop and origin (-1: memory)
        of each segment; its kind, w, and d w / d N at the origin over r
    """
    n_pair, n_comp, m = x.shape
    top, room = hs[-1], 4 * hs[-1] + 16  # a polynomial has at most 2 H roots
    contact, cells, wall = np.empty(room), np.empty(3 * grid.shape[1] // 4), np.zeros(m)
    touching, at = np.empty(3 * room, np.bool_), np.empty((3 * room, 4))
    knots, waves = np.empty(6 * room), np.empty((6 * room, 2, 2 * top + 1))
    ends, segments = np.empty((6 * room, 3), np.int64), np.empty((6 * room, 3))
    table, slope = np.empty((2, 2, 2 * top + 1)), np.empty((2, m, m))
    none = np.int64(-1)
    want, kept = jac.shape[0] > 0, m - skip
    n_tangential = n_comp - 1 if normal else n_comp
    for i in range(n_pair):
        N, swing = load[i], _size(load[i], hs)[0]
        contact[0], n_contact = 0.0, none + 2
        if abs(N[0]) <= swing:
            n_contact = _roots(N, hs, grid, cells, contact, n_contact)
        contact[n_contact] = TURN
        # of the first interval; the others alternate
        touches = N[0] > 0.0 if n_contact == 1 else cells[len(cells) // 3 - 1] >= 0.0
        status[i] = 0 if n_contact == 1 and touches else SEPARATES
        if n_contact == 1 and not touches:
            continue
        on = n_tangential * kept
        kn = k[i, n_comp - 1] if normal else 0.0
        if normal:  # a spring without friction that is held where the contact is closed
            n_segment = none + 1
            for j in range(n_contact + 1):
                knots[j] = contact[j]
                _wave(knots[j], waves[j])
                if j > 0 and (j % 2 == 1) == touches:
                    n_segment = _append(knots, ends, segments, n_segment, j - 1, j, STICK, 0.0, none, 0.0)
            _force(1.0, 0.0, N, N, hs, knots, waves, ends, segments, n_segment, table, force[i, n_comp - 1], slope)
            if want:
                _store(slope[0, skip:, skip:], kn, jac[i, on:, on:])
        if n_tangential == 0:
            status[i] |= STICKS
        for c in range(n_tangential):
            u, kt, w = x[i, c], k[i, c], memory[i, c]
            if kt == 0.0 or kt * (abs(u[0] - w) + _size(u, hs)[0]) <= mu[i] * (N[0] - swing):  # cannot slip
                knots[0], knots[1] = 0.0, TURN
                n_segment = _append(knots, ends, segments, none + 1, none + 1, none + 2, STICK, w, none, 0.0)
            else:
                r = mu[i] / kt
                n_edge = _edges(r, u, N, swing, contact, touches, n_contact, hs, grid, cells, wall, knots, touching)
                n_segment = _segments(w, r, u, N, hs, touching, n_edge, at, wall, knots, waves, ends, segments)
            for s in range(n_segment):
                status[i] |= STICKS if segments[s, 0] == STICK else SLIPS
            _force(kt, mu[i], u, N, hs, knots, waves, ends, segments, n_segment, table, force[i, c], slope)
            if want:
                o = c * kept
                _store(slope[0, skip:, skip:], kt, jac[i, o:, o:])
                if normal:
                    _store(slope[1, skip:, skip:], mu[i] * kn, jac[i, o:, on:])


@compiled
def _store(slope, factor, jac):
    """Put factor x slope into the first block of a part of the Jacobian."""
    for a in range(slope.shape[0]):
        for b in range(slope.shape[1]):
            jac[a, b] = factor * slope[a, b]


@_inlined
def _at(c, hs, angle):
    """Value, slope and curvature of the trigonometric polynomial c at an angle."""
    co, si = math.cos(angle), math.sin(angle)
    pc, ps, n = co, si, 1
    value, slope, bend = c[0], 0.0, 0.0
    for q in range(hs.size):
        while n < hs[q]:
            pc, ps = pc * co - ps * si, pc * si + ps * co
            n += 1
        a, b, h = c[1 + 2 * q], c[2 + 2 * q], float(n)
        part = a * pc + b * ps
        value += part
        slope += h * (b * pc - a * ps)
        bend -= h * h * part
    return value, slope, bend


@_inlined
def _wave(angle, wave):
    """Put cos n t and sin n t for n = 0, 1, ... into a wave."""
    co, si = math.cos(angle), math.sin(angle)
    pc, ps = 1.0, 0.0
    for n in range(wave.shape[1]):
        wave[0, n], wave[1, n] = pc, ps
        pc, ps = pc * co - ps * si, pc * si + ps * co


@_inlined
def _on(c, hs, wave):
    """Value and slope of a polynomial where the wave is known."""
    value, slope = c[0], 0.0
    for q in range(hs.size):
        n, a, b = hs[q], c[1 + 2 * q], c[2 + 2 * q]
        value += a * wave[0, n] + b * wave[1, n]
        slope += n * (b * wave[0, n] - a * wave[1, n])
    return value, slope


@_inlined
def _size(c, hs):
    """Sums of |c_h| and of h^2 |c_h| over the harmonics h >= 1: neither value nor curvature swings more."""
    swing, bound = 0.0, 0.0
    for q in range(hs.size):
        size = math.hypot(c[1 + 2 * q], c[2 + 2 * q])
        swing += size
        bound += hs[q] * hs[q] * size
    return swing, bound


@compiled
def _crossing(c, hs, bound, level, rising, left, right, angle):
    """Angle in [left, right] where the polynomial, monotone there, crosses a level; Halley from a guess in a bracket.

    bound : of the curvature. An error e is at most (s^2 / 4 + H s / 6) e^3, s = bound / |slope|, after a step of
        Halley's, so the last step need not be looked at
    """
    if not left < angle < right:
        angle = 0.5 * (left + right)
    for _ in range(80):
        value, slope, bend = _at(c, hs, angle)
        value -= level
        if (value < 0.0) == rising:
            left = angle
        else:
            right = angle
        least, steep = 4e-16 * (1.0 + angle), abs(slope)
        if abs(value) <= least * steep or right - left <= least:
            break
        change = 2.0 * value * slope / (2.0 * slope * slope - value * bend)
        angle -= change
        if not left < angle < right:
            angle = 0.5 * (left + right)
        elif bound * (0.25 * bound + hs[-1] * steep / 6.0) * abs(change) ** 3 <= least * steep * steep:
            break
    return angle


@compiled
def _roots(c, hs, grid, cells, out, n):
    """Append all sign changes of a polynomial in (0, 2 pi] to out[n:], ascending; returns the new count.

    A cell of width 2 d without a root or with a monotone polynomial is recognised by Taylor's bounds about its middle,
    |f(t) - f(m) - f'(m) (t - m)| <= F d^2 / 2 with F = sum h^2 |c_h|, or with f'' (m) and H F; every other cell is
    halved. The depth is limited: at 1e-9 rad only a double root is left, which changes nothing. So is the number of
    cells: a harmonic has at most two roots, and what is no number has none.

    cells : (3 * n_cell,) to work on: values at the ends of the cells, values and slopes in their middle
    """
    bound = _size(c, hs)[1]
    if not 0.0 < bound < math.inf:
        return n
    for j in range(cells.size):
        cells[j] = c[0] * grid[0, j]
    for a in range(1, c.size, 2):
        for j in range(cells.size):
            cells[j] += c[a] * grid[a, j] + c[a + 1] * grid[a + 1, j]
    n_cell = cells.size // 3
    cell, level, positive = 0, 0, cells[n_cell - 1] >= 0.0
    half, width = 0.5 * TURN / n_cell, TURN / n_cell
    for _ in range(MOST_CELLS * (n_cell + hs[-1])):
        if cell >= n_cell << level:
            break
        bend = bound
        if level == 0:
            value, slope = cells[n_cell + cell], cells[2 * n_cell + cell]
        else:
            value, slope, bend = _at(c, hs, cell * width + half)
        free = abs(value) > half * (abs(slope) + 0.5 * half * bound)
        monotone = abs(slope) > half * bound
        if not free and not monotone:
            if level == 0:
                bend = 0.0
                for a in range(1, c.size):
                    bend += c[a] * grid[a, 3 * n_cell + cell]
            beyond = half * hs[-1] * bound
            free = abs(value) > half * (abs(slope) + half * (0.5 * abs(bend) + beyond / 6.0))
            monotone = abs(slope) > half * (abs(bend) + 0.5 * beyond)
            if not free and not monotone and level < 28:
                level, cell, width, half = level + 1, 2 * cell, half, 0.5 * half
                continue
        cell += 1
        if free:
            after = value >= 0.0
        elif level == 0:
            after = cells[cell - 1] >= 0.0
        else:
            after = _at(c, hs, cell * width)[0] >= 0.0
        if after != positive and n < out.size - 2:
            left = (cell - 1) * width
            if free:
                out[n] = left
            elif monotone:
                out[n] = _crossing(c, hs, bound, 0.0, after, left, cell * width, left + half - value / slope)
            else:
                out[n] = left + half
            n += 1
        positive = after
        while cell % 2 == 0 and level > 0:
            level, cell, half, width = level - 1, cell // 2, width, 2.0 * width
    return n


@compiled
def _edges(r, u, load, swing, contact, touches, n_contact, hs, grid, cells, wall, edges, touching):
    """Angles between which the contact keeps its state and both walls are monotone; returns the number of intervals."""
    n = n_contact
    for j in range(n):
        edges[j] = contact[j]
    wall[0] = 0.0
    for side in (-1.0, 1.0):
        for q in range(hs.size):  # how fast this wall moves
            h, a, b = hs[q], 1 + 2 * q, 2 + 2 * q
            wall[a], wall[b] = h * (u[b] + side * r * load[b]), -h * (u[a] + side * r * load[a])
        n = _roots(wall, hs, grid, cells, edges, n)
        if swing == 0.0:  # the other wall turns with it
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
        touching[j] = (now % 2 == 0) == touches
    return n


@_inlined
def _pushed(w, origin, tilt, r, j, at, touching):
    """Slider at a knot, the knot that determines it, and d w / d N there over r; at: u, u', N, N'."""
    if not touching:
        lag = r * at[3]
        return at[0], j, -at[1] / lag if abs(at[1]) < abs(lag) else 0.0  # else slips as soon as it touches
    low, high = at[0] - r * at[2], at[0] + r * at[2]
    if w < low:
        return low, j, -1.0
    if w > high:
        return high, j, 1.0
    return w, origin, tilt


@compiled
def _segments(w, r, u, load, hs, touching, n_edge, at, wall, knots, waves, ends, segments):
    """Sticks and slips of the periodic cycle; returns their number.

    A cycle maps w to a clamp of w, so one cycle, for which the ends of the intervals suffice, settles it.
    """
    for j in range(n_edge + 1):
        _wave(knots[j], waves[j])
        at[j, 0], at[j, 1] = _on(u, hs, waves[j])
        at[j, 2], at[j, 3] = _on(load, hs, waves[j])
    n, n_knot, start = np.int64(0), n_edge + 1, np.int64(0)
    w, origin, tilt = _pushed(w, start - 1, 0.0, r, start, at[0], touching[0])
    for j in range(n_edge):
        w, origin, tilt = _pushed(w, origin, tilt, r, j + 1, at[j + 1], touching[j])
    for j in range(n_edge):
        before, before_origin, before_tilt = w, origin, tilt
        w, origin, tilt = _pushed(w, origin, tilt, r, j + 1, at[j + 1], touching[j])
        if not touching[j]:
            continue
        side = 1.0 if w > before else -1.0  # of the force, should the slider have moved
        slip = j + 1 if w == before else j
        if slip == j and side * (before - at[j, 0]) + r * at[j, 2] > 0.0:
            angle = _slip(before, side * r, u, load, hs, at[j], at[j + 1], wall, knots[j], knots[j + 1])
            if angle - knots[j] >= 1e-12:
                slip, knots[n_knot] = n_knot, angle
                _wave(angle, waves[n_knot])
                n_knot += 1
        if knots[slip] > knots[j]:
            n = _append(knots, ends, segments, n, j, slip, STICK, before, before_origin, before_tilt)
        if knots[slip] < knots[j + 1]:
            n = _append(knots, ends, segments, n, slip, j + 1, side, 0.0, start - 1, 0.0)
    return n


@compiled
def _slip(w, r, u, load, hs, before, after, wall, left, right):
    """Angle in an interval, where it is 1e-12 at least, at which the wall u - r N meets the slider w."""
    width = right - left
    start, stop = before[0] - r * before[2] - w, after[0] - r * after[2] - w
    slope = (before[1] - r * before[3]) * width
    if abs(start) * width <= 1e-12 * abs(slope):
        return left
    bound = 0.0
    for a in range(u.size):
        wall[a] = u[a] - r * load[a]
        bound += hs[(a - 1) // 2] ** 2 * abs(wall[a]) if a > 0 else 0.0
    # on the parabola through both ends with the slope at the first
    root = math.sqrt(max(slope * slope - 4 * (stop - start - slope) * start, 0.0))
    guess = left - 2 * start / (slope + math.copysign(root, stop - start)) * width
    return _crossing(wall, hs, bound, w, stop > start, left, right, guess)


@_inlined
def _append(knots, ends, segments, n, start, stop, kind, w, origin, tilt):
    """Append a segment, or lengthen the last one where it continues unchanged."""
    o = n - 1
    if (
        n > 0
        and segments[o, 0] == kind
        and (segments[o, 1], ends[o, 2], knots[ends[o, 1]]) == (w, origin, knots[start])
    ):
        ends[o, 1] = stop
        return n
    ends[n, 0], ends[n, 1], ends[n, 2] = start, stop, origin
    segments[n, 0], segments[n, 1], segments[n, 2] = kind, w, tilt
    return n + 1


@_inlined
def _add_span(factor, length, before, after, table):
    """Add factor times n times the integrals of cos n t and sin n t between two waves; of 1 for n = 0."""
    table[0, 0] += factor * length
    for n in range(1, table.shape[1]):
        table[0, n] += factor * (after[1, n] - before[1, n])
        table[1, n] += factor * (before[0, n] - after[0, n])


@compiled
def _products(table, hs, out):
    """Fourier coefficients a of basis function b over the spans summed in the table: (m, m)."""
    half = 0.5 / math.pi
    out[0, 0] = half * table[0, 0]
    for q in range(hs.size):
        h, a = hs[q], 1 + 2 * q
        cosine, sine = half / h * table[0, h], half / h * table[1, h]
        out[a, 0], out[a + 1, 0], out[0, a], out[0, a + 1] = 2.0 * cosine, 2.0 * sine, cosine, sine
        for p in range(q + 1):
            g, b = hs[p], 1 + 2 * p
            more, less = half / (h + g), half / (h - g) if h > g else half
            cosine, sine = more * table[0, h + g], more * table[1, h + g]
            beat, twist = less * table[0, h - g], less * table[1, h - g] if h > g else 0.0
            out[a, b], out[a + 1, b + 1] = beat + cosine, beat - cosine
            out[a + 1, b], out[a, b + 1] = sine + twist, sine - twist
            out[b, a], out[b + 1, a + 1] = beat + cosine, beat - cosine
            out[b, a + 1], out[b + 1, a] = sine + twist, sine - twist


@compiled
def _add_short(factor, c, level, start, stop, hs, wave, force):
    """Add the Fourier coefficients of factor (c - level) over [start, stop], c a polynomial small beside its parts.

    A stiff contact touches so shortly that its force is a 1e-8 of what its spring would bear over the whole cycle
    """
    half = 0.5 * (stop - start)
    for p in range(POINTS.size):
        _wave(start + half * (1.0 + POINTS[p]), wave)
        value = factor * (_on(c, hs, wave)[0] - level) * WEIGHTS[p] * half / math.pi
        force[0] += 0.5 * value
        for q in range(hs.size):
            force[1 + 2 * q] += value * wave[0, hs[q]]
            force[2 + 2 * q] += value * wave[1, hs[q]]


@compiled
def _force(kt, mu, u, load, hs, knots, waves, ends, segments, n_segment, table, force, slope):
    """Coefficients of T, and their derivatives with respect to those of u over k_t and of N over mu.

    Integrals over what is short are differences of nearly equal numbers, and their products even more so: there the
    force is integrated by Gauss's rule.
    """
    m, by_u, by_load = u.size, slope[0], slope[1]
    whole = n_segment == 1 and segments[0, 0] == STICK and knots[ends[0, 1]] - knots[ends[0, 0]] == TURN
    n_short = 0
    if whole:  # linear, no integral, no rounding
        for a in range(m):
            force[a] = kt * u[a]
            for b in range(m):
                by_u[a, b], by_load[a, b] = 1.0 if a == b else 0.0, 0.0
    for n in range(table.shape[2]):  # in loops: in the short form numba takes a second to compile
        table[0, 0, n], table[0, 1, n], table[1, 0, n], table[1, 1, n] = 0.0, 0.0, 0.0, 0.0
    for short in (False, True):
        if whole or (short and n_short == 0):
            break
        for s in range(n_segment):
            start, stop, stick = ends[s, 0], ends[s, 1], segments[s, 0] == STICK
            length, side = knots[stop] - knots[start], 1.0 if stick else segments[s, 0]
            if (length * hs[-1] < SHORT) != short:
                n_short += 1
                continue
            _add_span(side, length, waves[start], waves[stop], table[0] if stick else table[1])
            if short:
                c, factor = (u, kt) if stick else (load, side * mu)
                _add_short(factor, c, segments[s, 1], knots[start], knots[stop], hs, waves[len(waves) - 1], force)
        _products(table[0], hs, by_u)
        _products(table[1], hs, by_load)
        if not short:
            for a in range(m):
                total = 0.0
                for b in range(m):
                    total += kt * by_u[a, b] * u[b] + mu * by_load[a, b] * load[b]
                force[a] = total
    for s in range(n_segment):
        if segments[s, 0] == STICK:
            start, stop, rows = ends[s, 0], ends[s, 1], 1 if whole else m
            length = knots[stop] - knots[start]
            pull = 0.0 if length * hs[-1] < SHORT else kt * segments[s, 1]
            span = length, waves[start], waves[stop]
            _subtract_slider(pull, span, waves, ends[s, 2], segments[s, 2], rows, hs, force, by_u, by_load)


@compiled
def _subtract_slider(pull, span, waves, origin, tilt, rows, hs, force, by_u, by_load):
    """Minus the pull k_t w of one stick, and the derivative of w through the instant that determines it."""
    length, before, after = span
    part = length / TURN
    for a in range(rows):
        if a > 0:
            h = hs[(a - 1) // 2]
            part = (after[1, h] - before[1, h] if a % 2 == 1 else before[0, h] - after[0, h]) / (h * math.pi)
        force[a] -= pull * part
        if origin < 0:
            continue
        by_u[a, 0] -= part
        by_load[a, 0] -= part * tilt
        for q in range(hs.size):
            cosine, sine = part * waves[origin, 0, hs[q]], part * waves[origin, 1, hs[q]]
            by_u[a, 1 + 2 * q] -= cosine
            by_u[a, 2 + 2 * q] -= sine
            by_load[a, 1 + 2 * q] -= tilt * cosine
            by_load[a, 2 + 2 * q] -= tilt * sine
