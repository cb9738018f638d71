"""Trigonometric polynomials: values, bounds and all roots over a period, for compiled kernels.

A polynomial c has the coefficients [c_0, a_1, b_1, ...] of the harmonics hs; the constant is always there. A wave is
cos n t and sin n t for n = 0, 1, ... at one angle."""

import functools
import math

import numba
import numpy as np

from tribodyn.hbm.harmonics import HarmonicBasis

TURN = 2 * math.pi
CELLS_PER_HARMONIC = 8  # of the grid on which roots are isolated: a polynomial of degree H has at most 2 H roots
MOST_CELLS = 256  # examined for each cell of the grid: a double root takes some hundred

# no array is made within, so none is counted; where a division by zero would be, another branch is taken
compiled = numba.njit(cache=True, _nrt=False, error_model="numpy")
inlined = numba.njit(cache=True, _nrt=False, error_model="numpy", forceinline=True)


@functools.cache
def cell_grid(harmonics: tuple[int, ...]) -> np.ndarray:
    """(n_coeff, 4 * n_cell) values at the ends of equal cells; values, slopes and curvatures in their middle."""
    basis = HarmonicBasis((0, *harmonics), 2 * harmonics[-1] + 1)
    right = TURN * np.arange(1, CELLS_PER_HARMONIC * harmonics[-1] + 1) / (CELLS_PER_HARMONIC * harmonics[-1])
    middle, end = basis.functions(right - 0.5 * right[0]), basis.functions(right)
    slope = basis.rate.T  # coefficients of x' = c @ R, so functions of x' = functions @ R^T
    return np.concatenate([end, middle, middle @ slope, middle @ slope @ slope]).T.copy()


@inlined
def values_at(c, hs, angle):
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


@inlined
def fill_wave(angle, wave):
    """Put cos n t and sin n t for n = 0, 1, ... into a wave."""
    co, si = math.cos(angle), math.sin(angle)
    pc, ps = 1.0, 0.0
    for n in range(wave.shape[1]):
        wave[0, n], wave[1, n] = pc, ps
        pc, ps = pc * co - ps * si, pc * si + ps * co


@inlined
def values_on(c, hs, wave):
    """Value and slope of a polynomial where the wave is known."""
    value, slope = c[0], 0.0
    for q in range(hs.size):
        n, a, b = hs[q], c[1 + 2 * q], c[2 + 2 * q]
        value += a * wave[0, n] + b * wave[1, n]
        slope += n * (b * wave[0, n] - a * wave[1, n])
    return value, slope


@inlined
def bounds(c, hs):
    """Sums of |c_h| and of h^2 |c_h| over the harmonics h >= 1: neither value nor curvature swings more."""
    swing, bound = 0.0, 0.0
    for q in range(hs.size):
        size = math.hypot(c[1 + 2 * q], c[2 + 2 * q])
        swing += size
        bound += hs[q] * hs[q] * size
    return swing, bound


@compiled
def crossing(c, hs, bound, level, rising, start, stop, angle):
    """Angle in [left, right] where the polynomial, monotone there, crosses a level; Halley from a guess in a bracket.

    bound : of the curvature. An error e is at most (s^2 / 4 + H s / 6) e^3, s = bound / |slope|, after a step of
        Halley's, so the last step need not be looked at"""
    if not start < angle < stop:
        angle = 0.5 * (start + stop)
    for _ in range(80):
        value, slope, bend = values_at(c, hs, angle)
        value -= level
        if (value < 0.0) == rising:
            start = angle
        else:
            stop = angle
        least, steep = 4e-16 * (1.0 + angle), abs(slope)
        if abs(value) <= least * steep or stop - start <= least:
            break
        change = 2.0 * value * slope / (2.0 * slope * slope - value * bend)
        angle -= change
        if not start < angle < stop:
            angle = 0.5 * (start + stop)
        elif bound * (0.25 * bound + hs[-1] * steep / 6.0) * abs(change) ** 3 <= least * steep * steep:
            break
    return angle


@compiled
def roots(c, hs, grid, cells, out, n):
    """Append all sign changes of a polynomial in (0, 2 pi] to out[n:], ascending; returns the new count.

    A cell of width 2 d without a root or with a monotone polynomial is recognised by Taylor's bounds about its middle,
    |f(t) - f(m) - f'(m) (t - m)| <= F d^2 / 2 with F = sum h^2 |c_h|, or with f'' (m) and H F; every other cell is
    halved. The depth is limited: at 1e-9 rad only a double root is left, which changes nothing. So is the number of
    cells: a harmonic has at most two roots, and what is no number has none.

    cells : (3 * n_cell,) to work on: values at the ends of the cells, values and slopes in their middle"""
    bound = bounds(c, hs)[1]
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
            value, slope, bend = values_at(c, hs, cell * width + half)
        free = abs(value) > half * (abs(slope) + 0.5 * half * bound)
        monotone = abs(slope) > half * bound
        if not free and not monotone:
            if level == 0:
                bend = 0.0
                for a in range(1, c.size):
                    bend += c[a] * grid[a, 3 * n_cell + cell]
            remainder = half * hs[-1] * bound
            free = abs(value) > half * (abs(slope) + half * (0.5 * abs(bend) + remainder / 6.0))
            monotone = abs(slope) > half * (abs(bend) + 0.5 * remainder)
            if not free and not monotone and level < 28:
                level, cell, width, half = level + 1, 2 * cell, half, 0.5 * half
                continue
        cell += 1
        if free:
            after = value >= 0.0
        elif level == 0:
            after = cells[cell - 1] >= 0.0
        else:
            after = values_at(c, hs, cell * width)[0] >= 0.0
        if after != positive and n < out.size - 2:
            start = (cell - 1) * width
            if free:
                out[n] = start
            elif monotone:
                out[n] = crossing(c, hs, bound, 0.0, after, start, cell * width, start + half - value / slope)
            else:
                out[n] = start + half
            n += 1
        positive = after
        while cell % 2 == 0 and level > 0:
            level, cell, half, width = level - 1, cell // 2, width, 2.0 * width
    return n
