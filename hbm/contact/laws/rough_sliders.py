"""Rough contact whose asperities have one stick-slip slider each: the published model of the Brake-Reuss beam.

As `rough`, but an asperity of contact radius a does not slip in part: over a step its friction force grows by
8 G* a du, with 1 / G* = (2 - nu_1) / G_1 + (2 - nu_2) / G_2, until Coulomb's limit of its own normal force. That is the
initial tangent of Cattaneo and Mindlin, kept up to full slip: at small amplitudes the asperities that `rough` lets slip
at their rims stick, and only those that are hardly pressed lose energy.
The asperities stand at HEIGHTS gaps, equidistant over the table, weighted by the trapezoidal rule. As a grows and falls
under a varying normal force, the increments of a stuck asperity do not add up to zero over a cycle: as in the source
two cycles are marched from the start of the load path, and the second counts.
Source  Porter and Brake, MSSP 192 (2023) 110210, its tangent model (TAN); the normal contact as in `rough`
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numba
import numpy as np

from tribodyn.hbm.contact.asperity import Asperity, asperity, tangential_ratio
from tribodyn.hbm.contact.bed_cycle import deepest_of
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactCycle, ContactParameters
from tribodyn.hbm.contact.laws import rough
from tribodyn.hbm.harmonics import HarmonicBasis

COMPONENTS = (("t1", "t2", "n"), ("t1", "n"), ("t2", "n"))
OWN_STIFFNESS = True  # its springs follow from its own numbers
TABLE = ("gap in m", "asperities per m2 and per m of gap, or per m2 where there is one row")
HEIGHTS = 101  # at which asperities stand
ROWS = 128  # depths beyond yield at which radius and plastic depth are tabulated, equidistant in their root
TURNS = 2  # cycles marched, the last of which counts
# places in a packed row: area; E*, 8 G*, onset, top, root of R, then the table and the asperities
AREA, CURVE = 5, 13
PRESSED = CURVE + 5 + 4 * (ROWS + 1)


class Parameters(rough.Parameters):
    """The law's own numbers."""


def tabulated(parameters: ContactParameters) -> np.ndarray:
    """(n_pair, ...) what every packed row ends with: material, table of asperities beyond yield, gaps and counts."""
    rough.tabulated(parameters.taken(np.arange(1)))  # refuses what is no table
    assert parameters.table is not None
    given, n = np.ascontiguousarray(parameters.table, float), parameters.numbers
    own = np.stack([n[name] for name in ("young", "poisson", "radius", "yield_stress", "tangent_modulus")], axis=1)
    top = np.where(n["deepest"] > 0, n["deepest"], given[:, 0].max())
    return np.stack(
        [_tail(asperity(tuple(one.tolist())), given.tobytes(), float(end)) for one, end in zip(own, top, strict=True)]
    )


@lru_cache(maxsize=32)
def _tail(one: Asperity, flat: bytes, top: float) -> np.ndarray:
    table = np.frombuffer(flat).reshape(-1, 2)
    gap, count = np.full(HEIGHTS, table[0, 0]), np.zeros(HEIGHTS)
    count[0] = table[0, 1]
    if len(table) > 1:
        gap = np.linspace(table[0, 0], table[-1, 0], HEIGHTS)
        count = np.interp(gap, *table.T) * (gap[1] - gap[0])
        count[[0, -1]] /= 2
    onset = min(one.onset, top)
    row = np.arange(ROWS + 1)

    def curve(at: np.ndarray) -> np.ndarray:
        return np.array(one.flattened(onset + (top - onset) * (at / ROWS) ** 2 + 1e-9 * onset))

    low, high = np.maximum(row - 0.01, 0.0), row + 0.01
    rows = np.concatenate([curve(row), (curve(high) - curve(low)) / (high - low)]).T
    head = [one.E, 4 * one.E * float(tangential_ratio(np.array(one.nu))) / 2, onset, top, math.sqrt(one.R)]
    return np.concatenate([head, rows.ravel(), gap, count])


def springs(parameters: ContactParameters) -> np.ndarray:
    """(n_pair, n_component) tangents [N/m] of the contact stuck at its nominal pressure."""
    return rough.springs(replace(parameters, tail=rough.tabulated(parameters)))


def n_state(components: tuple[str, ...]) -> int:
    """The deepest approach [m], the displacement of the step before [m], the force of each asperity [N]."""
    return 1 + (1 + HEIGHTS) * (len(components) - 1)


def rested(x: np.ndarray, parameters: ContactParameters) -> np.ndarray:
    """Memory (n_pair, n_state) of a contact without shear at the displacement x (n_pair, n_component) [m]."""
    deepest = np.maximum(x[:, -1:] - parameters.gap[:, None], 0.0)
    return np.concatenate([deepest, x[:, :-1], np.zeros((len(x), HEIGHTS * (x.shape[1] - 1)))], axis=1)


@numba.njit(cache=True)
def flattened(p, d_m, out):
    """Plastic depth [m] and root of the radius [m^0.5] below a deepest approach d_m of one asperity, and slopes."""
    onset, top = p[CURVE + 2], p[CURVE + 3]
    if d_m <= onset or top <= onset:
        out[0], out[1], out[2], out[3] = 0.0, p[CURVE + 4], 0.0, 0.0
        return
    at = ROWS * math.sqrt((d_m - onset) / (top - onset))
    rate = 0.5 * at / (d_m - onset)
    row = min(int(at), ROWS - 1)
    t, a = at - row, CURVE + 5 + 4 * row
    if t > 1.0:  # straight on beyond the table
        for c in range(2):
            out[c], out[2 + c] = p[a + 4 + c] + (t - 1.0) * p[a + 6 + c], rate * p[a + 6 + c]
        return
    for c in range(2):
        y0, y1, m0, m1 = p[a + c], p[a + 4 + c], p[a + 2 + c], p[a + 6 + c]
        out[c] = y0 + t * (m0 + t * (3 * (y1 - y0) - 2 * m0 - m1 + t * (2 * (y0 - y1) + m0 + m1)))
        out[2 + c] = rate * (m0 + t * (2 * (3 * (y1 - y0) - 2 * m0 - m1) + 3 * t * (2 * (y0 - y1) + m0 + m1)))


@numba.njit(cache=True)
def pressed(p, d, flat, out):
    """N [N], 8 G* a [N/m] and their slopes by d and by the deepest approach, of one asperity with d = u - z."""
    d -= flat[0]
    for c in range(6):
        out[c] = 0.0
    if d <= 0.0:
        return
    E, G, root, s = p[CURVE], p[CURVE + 1], flat[1], math.sqrt(d)
    out[0], out[1] = 4 / 3 * E * root * d * s, G * root * s
    out[2], out[3] = 2 * E * root * s, 0.5 * G * root / s
    out[4], out[5] = 4 / 3 * E * flat[3] * d * s - out[2] * flat[2], G * flat[3] * s - out[3] * flat[2]


@numba.njit(cache=True)
def step(x, s, p, f, dfx, dfs, dsx, dss):
    """Advance one pair by one sample; writes force, memory and their derivatives, returns the status bits."""
    n = x.size - 1
    flat, own = np.empty(4), np.empty(6)
    approach, mu, bits = x[n] - p[3], p[rough.FRICTION], 0
    grows = approach > s[0]
    if grows:
        s[0] = approach
        dsx[0, n] = 1.0
    else:
        dss[0, 0] = 1.0
    for c in range(n + 1):
        f[c] = 0.0
    for q in range(HEIGHTS):
        gap, count = p[PRESSED + q], p[PRESSED + HEIGHTS + q] * p[AREA]
        flattened(p, s[0] - gap, flat)
        pressed(p, approach - gap, flat, own)
        f[n] += count * own[0]
        dfx[n, n] += count * (own[2] + (own[4] if grows else 0.0))
        if not grows:
            dfs[n, 0] += count * own[4]
        for c in range(n):
            r = 1 + n + c * HEIGHTS + q
            moved = x[c] - s[1 + c]
            T = s[r] + own[1] * moved
            by_u, by_n, by_m, kept = own[1], own[3] * moved, own[5] * moved, 1.0
            if abs(T) > mu * own[0] or own[0] == 0.0:
                side = mu if T > 0.0 else -mu
                T, by_u, by_n, by_m, kept = side * own[0], 0.0, side * own[2], side * own[4], 0.0
                bits |= SLIPS if own[0] > 0.0 else 0
            else:
                bits |= STICKS
            dsx[r, c], dsx[r, n] = by_u, by_n + (by_m if grows else 0.0)
            dss[r, r], dss[r, 1 + c] = kept, -by_u
            if not grows:
                dss[r, 0] = by_m
            s[r] = T
            f[c] += count * T
            dfx[c, c] += count * by_u
            dfx[c, n] += count * dsx[r, n]
            dfs[c, r], dfs[c, 0] = count * kept, dfs[c, 0] + count * dss[r, 0]
            dfs[c, 1 + c] -= count * by_u
    for c in range(n):
        s[1 + c] = x[c]
        dsx[1 + c, c] = 1.0
    return bits if f[n] > 0.0 else SEPARATES


def cycle(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool = True
) -> ContactCycle:
    """The second cycle from the start of the load path, at the samples of the basis."""
    force, slope, status = _cycle(x, parameters, memory, basis, jacobian)
    return ContactCycle(basis.from_time(force), slope, status)


def history(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis
) -> tuple[np.ndarray, np.ndarray]:
    """Displacement [m] and force [N] of it, both (n_pair, n_component, n_samples)."""
    return basis.to_time(x), _cycle(x, parameters, memory, basis, False)[0]


def _cycle(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
    n_pair, n_comp, n_coeff = x.shape
    peak, angle = deepest_of(x[:, -1], basis, False)
    peak = peak - parameters.gap
    grows = peak > memory[:, 0]
    samples, status = basis.to_time(x), np.zeros(n_pair, np.int64)
    force = np.zeros_like(samples)
    slope = np.zeros((n_pair if jacobian else 0, n_comp * n_coeff, n_comp * n_coeff))
    at_peak = basis.functions(angle) * grows[:, None]
    deepest = np.where(grows, peak, memory[:, 0])
    _march(
        samples, parameters.packed(), memory, deepest, at_peak, basis.synthesis, basis.analysis, force, slope, status
    )
    return force, slope if jacobian else None, status


@numba.njit(cache=True)
def _march(x, p, memory, deepest, at_peak, phi, weight, force, jac, status):
    """The cycles of all pairs.

    Asperities that stick all through are one spring; by_u, by_v (n_samples, n_coeff) are derivatives of the force at
    the samples by the coefficients of the same direction, and of the normal one
    """
    n_pair, n_comp, n_time = x.shape
    n, m, want = n_comp - 1, phi.shape[1], jac.shape[0] > 0
    flat = np.empty(4)
    own = np.empty((n_time, 6))
    stuck = np.empty((n, n_time, 3))  # 8 G* a and its two slopes, of what sticks
    T = np.empty((TURNS, n_time))
    slips = np.empty((TURNS, n_time), np.bool_)
    by_u, by_v, by_n = np.empty((n, n_time, m)), np.empty((n, n_time, m)), np.empty((n_time, m))
    du, dv = np.empty(m), np.empty(m)
    for i in range(n_pair):
        row, mu = p[i], p[i, rough.FRICTION]
        stuck[:], by_u[:], by_v[:], by_n[:] = 0.0, 0.0, 0.0, 0.0
        held = np.zeros(n)  # force of what sticks, before the first cycle
        bits, touched, opened = 0, False, False
        for q in range(HEIGHTS):
            gap, count = row[PRESSED + q], row[PRESSED + HEIGHTS + q] * row[AREA]
            if count == 0.0 or deepest[i] - gap <= 0.0:
                continue
            flattened(row, deepest[i] - gap, flat)
            for j in range(n_time):
                pressed(row, x[i, n, j] - row[3] - gap, flat, own[j])
                force[i, n, j] += count * own[j, 0]
                if want:
                    for a in range(m):
                        by_n[j, a] += count * (own[j, 2] * phi[j, a] + own[j, 4] * at_peak[i, a])
            for c in range(n):
                start, before = memory[i, 1 + n + c * HEIGHTS + q], memory[i, 1 + c]
                t, any_slip = start, False
                for turn in range(TURNS):
                    for j in range(n_time):
                        t += own[j, 1] * (x[i, c, j] - before)
                        before, limit = x[i, c, j], mu * own[j, 0]
                        slips[turn, j] = abs(t) > limit or own[j, 0] == 0.0
                        if slips[turn, j]:
                            t, any_slip = (limit if t > 0.0 else -limit), True
                            if own[j, 0] > 0.0 and turn == TURNS - 1:
                                bits |= SLIPS
                        elif turn == TURNS - 1:
                            bits |= STICKS
                        T[turn, j] = t
                if not any_slip:
                    held[c] += count * start
                    for j in range(n_time):
                        stuck[c, j, 0] += count * own[j, 1]
                        stuck[c, j, 1] += count * own[j, 3]
                        stuck[c, j, 2] += count * own[j, 5]
                    continue
                for j in range(n_time):
                    force[i, c, j] += count * T[TURNS - 1, j]
                if want:
                    _slopes(
                        x[i, c], memory[i, 1 + c], own, slips, T, mu, phi, at_peak[i], count, du, dv, by_u[c], by_v[c]
                    )
        for c in range(n):
            _add_stuck(
                x[i, c], memory[i, 1 + c], held[c], stuck[c], phi, at_peak[i], force[i, c], by_u[c], by_v[c], du, dv
            )
        for j in range(n_time):
            touched, opened = touched or force[i, n, j] > 0.0, opened or force[i, n, j] <= 0.0
        status[i] = (bits if touched else 0) | (SEPARATES if opened else 0)
        if want:
            for j in range(n_time):
                for a in range(m):
                    for b in range(m):
                        for c in range(n):
                            jac[i, c * m + a, c * m + b] += weight[j, a] * by_u[c, j, b]
                            jac[i, c * m + a, n * m + b] += weight[j, a] * by_v[c, j, b]
                        jac[i, n * m + a, n * m + b] += weight[j, a] * by_n[j, b]


@numba.njit(cache=True)
def _slopes(u, first, own, slips, T, mu, phi, at_peak, count, du, dv, by_u, by_v):
    """Add the derivatives of one asperity that slips, with its force T (TURNS, n_time)."""
    n_time, m = phi.shape
    du[:], dv[:] = 0.0, 0.0
    for turn in range(slips.shape[0]):
        for j in range(n_time):
            k = j - 1 if j else n_time - 1
            moved = u[j] - (first if turn == 0 and j == 0 else u[k])
            side = mu if T[turn, j] > 0.0 else -mu
            for a in range(m):
                if slips[turn, j]:
                    du[a], dv[a] = 0.0, side * (own[j, 2] * phi[j, a] + own[j, 4] * at_peak[a])
                else:
                    du[a] += own[j, 1] * (phi[j, a] - (0.0 if turn == 0 and j == 0 else phi[k, a]))
                    dv[a] += moved * (own[j, 3] * phi[j, a] + own[j, 5] * at_peak[a])
                if turn == slips.shape[0] - 1:
                    by_u[j, a] += count * du[a]
                    by_v[j, a] += count * dv[a]


@numba.njit(cache=True)
def _add_stuck(u, first, held, stuck, phi, at_peak, force, by_u, by_v, du, dv):
    """Add the force of the asperities that stick all through, and its derivatives."""
    n_time, m = phi.shape
    du[:], dv[:] = 0.0, 0.0
    t = held
    for turn in range(TURNS):
        for j in range(n_time):
            k = j - 1 if j else n_time - 1
            begins = turn == 0 and j == 0
            moved = u[j] - (first if begins else u[k])
            t += stuck[j, 0] * moved
            for a in range(m):
                du[a] += stuck[j, 0] * (phi[j, a] - (0.0 if begins else phi[k, a]))
                dv[a] += moved * (stuck[j, 1] * phi[j, a] + stuck[j, 2] * at_peak[a])
                if turn == TURNS - 1:
                    by_u[j, a] += du[a]
                    by_v[j, a] += dv[a]
            if turn == TURNS - 1:
                force[j] += t
