"""The periodic cycle of planar sliders between equal springs, at its samples, with its derivative.

Displacement and normal load are linear between samples and the slider is followed exactly along such a chord, see
`hbm.contact.laws.coulomb_planar`. Its state is [w, displacement at the sample before]. Of the derivatives only the two
rows of the slider are carried from sample to sample; one product with the weights of the basis ends it."""

import math

import numba
import numpy as np

from tribodyn.hbm.contact import aft, trigonometric
from tribodyn.hbm.contact.compiled_law import pointer, stamp_with
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactCycle, ContactParameters
from tribodyn.hbm.contact.trigonometric import compiled
from tribodyn.hbm.harmonics import HarmonicBasis


def cycle(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool = True
) -> ContactCycle:
    """The periodic cycle of pairs with k_1 = k_2 > 0 and friction > 0.

    x : (n_pair, 3, n_coeff) [m]; memory : (n_pair, 2) slider positions at the start [m], where the pair touches without
        shear, wherever x(0) is
    Raises  CycleNotPeriodic"""
    samples, phi = basis.to_time(x), basis.synthesis if jacobian else basis.synthesis[:, :0]
    start = np.concatenate([memory, memory, parameters.gap[:, None]], axis=1)
    force, status = np.zeros_like(samples), np.zeros(len(x), np.int64)
    jac = np.zeros((len(x), 3 * phi.shape[1], 3 * phi.shape[1]))
    rows, columns = np.ascontiguousarray(basis.analysis.T), np.ascontiguousarray(phi)
    lost = _cycles(pointer(chord), samples, parameters.packed(), start, columns, rows, force, jac, status)
    if lost >= 0:
        raise aft.CycleNotPeriodic(f"contact pair {lost} has no periodic cycle")
    return ContactCycle(basis.from_time(force), jac if jacobian else None, status)


@numba.njit(cache=True)
def _cycles(chord, x, p, memory, phi, rows, force, jac, status):
    """The periodic cycle of every pair; arguments and answer as of `hbm.contact.aft._cycles`."""
    n_time, n_coeff = x.shape[2], phi.shape[1]
    m = 3 * n_coeff
    w = m + 2
    slope, plane = np.empty((n_time, 2 * w + n_coeff)), np.empty((2, 2))
    none, unread = np.empty((0, 0)), np.empty((2, 0))
    work = np.empty((2, 3)), np.empty((3, 3)), np.empty((3, 5))
    for i in range(len(x)):
        if _sticks(x[i], p[i], memory[i], force[i]):
            status[i] = STICKS
            for a in range(m):
                jac[i, a, a] = p[i, a // n_coeff]
            continue
        ds = np.zeros((5, m))
        slider = ds[:2]
        for is_thorough in (False, True):
            s, carried = memory[i].copy(), aft.unit(2, m)
            if is_thorough:
                marched = aft.settle(chord, x[i], p[i], phi, s, ds)
            else:
                marched = _settle(x[i], p[i], phi, s, unread, none, plane, work)
            if marched < 0:
                continue
            status[i] = _turn(x[i], p[i], phi, n_coeff, s, True, carried if m > 0 else unread, slope, force[i], work)
            is_known = m == 0 or (is_thorough and marched == 0)
            if is_known or aft.undrifted(carried, carried, slider) > aft.LEAST_CONTRACTION:
                break
            if marched > 0:  # depends on its path
                s[:], slider[:] = memory[i], 0.0
                for turn in range(marched):
                    _turn(x[i], p[i], phi, n_coeff, s, turn > 0, slider, none, none, work)
                break
        if marched < 0:
            return i
        product = rows @ slope
        for a in range(n_coeff):
            for c in range(2):
                for b in range(m):
                    part = product[a, c * w + m] * slider[0, b] + product[a, c * w + m + 1] * slider[1, b]
                    jac[i, c * n_coeff + a, b] = product[a, c * w + b] + part
            for b in range(n_coeff):
                jac[i, 2 * n_coeff + a, 2 * n_coeff + b] = product[a, 2 * w + b]
    return -1


@compiled
def _sticks(x, p, s, force):
    """Whether a pair stays closed and below its limit at all samples; its force (3, n_time) if so."""
    for j in range(x.shape[1]):
        force[2, j] = p[2] * (x[2, j] - p[3])
        for c in range(2):
            force[c, j] = p[0] * (x[c, j] - s[c])
        limit = p[4] * force[2, j]
        if not (force[2, j] > 0.0 and force[0, j] ** 2 + force[1, j] ** 2 <= limit * limit):
            return False
    return True


@compiled
def _settle(x, p, phi, s, unread, none, plane, work):
    """The state s of one pair at the start of its periodic cycle, from that at the start of the load path.

    A cycle never widens the distance of two sliders: one that comes back to its start and contracts is the only one, so
    that Newton's step for it may begin after the first. Others are left to `hbm.contact.aft.settle`.
    Returns the cycles marched, 0 where Newton's step led to it, -1 where neither does"""
    size = np.finfo(np.float64).tiny
    for j in range(x.shape[1]):
        size = max(size, abs(x[0, j]), abs(x[1, j]))
    _turn(x, p, phi, 0, s, False, unread, none, none, work)
    for count in range(aft.NEWTON_CYCLES):
        a, b = s[0], s[1]
        plane[0, 0], plane[0, 1], plane[1, 0], plane[1, 1] = 1.0, 0.0, 0.0, 1.0
        _turn(x, p, phi, 0, s, True, plane, none, none, work)
        da, db = s[0] - a, s[1] - b
        if count == 0 and max(abs(da), abs(db)) <= aft.PERIODIC_DRIFT * size:
            return 1
        xx, yy = 1.0 - plane[0, 0], 1.0 - plane[1, 1]
        area = xx * yy - plane[0, 1] * plane[1, 0]
        if not area > aft.POLISH_DRIFT * (xx * xx + yy * yy + plane[0, 1] ** 2 + plane[1, 0] ** 2):
            break
        da, db = (yy * da + plane[0, 1] * db) / area, (plane[1, 0] * da + xx * db) / area
        s[0], s[1] = a + da, b + db
        if da * da + db * db <= aft.PERIODIC_DRIFT * size * size:  # it leaves its square
            return 0
    return -1


@compiled
def _turn(x, p, phi, n_coeff, s, follows, ds, slope, force, work):
    """One cycle of one pair: s and ds, the derivative of its slider, to their values after it. Returns status bits.

    n_coeff : coefficients of x with which the first 3 n_coeff columns of ds (2, n) go; without columns it does not need
    follows : whether the first step begins at the last sample, and not where the load path does
    slope : (n_time, 2 n + n_coeff) derivatives of both tangential forces, and of the normal one by the coefficients of
        the normal displacement; force : (3, n_time); both filled where they have rows"""
    points, dfx, dfs = work[0], work[1], work[2]
    n_time, n, bits, before, k = x.shape[1], ds.shape[1], 0, x.shape[1] - 1, p[0]
    for j in range(n_time):
        for c in range(3):
            points[0, c] = x[c, j]
        state = _advance(points[0], s, p, points[1], dfx, dfs, n > 0)
        bits |= STICKS if state == 0 else state
        for c in range(len(force)):
            force[c, j] = points[1, c]
        if state > 0 and n > 0:
            for b in range(n):
                first, second = ds[0, b], ds[1, b]
                ds[0, b] = -(dfs[0, 0] * first + dfs[0, 1] * second) / k
                ds[1, b] = -(dfs[1, 0] * first + dfs[1, 1] * second) / k
            for c in range(2):  # w = u - T / k
                for d in range(3 if n_coeff > 0 else 0):
                    late, early = -dfx[c, d] / k, -dfs[c, 2 + d] / k if follows or j > 0 else 0.0
                    late += 1.0 if c == d else 0.0
                    for b in range(n_coeff):
                        ds[c, d * n_coeff + b] += late * phi[j, b] + early * phi[before, b]
        before = j
        if len(slope) > 0:
            for c in range(2):
                for b in range(n):
                    slope[j, c * n + b] = -k * ds[c, b] if state != SEPARATES else 0.0
                for b in range(n_coeff if state != SEPARATES else 0):
                    slope[j, c * n + c * n_coeff + b] += k * phi[j, b]
            for b in range(n_coeff):
                slope[j, 2 * n + b] = p[2] * phi[j, b] if state != SEPARATES else 0.0
    return bits


@numba.njit(cache=True)
def chord(x, s, p, f, dfx, dfs, dsx, dss):
    """As the `step` of a law, from the displacement that the memory ends with; s = [w, displacement]."""
    state = _advance(x, s, p, f, dfx, dfs, True)
    dfx[2, 2] = p[2] if state != SEPARATES else 0.0
    for c in range(2):
        if state == 0:
            dfx[c, c], dfs[c, c] = p[0], -p[0]
        dsx[c], dss[c] = -dfx[c] / p[0], -dfs[c] / p[0]  # w = u - T / k
        dsx[c, c] += 1.0
    for c in range(3):
        dsx[2 + c, c] = 1.0
    return STICKS if state == 0 else state


@compiled
def _advance(x, s, p, f, dfx, dfs, with_slopes):
    """One chord: the force, and where wanted its derivatives by x and s.

    Returns 0 where the slider stays, whose derivatives are not filled, else the status"""
    k, state = p[0], SEPARATES
    if x[2] > p[3]:
        f[2] = p[2] * (x[2] - p[3])
        state = _dragged(x, s, k, p[4] * p[2] / k, p[3], f, dfx, dfs, with_slopes)
    else:
        f[0], f[1], f[2], s[0], s[1] = 0.0, 0.0, 0.0, x[0], x[1]
        for c in range(2 if with_slopes else 0):
            for q in range(3):
                dfx[c, q] = 0.0
            for q in range(5):
                dfs[c, q] = 0.0
    s[2], s[3], s[4] = x[0], x[1], x[2]
    return state


@compiled
def _dragged(x, s, k, r, gap, f, dfx, dfs, with_slopes):
    """One chord that ends in contact, the leash r (v - gap) [m]; arguments as of `chord`.

    A stretch that is longer than the leash is cut to it first, as no periodic cycle has it: a search for one does"""
    dx, dy, ax, ay = x[0] - s[2], x[1] - s[3], s[2] - s[0], s[3] - s[1]
    before, after = r * (s[4] - gap), r * (x[2] - gap)
    share = after / (after - before) if before <= 0.0 else 1.0  # of the chord, in contact
    if before <= 0.0 and share * math.sqrt(dx * dx + dy * dy) <= after:  # touches on the way, without shear, and sticks
        bits, px, py, turns = STICKS, share * dx, share * dy, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        late, early = r * (1.0 - share) / (after - before), r * share / (after - before)
        grows_x = (share, 0.0, dx * late, 0.0, 0.0, -share, 0.0, dx * early)
        grows_y = (0.0, share, dy * late, 0.0, 0.0, 0.0, -share, dy * early)
    else:
        slips, where, cut, size = True, 0.0, 1.0, math.sqrt(ax * ax + ay * ay)
        if before > 0.0 and size <= before and (ax + dx) ** 2 + (ay + dy) ** 2 <= after * after:
            slips = False  # as the leash is linear and the stretch convex
        elif before > 0.0:
            cut = before / size if size * size > (1.0 + 1e-12) * before * before else 1.0
            slips, where = _lets_go(cut * ax, cut * ay, dx, dy, before, after)
        if not slips and cut == 1.0:
            for c in range(2):
                f[c] = k * (x[c] - s[c])
            return 0
        if slips:
            cut = cut if where > 0.0 else 1.0
            co, si, gx, gy, ex, ey, early, late = _tractrix(
                cut * ax, cut * ay, dx, dy, before, after, where, with_slopes
            )
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
    for q in range(8 if with_slopes else 0):  # directions: x, y, v at the end; w and x, y, v at the beginning
        tx, ty = grows_x[q] - py * turns[q], grows_y[q] + px * turns[q]
        if q < 3:
            dfx[0, q], dfx[1, q] = k * tx, k * ty
        else:
            dfs[0, q - 3], dfs[1, q - 3] = k * tx, k * ty
    f[0], f[1], s[0], s[1] = k * px, k * py, x[0] - px, x[1] - py
    return bits


@compiled
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


@compiled
def _tractrix(ax, ay, dx, dy, before, after, where, with_slopes):
    """Direction of the stretch at the end of a chord that slips from the share `where` on, or from where it touches.

    (ax, ay), (dx, dy) : stretch at the beginning and motion; leash from before to after
    Returns its cosine and sine, and six derivatives of its angle: by that stretch, by the motion, by the leash"""
    far = math.sqrt(dx * dx + dy * dy)
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
    if not with_slopes:
        return co * nx - si * ny, co * ny + si * nx, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    late = 0.0  # derivative by `where`, over how fast the stretch outgrows the leash there
    if where > 0.0:
        late = keeps * (hx * dy - hy * dx) / size + si * (rate * far - by_lash * rise)
        late /= hx * dx + hy * dy - rise
    gx, gy, lash_too = -keeps * hy / size - late * hx, keeps * hx / size - late * hy, late - si * by_lash
    ex, ey = where * gx - si * rate * share * nx, where * gy - si * rate * share * ny
    if far > 0.0:
        ex, ey = ex - (1.0 - keeps) * ny / far, ey + (1.0 - keeps) * nx / far
    return co * nx - si * ny, co * ny + si * nx, gx, gy, ex, ey, share * lash_too, where * lash_too - si * by_after


stamp_with(globals(), aft, trigonometric)
