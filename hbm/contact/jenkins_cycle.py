"""Event-based cycle of Jenkins elements: transitions are roots of trigonometric polynomials.

In slider coordinates a tangential direction is a play with moving walls: lo = u - r N <= w <= hi = u + r N with
r = mu / k_t, and w moves only where a wall pushes it. Between two neighbours among {contact and separation: roots of N;
turning points of the walls: roots of lo' and hi'} both walls are monotone, so each such interval holds at most one
transition, the crossing of one wall with a constant. T is k_t (u - w), +-mu N or 0. T and N are continuous at every
transition, so transitions add nothing to the Jacobian but the derivative of the slider position at which a stick began.

The result does not depend on the number of time samples: it is the Fourier integral itself, to rounding. Roots are
isolated by Taylor bounds, so no number of events in one sample interval, nor a grazing one, is missed. Samples are of
second order, of first order for friction that lifts, where the sampled Jacobian does not converge at all (measured in
test_contact_located). Cost, measured from H = 1 to 15: two to three times that of 128 samples where all slip, less
where most pairs cannot. A response curve with lifting pairs took as long either way: Newton needed 15 % fewer steps.

Source  Petrov and Ewins 2003 (friction element exact between transitions); moving walls and root isolation ours."""

import math

import numba
import numpy as np

from tribodyn.hbm.contact import segment_integrals, trigonometric
from tribodyn.hbm.contact.compiled_law import stamp_with
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactCycle, ContactParameters
from tribodyn.hbm.contact.segment_integrals import STICK, integrate
from tribodyn.hbm.contact.trigonometric import (
    TURN,
    bounds,
    cell_grid,
    compiled,
    crossing,
    fill_wave,
    inlined,
    roots,
    values_on,
)
from tribodyn.hbm.harmonics import HarmonicBasis


def cycle(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool = True
) -> ContactCycle:
    """The periodic cycle of a law of the Jenkins family.

    x : (n_pair, n_component, n_coeff) [m]; memory : (n_pair, n_tangential) slider positions at the start [m]
    parameters : their numbers friction, and normal_load of a contact without the component n; none where it has none"""
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
    # of one layout, as numba compiles the kernel for each that it meets
    k, memory = np.ascontiguousarray(parameters.stiffness), np.ascontiguousarray(memory)
    mu = parameters.numbers.get("friction", np.zeros(n_pair))
    hs = np.asarray(basis.dynamic, np.int64)
    force = np.zeros_like(full)
    jac = np.zeros((n_pair, n_comp * n_coeff, n_comp * n_coeff)) if jacobian else np.zeros((0, 0, 0))
    status = np.zeros(n_pair, np.int64)
    _cycle(full, load, cell_grid(basis.dynamic), normal, k, mu, memory, hs, skip, force, jac, status)
    return ContactCycle(force[..., skip:].copy(), jac if jacobian else None, status)


@numba.njit(cache=True)
def _cycle(x, load, grid, normal, k, mu, memory, hs, skip, force, jac, status):
    """All pairs; what one pair needs is allocated once. m counts the constant, whether kept or not.

    knots, waves : angles, and cos n t and sin n t there; ends, segments : knots of start, stop and origin (-1: memory)
        of each segment; its kind, w, and d w / d N at the origin over r"""
    n_pair, n_comp, m = x.shape
    top, room = hs[-1], 4 * hs[-1] + 16  # a polynomial has at most 2 H roots
    contact, cells, wall = np.empty(room), np.empty(3 * grid.shape[1] // 4), np.zeros(m)
    touching, at = np.empty(3 * room, np.bool_), np.empty((3 * room, 4))
    knots, waves = np.empty(6 * room), np.empty((6 * room, 2, 2 * top + 1))
    ends, segments = np.empty((6 * room, 3), np.int64), np.empty((6 * room, 3))
    table, slope = np.empty((2, 2, 2 * top + 1)), np.empty((2, m, m))
    none = np.int64(-1)
    has_slope, n_coeff = jac.shape[0] > 0, m - skip
    n_tangential = n_comp - 1 if normal else n_comp
    for i in range(n_pair):
        N, swing = load[i], bounds(load[i], hs)[0]
        contact[0], n_contact = 0.0, none + 2
        if abs(N[0]) <= swing:
            n_contact = roots(N, hs, grid, cells, contact, n_contact)
        contact[n_contact] = TURN
        # of the first interval; the others alternate
        touches = N[0] > 0.0 if n_contact == 1 else cells[len(cells) // 3 - 1] >= 0.0
        status[i] = 0 if n_contact == 1 and touches else SEPARATES
        if n_contact == 1 and not touches:
            continue
        on = n_tangential * n_coeff
        kn = k[i, n_comp - 1] if normal else 0.0
        if normal:  # a spring without friction that is held where the contact is closed
            n_segment = none + 1
            for j in range(n_contact + 1):
                knots[j] = contact[j]
                fill_wave(knots[j], waves[j])
                if j > 0 and (j % 2 == 1) == touches:
                    n_segment = _append(knots, ends, segments, n_segment, j - 1, j, STICK, 0.0, none, 0.0)
            integrate(1.0, 0.0, N, N, hs, knots, waves, ends, segments, n_segment, table, force[i, n_comp - 1], slope)
            if has_slope:
                _store(slope[0, skip:, skip:], kn, jac[i, on:, on:])
        if n_tangential == 0:
            status[i] |= STICKS
        for c in range(n_tangential):
            u, kt, w = x[i, c], k[i, c], memory[i, c]
            if kt == 0.0 or kt * (abs(u[0] - w) + bounds(u, hs)[0]) <= mu[i] * (N[0] - swing):  # cannot slip
                knots[0], knots[1] = 0.0, TURN
                n_segment = _append(knots, ends, segments, none + 1, none + 1, none + 2, STICK, w, none, 0.0)
            else:
                r = mu[i] / kt
                n_edge = _edges(r, u, N, swing, contact, touches, n_contact, hs, grid, cells, wall, knots, touching)
                n_segment = _segments(w, r, u, N, hs, touching, n_edge, at, wall, knots, waves, ends, segments)
            for s in range(n_segment):
                status[i] |= STICKS if segments[s, 0] == STICK else SLIPS
            integrate(kt, mu[i], u, N, hs, knots, waves, ends, segments, n_segment, table, force[i, c], slope)
            if has_slope:
                o = c * n_coeff
                _store(slope[0, skip:, skip:], kt, jac[i, o:, o:])
                if normal:
                    _store(slope[1, skip:, skip:], mu[i] * kn, jac[i, o:, on:])


@compiled
def _store(slope, factor, jac):
    """Put factor x slope into the first block of a part of the Jacobian."""
    for a in range(slope.shape[0]):
        for b in range(slope.shape[1]):
            jac[a, b] = factor * slope[a, b]


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
        n = roots(wall, hs, grid, cells, edges, n)
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


@inlined
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

    A cycle maps w to a clamp of w, so one cycle, for which the ends of the intervals suffice, settles it."""
    for j in range(n_edge + 1):
        fill_wave(knots[j], waves[j])
        at[j, 0], at[j, 1] = values_on(u, hs, waves[j])
        at[j, 2], at[j, 3] = values_on(load, hs, waves[j])
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
                fill_wave(angle, waves[n_knot])
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
    first, last = before[0] - r * before[2] - w, after[0] - r * after[2] - w
    slope = (before[1] - r * before[3]) * width
    if abs(first) * width <= 1e-12 * abs(slope):
        return left
    bound = 0.0
    for a in range(u.size):
        wall[a] = u[a] - r * load[a]
        bound += hs[(a - 1) // 2] ** 2 * abs(wall[a]) if a > 0 else 0.0
    # on the parabola through both ends with the slope at the first
    root = math.sqrt(max(slope * slope - 4 * (last - first - slope) * first, 0.0))
    guess = left - 2 * first / (slope + math.copysign(root, last - first)) * width
    return crossing(wall, hs, bound, w, last > first, left, right, guess)


@inlined
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


stamp_with(globals(), segment_integrals, trigonometric)
