"""Fourier coefficients of a contact force over sticks and slips, in closed form between transitions.

Within a segment the force is in the span of the basis functions and 1, whose products are integrated exactly."""

import math

import numpy as np

from tribodyn.hbm.contact import trigonometric
from tribodyn.hbm.contact.compiled_law import stamp_with
from tribodyn.hbm.contact.trigonometric import TURN, compiled, fill_wave, inlined, values_on

STICK = 0.0  # kind of a segment; a slip has the sign of T
SHORT = 0.5  # rad of the highest harmonic, below which a force is integrated by Gauss's rule: six points leave 1e-16
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(6)


@inlined
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
            total, difference = half / (h + g), half / (h - g) if h > g else half
            cosine, sine = total * table[0, h + g], total * table[1, h + g]
            beat, twist = difference * table[0, h - g], difference * table[1, h - g] if h > g else 0.0
            out[a, b], out[a + 1, b + 1] = beat + cosine, beat - cosine
            out[a + 1, b], out[a, b + 1] = sine + twist, sine - twist
            out[b, a], out[b + 1, a + 1] = beat + cosine, beat - cosine
            out[b, a + 1], out[b + 1, a] = sine + twist, sine - twist


@compiled
def _add_short(factor, c, level, start, stop, hs, wave, force):
    """Add the Fourier coefficients of factor (c - level) over [start, stop], c a polynomial small beside its parts.

    A stiff contact touches so shortly that its force is a 1e-8 of what its spring would bear over the whole cycle"""
    half = 0.5 * (stop - start)
    for p in range(POINTS.size):
        fill_wave(start + half * (1.0 + POINTS[p]), wave)
        value = factor * (values_on(c, hs, wave)[0] - level) * WEIGHTS[p] * half / math.pi
        force[0] += 0.5 * value
        for q in range(hs.size):
            force[1 + 2 * q] += value * wave[0, hs[q]]
            force[2 + 2 * q] += value * wave[1, hs[q]]


@compiled
def integrate(kt, mu, u, load, hs, knots, waves, ends, segments, n_segment, table, force, slope):
    """Coefficients of T, and their derivatives with respect to those of u over k_t and of N over mu.

    Integrals over what is short are differences of nearly equal numbers, and their products even more so: there the
    force is integrated by Gauss's rule."""
    m, by_u, by_load = u.size, slope[0], slope[1]
    is_stuck = n_segment == 1 and segments[0, 0] == STICK and knots[ends[0, 1]] - knots[ends[0, 0]] == TURN
    n_short = 0
    if is_stuck:  # linear, no integral, no rounding
        for a in range(m):
            force[a] = kt * u[a]
            for b in range(m):
                by_u[a, b], by_load[a, b] = 1.0 if a == b else 0.0, 0.0
    for n in range(table.shape[2]):  # in loops: in the short form numba takes a second to compile
        table[0, 0, n], table[0, 1, n], table[1, 0, n], table[1, 1, n] = 0.0, 0.0, 0.0, 0.0
    for short in (False, True):
        if is_stuck or (short and n_short == 0):
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
            start, stop, rows = ends[s, 0], ends[s, 1], 1 if is_stuck else m
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


stamp_with(globals(), trigonometric)
