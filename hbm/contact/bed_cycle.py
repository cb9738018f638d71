"""The bed of springs that stands for a rough face at its deepest approach, and the cycle of such beds.

For a deepest approach u_m every asperity is a Hertzian contact, and their sum p(u; u_m) is convex. By the method of
dimensionality reduction it is a bed of springs, N'' dg of them at each depth g: SPRINGS of them, dense just below u_m,
where slip begins, tabulated over u_m.

Springs are Jenkins elements. What does not depend on the cycle of the others is summed at once: a spring that sticks
all through it is linear, and all such springs of a pair are one.
Source  Popov and Hess 2015; the bed of a whole rough face is ours
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numba
import numpy as np

from tribodyn.hbm.contact import jenkins_cycle
from tribodyn.hbm.contact.asperity import Asperity, heights, pressure, tangential_ratio
from tribodyn.hbm.contact.contact_law import SEPARATES, STICKS, ContactCycle, ContactParameters
from tribodyn.hbm.contact.laws import jenkins
from tribodyn.hbm.harmonics import HarmonicBasis

SPRINGS = 40  # of the bed
ROWS = 64  # depths at which the bed is tabulated, equidistant in the root of the deepest approach
FIRST = 1e-4  # depth of the first spring below the deepest approach, over the whole depth of the bed
WIDEST = 0.05  # largest distance of two springs, over the same
SLOPE_STEP = 0.2  # rows on either side between which slopes of the table are taken
AREA, TABULATED = 5, 13  # places in a packed row of the law


# depth of the springs below the deepest approach, over the depth of the bed: 0 < s_1 < ... < s_Q = 1
def _depths() -> np.ndarray:
    """In geometric progression while their distance is below WIDEST, equidistant from there on."""
    for graded in range(SPRINGS - 1, 0, -1):  # the fewer graded ones, the finer the rest
        even = SPRINGS - graded
        low = np.geomspace(FIRST, 1 - even * WIDEST, graded) if even * WIDEST < 1 else None
        if low is not None and low[-1] - low[-2] <= WIDEST:
            return np.concatenate([[0.0], low, np.linspace(low[-1], 1.0, even + 1)[1:]])
    raise AssertionError


DEPTH = _depths()


@lru_cache(maxsize=32)
def table_of(one: Asperity, flat: bytes, deepest: float) -> np.ndarray:
    """(ROWS + 1, 2, 1 + SPRINGS) depth of the bed [m] and its springs [N/m3], and their slopes over the row number."""
    table = heights(np.frombuffer(flat).reshape(-1, 2))

    def bed(row: float) -> np.ndarray:
        u_m = deepest * (row / ROWS) ** 2
        gap = table[:, 0]
        pressed = gap < u_m
        if not pressed.any():
            return np.zeros(1 + SPRINGS)
        offset, _ = one.flattened(u_m - gap[pressed])
        depth = u_m - float((gap[pressed] + offset).min())
        p = pressure(one, table, u_m - depth * DEPTH, u_m)
        slope = np.append(-np.diff(p) / (depth * np.diff(DEPTH)), 0.0)
        return np.concatenate([[depth], slope[:-1] - slope[1:]])

    found = np.zeros((ROWS + 1, 2, 1 + SPRINGS))
    for row in range(ROWS + 1):
        found[row, 0] = bed(row)
        before = max(row - SLOPE_STEP, 0.0)
        found[row, 1] = (bed(row + SLOPE_STEP) - bed(before)) / (row + SLOPE_STEP - before)
    return found


def bed(p: np.ndarray, deepest: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Springs [N/m] and their approaches of touch [m], both (n_pair, SPRINGS), and d / d deepest of both.

    p : packed rows; deepest : (n_pair,) [m]; nothing where it is not above zero
    """
    shape = (len(p), SPRINGS)
    k, g, dk, dg = (np.zeros(shape) for _ in range(4))
    _beds(p, deepest, k, g, dk, dg)
    return k, g, dk, dg


@numba.njit(cache=True)
def _beds(p, deepest, k, g, dk, dg):
    for i in range(p.shape[0]):
        look_up(p[i], deepest[i], k[i], g[i], dk[i], dg[i])


@numba.njit(cache=True)
def look_up(p, deepest, k, g, dk, dg):
    """The bed of one pair, cubic between the rows of its table and straight on beyond the last; see `bed`."""
    area, top = p[AREA], p[TABULATED]
    if deepest <= 0.0:
        for q in range(SPRINGS):
            k[q], g[q], dk[q], dg[q] = 0.0, 0.0, 0.0, 1.0
        return
    at = ROWS * math.sqrt(deepest / top)
    rate = 0.5 * at / deepest  # d at / d deepest
    row = min(int(at), ROWS - 1)
    t = at - row
    if t <= 1.0:
        b0, b1 = (1 + 2 * t) * (1 - t) ** 2, t * t * (3 - 2 * t)
        m0, m1 = t * (1 - t) ** 2, t * t * (t - 1)
        db1 = 6 * t * (1 - t)
        dm0, dm1 = (1 - t) * (1 - 3 * t), t * (3 * t - 2)
        db0 = -db1
    else:
        b0, b1, m0, m1 = 0.0, 1.0, 0.0, t - 1.0
        db0, db1, dm0, dm1 = 0.0, 0.0, 0.0, 1.0
    width = 1 + SPRINGS
    o = TABULATED + 1 + row * 2 * width
    v0, s0, v1, s1 = o, o + width, o + 2 * width, o + 3 * width
    depth = b0 * p[v0] + b1 * p[v1] + m0 * p[s0] + m1 * p[s1]
    ddepth = rate * (db0 * p[v0] + db1 * p[v1] + dm0 * p[s0] + dm1 * p[s1])
    for q in range(SPRINGS):
        c = q + 1
        k[q] = area * (b0 * p[v0 + c] + b1 * p[v1 + c] + m0 * p[s0 + c] + m1 * p[s1 + c])
        dk[q] = area * rate * (db0 * p[v0 + c] + db1 * p[v1 + c] + dm0 * p[s0 + c] + dm1 * p[s1 + c])
        if k[q] < 0.0:
            k[q], dk[q] = 0.0, 0.0
        g[q] = deepest - depth * DEPTH[c]
        dg[q] = 1.0 - ddepth * DEPTH[c]


@dataclass(frozen=True)
class Bed:
    """The springs of all pairs in a cycle.

    k, g, dk, dg : (n_pair, SPRINGS) as of `bed`; peak, angle : (n_pair,) deepest approach of the cycle [m] and where
    grows : (n_pair,) whether that is deeper than all before
    sliders : (n_pair, SPRINGS, n_component - 1) their memory [m]; ratio : (n_pair,) tangential over normal stiffness
    friction : (n_pair,) coefficient
    """

    parameters: ContactParameters
    k: np.ndarray
    g: np.ndarray
    dk: np.ndarray
    dg: np.ndarray
    peak: np.ndarray
    angle: np.ndarray
    grows: np.ndarray
    sliders: np.ndarray
    ratio: np.ndarray
    friction: np.ndarray

    @classmethod
    def of(
        cls, x, parameters: ContactParameters, friction, memory: np.ndarray, basis: HarmonicBasis, located: bool
    ) -> Bed:
        """The bed at the deepest approach of the cycle x (n_pair, n_component, n_coeff) [m] and its past."""
        peak, angle = deepest_of(x[:, -1], basis, located)
        peak = peak - parameters.gap
        grows = peak > memory[:, 0]
        springs = bed(parameters.packed(), np.where(grows, peak, memory[:, 0]))
        sliders = memory[:, 1:].reshape(len(x), -1, SPRINGS).transpose(0, 2, 1)
        ratio = tangential_ratio(parameters.numbers["poisson"])
        return cls(parameters, *springs, peak, angle, grows, sliders, ratio, friction)

    @property
    def touch(self) -> np.ndarray:
        """(n_pair, SPRINGS) normal displacement at which a spring touches [m]."""
        return self.g + self.parameters.gap[:, None]

    def elements(self, pair: np.ndarray, spring: np.ndarray) -> ContactParameters:
        """Some of the springs as Jenkins elements."""
        k = self.k[pair, spring]
        tangential = [self.ratio[pair] * k] * self.sliders.shape[2]
        stiff = np.stack([*tangential, k], axis=1)
        return ContactParameters(self.parameters.components, stiff, self.touch[pair, spring], {})

    def at_rest(self, x: np.ndarray, basis: HarmonicBasis) -> tuple[np.ndarray, np.ndarray]:
        """(n_pair, SPRINGS) whether a spring sticks all through the cycle x, and whether it never touches.

        Where all springs of a pair start from one slider, neither asks for the stiffness: one bound serves them all.
        """
        samples = basis.to_time(x)
        n, t, start = samples[:, -1], samples[:, :-1], self.sliders[:, -1]
        mu, ratio = self.friction, self.ratio
        off = np.abs(t - start[:, :, None]).max(axis=1, initial=0.0)
        slips_below = (ratio[:, None] * off - mu[:, None] * n).max(axis=1)  # sticks if below - mu touch
        opens_below = n.min(axis=1)
        if basis.transitions == "located":  # between samples a curve leaves its chord by its bend
            bend = (np.abs(x) * basis.order**2).sum(axis=2) * (2 * np.pi / basis.n_samples) ** 2 / 8
            slips_below = slips_below + ratio * bend[:, :-1].max(axis=1, initial=0.0) + mu * bend[:, -1]
            opens_below = opens_below - bend[:, -1]
        alike = (self.sliders == start[:, None]).all(axis=(1, 2))
        sticks = slips_below[:, None] < -mu[:, None] * self.touch
        sticks &= (opens_below[:, None] > self.touch) & alike[:, None]
        return sticks, (self.peak + self.parameters.gap)[:, None] < self.touch


def slider_positions(
    x: np.ndarray, parameters: ContactParameters, friction: np.ndarray, memory: np.ndarray, basis: HarmonicBasis
) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the sliders of all springs over the periodic cycle x (n_pair, n_component, n_coeff), and their load.

    Returns (n_pair, SPRINGS, n_component - 1, n_samples) [m], (n_pair, SPRINGS, n_samples) normal force [N]
    """
    made = Bed.of(x, parameters, friction, memory, basis, located=False)
    moved = basis.to_time(x)
    pressed = np.maximum(moved[:, None, -1] - made.touch[:, :, None], 0.0)
    reach = (friction / made.ratio)[:, None, None] * pressed  # at which one slips
    at, found = made.sliders, np.empty((*made.sliders.shape, basis.n_samples))
    for _ in range(2):  # the memory of Jenkins elements repeats after the first
        for i in range(basis.n_samples):
            here, off = moved[:, None, :-1, i], reach[:, :, None, i]
            at = found[..., i] = np.clip(at, here - off, here + off)
    return found, made.k[:, :, None] * pressed


def cycle(x, parameters, friction, memory, basis, jacobian, located: bool) -> ContactCycle:
    """The bed at the deepest approach of the cycle and its past.

    Springs that stick all through it are one spring; the others go by the cycle of Jenkins elements.
    x : (n_pair, n_component, n_coeff) [m]; memory : (n_pair, n_state) at the start
    """
    made = Bed.of(x, parameters, friction, memory, basis, located)
    sticks, open_ = made.at_rest(x, basis)
    force, slope = _stuck(made, made.k * sticks, x, basis, jacobian)
    add = _add_located if located else _add_sampled
    grows = made.grows & (made.peak > 0)
    status = np.where(sticks.any(axis=1), STICKS, 0)
    by_deepest, _ = _stuck(made, made.dk * sticks, x, basis, False)
    add(made, ~(sticks | open_), x, basis, force, slope, by_deepest, status)
    status[open_[:, -1]] = SEPARATES
    if slope is not None and grows.any() and basis.has_static:
        m = slope.shape[1]
        still = m - basis.n_coeff  # the mean normal displacement: a later touch is as a wider gap
        by_deepest[:, -1, 0] -= (made.k * made.dg * sticks).sum(axis=1)
        functions = basis.functions(made.angle[grows])
        slope[grows, :, still:] += by_deepest.reshape(-1, m)[grows, :, None] * functions[:, None, :]
    return ContactCycle(force, slope, status)


def _add_located(made, active, x, basis, force, slope, by_deepest, status):
    """Add what active springs (n_pair, SPRINGS) do, their transitions located, to what the others do.

    force, by_deepest : (n_pair, n_component, n_coeff), its derivative along the deepest approach; slope : the
        Jacobian, None where not asked for; status : (n_pair,)
    """
    n_pair, n_comp, n_coeff = x.shape
    pair, spring = np.nonzero(active)
    own = np.ascontiguousarray(made.sliders[pair, spring])
    elements = made.elements(pair, spring)
    moved, friction = np.ascontiguousarray(x[pair]), made.friction[pair]
    each = jenkins_cycle.cycle(moved, elements, own, basis, slope is not None, friction=friction)
    force += _by_pair(each.force, pair, n_pair)
    np.bitwise_or.at(status, pair, each.status & ~SEPARATES)
    # the deepest spring is the last to let go: only where it opens the pair does
    deepest = spring == SPRINGS - 1
    status[pair[deepest]] |= each.status[deepest] & SEPARATES
    jac = each.jacobian
    if slope is None or jac is None:
        return
    slope += _by_pair(jac, pair, n_pair)
    k, dk, dg = (v[pair, spring, None, None] for v in (made.k, made.dk, made.dg))
    relative = np.divide(dk, k, out=np.zeros_like(k), where=k > 0)
    column = jac[:, :, (n_comp - 1) * n_coeff].reshape(each.force.shape)
    by_deepest += _by_pair(relative * each.force - dg * column, pair, n_pair)


def _add_sampled(made, active, x, basis, force, slope, by_deepest, status):
    """As `_add_located`, at the samples of the basis."""
    samples = basis.to_time(x)
    sums, weighted = np.zeros_like(samples), np.zeros_like(samples)
    jac = np.zeros((0, 0, 0)) if slope is None else slope
    column = np.zeros(x.shape)
    springs = (made.k, made.touch, made.dk, made.dg, made.ratio, made.friction)
    start = np.ascontiguousarray(made.sliders)
    _sum(samples, *springs, start, active, basis.synthesis, *basis.prefix_sums, sums, weighted, jac, column, status)
    force += basis.from_time(sums)
    if slope is not None:
        by_deepest += basis.from_time(weighted) + column


@numba.njit(cache=True)
def _sum(x, k, touch, dk, dg, ratio, mu, sliders, active, phi, product, single, force, weighted, jac, column, status):
    """Forces of the active springs (n_pair, n_component, n_samples), the same times dk / k, and their derivatives."""
    n_pair, n_comp, n_time = x.shape
    n_coeff, want = phi.shape[1], jac.shape[0] > 0
    m, still = n_comp * n_coeff, (n_comp - 1) * n_coeff
    kind, slider = np.empty(n_time, np.int8), np.empty(n_time)
    f, stiff = np.empty((n_comp, n_time)), np.empty(n_comp)
    own = np.zeros((m, m)) if want else np.zeros((0, 0))
    for i in range(n_pair):
        for q in range(SPRINGS):
            if not active[i, q]:
                continue
            stiff[: n_comp - 1], stiff[n_comp - 1] = ratio[i] * k[i, q], k[i, q]
            if want:
                own[:] = 0.0
            bits = jenkins.element(
                stiff, mu[i], touch[i, q], sliders[i, q], x[i], phi, product, single, f, own, kind, slider
            )
            # the deepest spring is the last to let go: only where it opens the pair does
            status[i] |= bits if q == SPRINGS - 1 else bits & ~SEPARATES
            share = dk[i, q] / k[i, q] if k[i, q] > 0.0 else 0.0
            for c in range(n_comp):  # in loops: sums of arrays take numba seconds to compile
                for j in range(n_time):
                    force[i, c, j] += f[c, j]
            if not want:
                continue
            for a in range(m):
                for b in range(m):
                    jac[i, a, b] += own[a, b]
            for c in range(n_comp):
                for j in range(n_time):
                    weighted[i, c, j] += share * f[c, j]
            for c in range(n_comp):
                for a in range(n_coeff):
                    column[i, c, a] -= dg[i, q] * own[c * n_coeff + a, still]


def _stuck(
    made: Bed, k: np.ndarray, x: np.ndarray, basis: HarmonicBasis, jacobian: bool
) -> tuple[np.ndarray, np.ndarray | None]:
    """Force of springs k (n_pair, SPRINGS) [N/m] that stick all through the cycle x, and its derivative."""
    normal = k.sum(axis=1)
    stiff = np.concatenate([(made.ratio * normal)[:, None]] * (x.shape[1] - 1) + [normal[:, None]], axis=1)
    force = stiff[:, :, None] * x
    if basis.has_static:
        force[:, :-1, 0] -= stiff[:, :-1] * made.sliders[:, -1]
        force[:, -1, 0] -= (k * made.touch).sum(axis=1)
    if not jacobian:
        return force, None
    m = force[0].size
    slope = np.zeros((len(x), m, m))
    slope[:, np.arange(m), np.arange(m)] = np.repeat(stiff, x.shape[2], axis=1)
    return force, slope


def _by_pair(values: np.ndarray, pair: np.ndarray, n_pair: int) -> np.ndarray:
    """Sums (n_pair, ...) of values (n, ...) whose pairs (n,) rise."""
    found = np.zeros((n_pair, *values.shape[1:]))
    starts = np.flatnonzero(np.diff(pair, prepend=-1))
    if len(starts):
        found[pair[starts]] = np.add.reduceat(values, starts, axis=0)
    return found


def deepest_of(x: np.ndarray, basis: HarmonicBasis, located: bool) -> tuple[np.ndarray, np.ndarray]:
    """Largest value (n_pair,) of displacements (n_pair, n_coeff) over the period, and the angle at which it is met."""
    samples = basis.to_time(x)
    at = samples.argmax(axis=1)
    angle = 2 * np.pi * at / basis.n_samples
    value = samples[np.arange(len(x)), at]
    if not located:
        return value, angle
    first = x @ basis.rate
    for _ in range(4):  # Newton on the slope, from the highest sample
        functions = basis.functions(angle)
        slope = (first * functions).sum(axis=1)
        bend = ((first @ basis.rate) * functions).sum(axis=1)
        angle = angle - np.divide(slope, bend, out=np.zeros_like(slope), where=bend < 0)
    finer = (x * basis.functions(angle)).sum(axis=1)
    better = finer > value
    return np.where(better, finer, value), np.where(better, angle, 2 * np.pi * at / basis.n_samples)
