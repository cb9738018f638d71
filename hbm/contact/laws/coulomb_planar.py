"""Isotropic Coulomb friction in the contact plane, elastic tangential springs, variable normal load.

    N = max(k_n (v - gap), 0),   T_c = k_c (u_c - w_c),   |T| <= mu N,   dw = dlambda T, dlambda >= 0

The slider w creeps along the friction force, so friction opposes the slip velocity whatever the springs are. One step
in time is implicit: T = T* / (1 + lambda k) componentwise from the trial T* = k (u - w), with |T| = mu N. For
k_1 = k_2 this is the radial return; for unequal springs it is the projection in the elastic metric (not the radial one
in force space, whose slip is not parallel to friction). On a circle friction lags by half a step.

Cycles of equal springs take displacement and normal load as linear between samples and follow the slider exactly: where
contact and slip begin is located, and a slider that is dragged on a leash of length r = mu N / k is a tractrix,
    tan(theta / 2) falls by exp(-integral |du| / r),   theta between T and the motion,
so that the error is of second order in the sample spacing. Those of unequal springs step implicitly, of first order
where the path turns.
Source  Simo and Hughes 1998, chapter 3 (return mapping); Sanliturk and Ewins 1996 and Afzal et al. 2016 for k_1 = k_2;
tractrix of a varying leash ours."""

import math
from dataclasses import dataclass
from types import ModuleType, SimpleNamespace
from typing import cast

import numba
import numpy as np

from tribodyn.declarations import number
from tribodyn.hbm.contact.aft import march
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactCycle, ContactParameters
from tribodyn.hbm.harmonics import HarmonicBasis

COMPONENTS = (("t1", "t2", "n"),)
SAMPLES_ONLY = True
LINEAR_WHERE_STUCK = True
SIMPLER_LAW = "jenkins"


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    friction: float = number("", role="friction", low=0.0, usual=(0.0, 1.5))
    """Coulomb coefficient."""


def n_state(components: tuple[str, ...]) -> int:
    """The slider position in the plane [m]."""
    return 2


@numba.njit(cache=True)
def step(x, w, p, f, dfx, dfs, dsx, dss):
    """Advance one pair by one sample; writes force, memory and their derivatives, returns the status bits."""
    N = p[2] * (x[2] - p[3])
    if N <= 0.0:
        for c in range(3):
            f[c] = 0.0
        for c in range(2):
            w[c] = x[c]
            dsx[c, c] = 1.0
        return SEPARATES
    f[2] = N
    dfx[2, 2] = p[2]
    for c in range(2):
        f[c] = p[c] * (x[c] - w[c])  # trial T*
    limit = p[4] * N
    if math.hypot(f[0], f[1]) <= limit:
        for c in range(2):
            dfx[c, c] = p[c]
            dfs[c, c] = -p[c]
            dss[c, c] = 1.0
        return STICKS
    if limit == 0.0:
        for c in range(2):
            f[c] = 0.0
            w[c] = x[c]
            dsx[c, c] = 1.0
        return SLIPS
    creep = _creep(f[0], f[1], p[0], p[1], limit)
    _slip(creep, limit, w, p, f, dfx, dfs, dsx, dss)
    return SLIPS


@numba.njit(cache=True)
def _creep(T1, T2, k1, k2, limit):
    """lambda >= 0 that brings the trial force down to |T| = limit.

    Newton on 1 / |T(lambda)| - 1 / limit, which is almost linear in lambda, from the side where |T| > limit: monotone.
    """
    creep = (math.hypot(T1, T2) / limit - 1.0) / max(k1, k2)
    if k1 == k2:
        return creep
    for _ in range(50):
        d1, d2 = 1.0 / (1.0 + creep * k1), 1.0 / (1.0 + creep * k2)
        size = math.hypot(T1 * d1, T2 * d2)
        fall = (k1 * d1 * (T1 * d1) ** 2 + k2 * d2 * (T2 * d2) ** 2) / size**2  # - d ln|T| / d lambda
        change = (size / limit - 1.0) / fall
        creep += change
        if abs(change) <= 1e-15 * creep:
            break
    return creep


@numba.njit(cache=True)
def _slip(creep, limit, w, p, f, dfx, dfs, dsx, dss):
    """Turn the trial force in f into the slipping one, move the slider along it, differentiate both."""
    d = (1.0 / (1.0 + creep * p[0]), 1.0 / (1.0 + creep * p[1]))
    for c in range(2):
        f[c] *= d[c]
        w[c] += creep * f[c]
    fall = p[0] * d[0] * f[0] ** 2 + p[1] * d[1] * f[1] ** 2
    normal = -limit * p[4] * p[2] / fall  # d lambda / d v
    for c in range(2):
        dfx[c, 2] = -f[c] * p[c] * d[c] * normal
        dsx[c, 2] = f[c] * normal + creep * dfx[c, 2]
        for b in range(2):
            share = f[b] * d[b] * p[b] / fall  # d lambda / d u_b = - d lambda / d w_b
            dfx[c, b] = (p[c] * d[c] if b == c else 0.0) - f[c] * p[c] * d[c] * share
            dfs[c, b] = -dfx[c, b]
            dsx[c, b] = f[c] * share + creep * dfx[c, b]
            dss[c, b] = (1.0 if b == c else 0.0) - dsx[c, b]


def sampled_cycle(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool = True
) -> ContactCycle:
    """The periodic cycle at the samples of the basis, the slider followed exactly along the chords between them.

    x : (n_pair, 3, n_coeff) [m]; memory : (n_pair, 2) slider positions at the start [m]
    A pair that stays closed and below its limit at all samples is its springs"""
    samples, k = basis.to_time(x), parameters.stiffness
    pull = k[:, :2, None] * (samples[:, :2] - memory[..., None])
    load = k[:, 2:] * (samples[:, 2] - parameters.gap[:, None])
    limit = parameters.numbers["friction"][:, None] * load
    moving = np.flatnonzero(~((load > 0) & (np.hypot(pull[:, 0], pull[:, 1]) <= limit)).all(axis=1))
    force, status = k[..., None] * x, np.full(len(x), STICKS)
    if basis.has_static:
        force[:, :, 0] -= k * np.column_stack([memory, parameters.gap])
    spring = np.repeat(k, x.shape[2], axis=1)
    jac = spring[..., None] * np.eye(spring.shape[1]) if jacobian else None
    touching = np.concatenate([memory, memory, parameters.gap[:, None]], axis=1)  # without shear, wherever x(0) is
    law = cast(ModuleType, SimpleNamespace(step=chord))
    slipping = march(law, x[moving], parameters.subset(moving), touching[moving], basis, jacobian)
    force[moving], status[moving] = slipping.force, slipping.status
    if jac is not None:
        jac[moving] = slipping.jacobian
    return ContactCycle(force, jac, status)


@numba.njit(cache=True)
def chord(x, s, p, f, dfx, dfs, dsx, dss):
    """As `step`, from the displacement that the memory ends with, along a straight line; s = [w, displacement]."""
    k, r = p[0], 0.0
    if p[0] != p[1] or k == 0.0 or p[4] == 0.0 or x[2] <= p[3]:
        bits = step(x, s, p, f, dfx, dfs, dsx, dss)
    else:
        r = p[4] * p[2] / k
        f[2] = p[2] * (x[2] - p[3])
        dfx[2, 2] = p[2]
        bits = _dragged(x, s, k, r, p[3], f, dfx, dfs, dsx, dss)
    for c in range(3):
        s[2 + c] = x[c]
        dsx[2 + c, c] = 1.0
    return bits


@numba.njit(cache=True)
def _dragged(x, s, k, r, gap, f, dfx, dfs, dsx, dss):
    """One chord that ends in contact, the leash r (v - gap) [m]; arguments as of `chord`.

    A stretch that is longer than the leash is cut to it first, as no periodic cycle has it: a search for one does"""
    dx, dy, ax, ay = x[0] - s[2], x[1] - s[3], s[2] - s[0], s[3] - s[1]
    before, after = r * (s[4] - gap), r * (x[2] - gap)
    share = after / (after - before) if before <= 0.0 else 1.0  # of the chord, in contact
    if before <= 0.0 and share * math.hypot(dx, dy) <= after:  # touches on the way, without shear, and sticks
        bits, px, py, turns = STICKS, share * dx, share * dy, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        late, early = r * (1.0 - share) / (after - before), r * share / (after - before)
        grows_x = (share, 0.0, dx * late, 0.0, 0.0, -share, 0.0, dx * early)
        grows_y = (0.0, share, dy * late, 0.0, 0.0, 0.0, -share, dy * early)
    else:
        slips, where, cut, size = True, 0.0, 1.0, math.hypot(ax, ay)
        if before > 0.0:
            cut = before / size if size * size > (1.0 + 1e-12) * before * before else 1.0
            slips, where = _lets_go(cut * ax, cut * ay, dx, dy, before, after)
        if not slips and cut == 1.0:
            for c in range(2):
                f[c] = k * (x[c] - s[c])
                dfx[c, c], dfs[c, c], dss[c, c] = k, -k, 1.0
            return STICKS
        if slips:
            cut = cut if where > 0.0 else 1.0
            co, si, gx, gy, ex, ey, early, late = _tractrix(cut * ax, cut * ay, dx, dy, before, after, where)
            bits, px, py = SLIPS, after * co, after * si
            turns = (ex, ey, r * late, -gx, -gy, gx - ex, gy - ey, r * early)
            grows_x = (0.0, 0.0, r * co, 0.0, 0.0, 0.0, 0.0, 0.0)
            grows_y = (0.0, 0.0, r * si, 0.0, 0.0, 0.0, 0.0, 0.0)
        else:
            bits, px, py, turns = SLIPS, cut * ax + dx, cut * ay + dy, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            hx, hy = ax / size, ay / size
            xx, xy, yy = cut * hy * hy, -cut * hx * hy, cut * hx * hx
            grows_x = (1.0, 0.0, 0.0, -xx, -xy, xx - 1.0, xy, r * hx)
            grows_y = (0.0, 1.0, 0.0, -xy, -yy, xy, yy - 1.0, r * hy)
    for q in range(8):  # directions: x, y, v at the end; w and x, y, v at the beginning
        tx, ty = grows_x[q] - py * turns[q], grows_y[q] + px * turns[q]
        if q < 3:
            dfx[0, q], dfx[1, q], dsx[0, q], dsx[1, q] = k * tx, k * ty, -tx, -ty
        else:
            dfs[0, q - 3], dfs[1, q - 3], dss[0, q - 3], dss[1, q - 3] = k * tx, k * ty, -tx, -ty
    f[0], f[1], s[0], s[1] = k * px, k * py, x[0] - px, x[1] - py
    dsx[0, 0], dsx[1, 1] = dsx[0, 0] + 1.0, dsx[1, 1] + 1.0
    return bits


@numba.njit(cache=True)
def _lets_go(ax, ay, dx, dy, before, after):
    """Whether a chord slips, and the share of it after which: stretch a + s d longer than before + s (after - before).

    Once it slips it does so to the end, for the stretch only turns towards the motion"""
    fall, least = before - after, 1e-12 * before * before
    squared, rises = dx * dx + dy * dy - fall * fall, ax * dx + ay * dy + before * fall
    excess = ax * ax + ay * ay - before * before
    if excess > least or (excess >= -least and rises > 0.0):
        return True, 0.0
    within = max(-excess, 0.0)
    root = rises * rises + squared * within
    if root < 0.0 or (squared <= 0.0 and rises <= 0.0):
        return False, 1.0
    where = within / (rises + math.sqrt(root)) if rises > 0.0 else (math.sqrt(root) - rises) / squared
    return where < 1.0, min(where, 1.0)


@numba.njit(cache=True)
def _tractrix(ax, ay, dx, dy, before, after, where):
    """Direction of the stretch at the end of a chord that slips from the share `where` on, or from where it touches.

    (ax, ay), (dx, dy) : stretch at the beginning and motion; leash from before to after
    Returns its cosine and sine, and six derivatives of its angle: by that stretch, by the motion, by the leash"""
    far = math.hypot(dx, dy)
    if before <= 0.0:
        nx, ny = dx / far, dy / far
        return nx, ny, 0.0, 0.0, -ny / far, nx / far, 0.0, 0.0
    rise = after - before
    hx, hy, lash, share = ax + where * dx, ay + where * dy, before + where * rise, 1.0 - where
    size = math.hypot(hx, hy)
    hx, hy = hx / size, hy / size
    nx, ny, rate, by_lash, by_after, drawn = hx, hy, 0.0, 0.0, 0.0, 0.0
    if far > 0.0:
        nx, ny = dx / far, dy / far
        z = (after - lash) / lash
        if abs(z) > 1e-4:
            mean = math.log1p(z) / z
            bend = (1.0 / (1.0 + z) - mean) / z
        else:
            mean, bend = 1.0 - z / 2 + z * z / 3, -0.5 + 2 * z / 3 - 0.75 * z * z
        rate, drawn = mean / lash, share * far * mean / lash  # drawn : motion over the leash, integrated
        by_after = share * far * bend / (lash * lash)
        by_lash = -drawn / lash - (1.0 + z) * by_after
    cosine, sine, decay = nx * hx + ny * hy, nx * hy - ny * hx, math.exp(-drawn)
    low, high = decay * decay * (1.0 - cosine), 1.0 + cosine
    co, si, keeps = cosine, sine, 1.0
    if low + high > 0.0:
        co, si, keeps = (high - low) / (high + low), 2 * decay * sine / (high + low), 2 * decay / (high + low)
    late = 0.0  # derivative by `where`, over how fast the stretch outgrows the leash there
    if where > 0.0:
        late = keeps * (hx * dy - hy * dx) / size + si * (rate * far - by_lash * rise)
        late /= hx * dx + hy * dy - rise
    gx, gy, lash_too = -keeps * hy / size - late * hx, keeps * hx / size - late * hy, late - si * by_lash
    ex, ey = where * gx - si * rate * share * nx, where * gy - si * rate * share * ny
    if far > 0.0:
        ex, ey = ex - (1.0 - keeps) * ny / far, ey + (1.0 - keeps) * nx / far
    return co * nx - si * ny, co * ny + si * nx, gx, gy, ex, ey, share * lash_too, where * lash_too - si * by_after
