"""Rough contact by statistics of asperities: elastic to yield, elastic-plastic beyond, partial slip, Coulomb's limit.

A table says how many asperities per area stand at which gap, all of one radius. At an approach u (closing, from the
first possible touch) an asperity of gap z is pressed in by d = u - z:

- d <= 1.9 d_y: Hertz, F = 4/3 E* R^1/2 d^3/2
- beyond, while d grows: elastic-plastic (Ghaednia et al. 2019, eq. 25 ff. in the form of Porter and Brake 2023); what
  that form jumps by at 1.9 d_y, some 0.5 %, is taken off, fading with d / d_y, so that F is continuous (ours)
- below the deepest d_m so far: Hertz again, of the flattened radius and from the plastic depth (Brake 2015)

So for a deepest approach u_m every asperity is a Hertzian contact, and their sum p(u; u_m) is convex. By the method of
dimensionality reduction such a contact is a bed of springs, N'' dg of them at each depth g, each with a unilateral
normal spring, a tangential one 2 (1 - nu) / (2 - nu) times as stiff, and Coulomb's limit: this has the partial slip of
Cattaneo and Mindlin for any history of load (Jaeger 1995; Popov and Hess 2015). The bed has SPRINGS springs, dense just
below u_m, where slip begins; they are Jenkins elements. In a periodic cycle u_m is the deepest of the cycle and its
past, and the Jacobian knows how the bed moves with it.
Source  Greenwood and Williamson 1966; Porter and Brake, MSSP 192 (2023) 110210; the bed of a whole rough face is ours
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numba
import numpy as np

from tribodyn.declare import number
from tribodyn.hbm.contact import located as transitions
from tribodyn.hbm.contact.law import SEPARATES, SLIPS, STICKS, ContactCycle, ContactParameters
from tribodyn.hbm.contact.laws import jenkins
from tribodyn.hbm.harmonics import HarmonicBasis

COMPONENTS = (("t1", "t2", "n"), ("t1", "n"), ("t2", "n"))
OWN_STIFFNESS = True  # its springs follow from its own numbers
TABLE = ("gap in m", "asperities per m2 and per m of gap, or per m2 where there is one row")

SPRINGS = 40  # of the bed
ROWS = 64  # depths at which the bed is tabulated, equidistant in the root of the deepest approach
FIRST = 1e-4  # depth of the first spring below the deepest approach, over the whole depth of the bed
WIDEST = 0.05  # largest distance of two springs, over the same
HEIGHTS = 1000  # at which the density of gaps is summed, at least
SLOPE_STEP = 0.2  # rows on either side between which slopes of the table are taken
YIELD = 1.9  # d / d_y up to which an asperity is elastic
FRICTION, AREA, TABULATED = 4, 5, 13  # places in a packed row: the law's numbers, then the table


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


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    friction: float = number("", low=0.0)
    """Coulomb coefficient."""
    area: float = number("m2", default=1.0, above=0.0)
    """Area that a pair stands for; a scene gives each pair its own."""
    young: float = number("Pa", above=0.0)
    """Young's modulus of both bodies."""
    poisson: float = number("", low=0.0, high=0.5)
    """Poisson's ratio of both bodies."""
    radius: float = number("m", above=0.0)
    """Effective radius of the asperities: half the radius of two alike."""
    yield_stress: float = number("Pa", default=0.0, low=0.0)
    """Yield stress; 0 for asperities that never yield."""
    tangent_modulus: float = number("Pa", default=0.0, low=0.0)
    """Slope of stress over strain beyond yield."""
    pressure: float = number("Pa", default=1e7, above=0.0)
    """Mean pressure at which the springs of the stuck contact are taken until the preload is known."""
    deepest: float = number("m", default=0.0, low=0.0)
    """Deepest approach that is tabulated; the largest gap of the table by default."""


@dataclass(frozen=True)
class Asperity:
    """One pair of asperities. E : E*; R : effective radius [m]; young, nu, yield_stress, tangent : of the material."""

    E: float
    R: float
    young: float
    nu: float
    yield_stress: float
    tangent: float

    @property
    def onset(self) -> float:
        """Approach at which it begins to yield, 1.9 d_y [m]."""
        return YIELD * self._d_y if self.yield_stress else np.inf

    @property
    def _C(self) -> float:
        return 1.295 * float(np.exp(0.736 * self.nu))

    @property
    def _d_y(self) -> float:
        return 4 * self.R * (np.pi * self._C * self.yield_stress / (4 * self.E)) ** 2

    def hertz(self, d: np.ndarray) -> np.ndarray:
        """Elastic force [N] at approaches d >= 0 [m]."""
        return 4 / 3 * self.E * np.sqrt(self.R) * d**1.5

    def loading(self, d: np.ndarray) -> np.ndarray:
        """Force [N] at approaches d >= 0 [m] that were never exceeded."""
        elastic = self.hertz(d)
        if not self.yield_stress:
            return elastic
        w = np.maximum(d / self._d_y, YIELD)
        jump = self._plastic(np.array(YIELD)) - self.hertz(np.array(self.onset))
        return np.where(d > self.onset, self._plastic(w) - jump * np.exp(YIELD - w), elastic)

    def _plastic(self, w: np.ndarray) -> np.ndarray:
        d, C, S = w * self._d_y, self._C, self.yield_stress
        elastic, hardening = self.hertz(d), self.tangent / self.young
        a_e = np.sqrt(self.R * d)
        B = 0.14 * np.exp(23 * S / (2 * self.E))
        a_p = self.R * np.pi * C * S / (2 * self.E) * np.sqrt(w * (w / YIELD) ** B)
        if hardening > np.finfo(float).eps:
            root = np.sqrt(self.young / S)
            upsilon = -2 * root * hardening ** (1 - (d - self._d_y) / (4 * self.R))
            upsilon = upsilon / ((4 - 3 * np.exp(-2 * root * hardening)) * (1 - hardening))
        else:
            upsilon = np.zeros_like(d)
        a = a_e + (a_p - a_e) * np.exp(upsilon)
        hardness = 2.84 - 0.92 * (1 - np.cos(np.pi * a / (2 * self.R)))
        F_c = 4 / 3 * (self.R / self.E) ** 2 * (C * np.pi * S / 2) ** 3
        plastic = np.exp(-0.25 * w ** (5 / 12)) * w**1.5 + 4 * hardness / C * (1 - np.exp(-(w ** (5 / 9)) / 25)) * w
        return F_c * plastic + (elastic - F_c * plastic) * (1 - np.exp(-3.3 * hardening))

    def flattened(self, d_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Plastic depth [m] and root of the radius [m^0.5] of the Hertzian contact below the deepest approach d_m."""
        d_m = np.maximum(d_m, 1e-100)  # whose force is still above zero
        share = self.loading(d_m) / self.hertz(d_m)
        share = np.where(d_m > self.onset, share, 1.0)
        root = np.sqrt(self.R) / np.sqrt(share)  # F_m / (4/3 E* (share d_m)^3/2)
        return d_m * (1 - share), root


def asperity(numbers: tuple[float, ...]) -> Asperity:
    """The asperity of (young, poisson, radius, yield stress, tangent modulus)."""
    young, nu, radius, yield_stress, tangent = numbers
    return Asperity(young / (2 * (1 - nu**2)), radius, young, nu, yield_stress, tangent)


def pressure(one: Asperity, table: np.ndarray, u: np.ndarray, deepest: float) -> np.ndarray:
    """Pressure p(u; u_m) [Pa] at approaches u (n,), the deepest so far being u_m; table : (k, 2) gaps and counts."""
    gap, count = table.T
    pressed = gap < deepest
    offset, root = one.flattened(deepest - gap[pressed])
    d = np.maximum(u[:, None] - gap[pressed] - offset, 0.0)
    return (4 / 3 * one.E * root * d**1.5) @ count[pressed]


@lru_cache(maxsize=32)
def _bed_table(one: Asperity, flat: bytes, deepest: float) -> np.ndarray:
    """(ROWS + 1, 2, 1 + SPRINGS) depth of the bed [m] and its springs [N/m3], and their slopes over the row number."""
    table = _heights(np.frombuffer(flat).reshape(-1, 2))

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


def _heights(table: np.ndarray) -> np.ndarray:
    """(k, 2) gaps [m] and asperities per m2 at them, from a density that is linear between the rows of a table."""
    if len(table) == 1:
        return table
    gap, density = table.T
    every = -(-HEIGHTS // (len(gap) - 1))
    fine = np.interp(np.arange(every * (len(gap) - 1) + 1) / every, np.arange(len(gap)), gap)
    width = np.gradient(np.concatenate([[2 * fine[0] - fine[1]], fine, [2 * fine[-1] - fine[-2]]]))[1:-1]
    width[[0, -1]] /= 2
    return np.column_stack([fine, width * np.interp(fine, gap, density)])


def tabulated(parameters: ContactParameters) -> np.ndarray:
    """(n_pair, ...) what every packed row ends with: deepest tabulated approach [m], then the table of its bed."""
    if parameters.table is None:
        raise ValueError("contact law 'rough' needs its table of asperities: columns " + " and ".join(TABLE))
    given = np.ascontiguousarray(parameters.table, float)
    if given.ndim != 2 or given.shape[1] != 2 or not np.isfinite(given).all() or (given < 0).any() or not given.any():
        raise ValueError(f"contact law 'rough': expected two columns without negatives, {' and '.join(TABLE)}")
    if (np.diff(given[:, 0]) <= 0).any():
        raise ValueError("contact law 'rough': the gaps in its table must rise from row to row")
    n = parameters.numbers
    own = np.stack([n[name] for name in ("young", "poisson", "radius", "yield_stress", "tangent_modulus")], axis=1)
    top = np.where(n["deepest"] > 0, n["deepest"], given[:, 0].max())
    if not (top > 0).all():
        raise ValueError("contact law 'rough': give deepest, where all asperities of the table stand at one height")
    rows = np.empty((parameters.n_pair, 1 + (ROWS + 1) * 2 * (1 + SPRINGS)))
    for i in range(parameters.n_pair):
        rows[i, 0] = top[i]
        rows[i, 1:] = _bed_table(asperity(tuple(own[i].tolist())), given.tobytes(), float(top[i])).ravel()
    return rows


def springs(parameters: ContactParameters) -> np.ndarray:
    """(n_pair, n_component) tangents [N/m] of the contact stuck at its nominal pressure."""
    packed, n = parameters.packed(), parameters.numbers
    low, high = np.zeros(parameters.n_pair), packed[:, TABULATED].copy()
    for _ in range(60):
        middle = 0.5 * (low + high)
        kn, g, _, _ = bed(packed, middle)
        below = (kn * (middle[:, None] - g)).sum(axis=1) < n["pressure"] * n["area"]
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    stiff = bed(packed, low)[0].sum(axis=1)
    ratio = tangential_ratio(n["poisson"])
    return np.stack([stiff if c == "n" else ratio * stiff for c in parameters.components], axis=1)


def tangential_ratio(nu: np.ndarray) -> np.ndarray:
    """Tangential over normal stiffness of a stuck asperity (Mindlin 1949)."""
    return 2 * (1 - nu) / (2 - nu)


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


def n_state(components: tuple[str, ...]) -> int:
    """The deepest approach [m], then the slider positions of all springs, direction by direction [m]."""
    return 1 + SPRINGS * (len(components) - 1)


def rested(x: np.ndarray, parameters: ContactParameters) -> np.ndarray:
    """Memory (n_pair, n_state) of a contact without shear at the displacement x (n_pair, n_component) [m]."""
    deepest = np.maximum(x[:, -1] - parameters.gap, 0.0)
    return np.concatenate([deepest[:, None], np.repeat(x[:, :-1], SPRINGS, axis=1)], axis=1)


@numba.njit(cache=True)
def step(x, s, p, f, dfx, dfs, dsx, dss):
    """Advance one pair by one sample; writes force, memory and their derivatives, returns the status bits."""
    n = x.size - 1
    k, g, dk, dg = np.empty(SPRINGS), np.empty(SPRINGS), np.empty(SPRINGS), np.empty(SPRINGS)
    approach = x[n] - p[3]
    grows = approach > s[0]
    if grows:
        s[0] = approach
        dsx[0, n] = 1.0
    else:
        dss[0, 0] = 1.0
    look_up(p, s[0], k, g, dk, dg)
    ratio, mu = 2 * (1 - p[7]) / (2 - p[7]), p[FRICTION]
    bits = 0
    for c in range(n + 1):
        f[c] = 0.0
    by_deepest = np.zeros(n + 1)  # d f / d deepest
    for q in range(SPRINGS):
        N = k[q] * (approach - g[q])
        if N <= 0.0:
            for c in range(n):
                r = 1 + c * SPRINGS + q
                s[r] = x[c]
                dsx[r, c] = 1.0
            continue
        f[n] += N
        dfx[n, n] += k[q]
        dN = dk[q] * (approach - g[q]) - k[q] * dg[q]
        by_deepest[n] += dN
        for c in range(n):
            r = 1 + c * SPRINGS + q
            T = ratio * k[q] * (x[c] - s[r])
            if abs(T) <= mu * N:
                f[c] += T
                dfx[c, c] += ratio * k[q]
                dfs[c, r] = -ratio * k[q]
                by_deepest[c] += ratio * dk[q] * (x[c] - s[r])
                dss[r, r] = 1.0
                bits |= STICKS
            else:
                side = mu if T > 0.0 else -mu
                f[c] += side * N
                dfx[c, n] += side * k[q]
                by_deepest[c] += side * dN
                s[r] = x[c] - side / ratio * (approach - g[q])
                dsx[r, c] = 1.0
                dsx[r, n] = -side / ratio * (1.0 - dg[q] if grows else 1.0)
                if not grows:
                    dss[r, 0] = side / ratio * dg[q]
                bits |= SLIPS
    for c in range(n + 1):
        if grows:
            dfx[c, n] += by_deepest[c]
        else:
            dfs[c, 0] = by_deepest[c]
    return bits if f[n] > 0.0 else SEPARATES


def cycle(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool = True
) -> ContactCycle:
    """The periodic cycle at the samples of the basis; see `_cycle`."""
    return _cycle(jenkins.cycle, x, parameters, memory, basis, jacobian)


def located(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool = True
) -> ContactCycle:
    """The periodic cycle with the transitions of every spring and the deepest approach located between samples."""
    return _cycle(transitions.cycle, x, parameters, memory, basis, jacobian)


@dataclass(frozen=True)
class _Bed:
    """The springs of all pairs in a cycle.

    k, g, dk, dg : (n_pair, SPRINGS) as of `bed`; peak, angle : (n_pair,) deepest approach of the cycle [m] and where
    grows : (n_pair,) whether that is deeper than all before
    elements : the springs as Jenkins elements, pair by pair; sliders : (n_pair * SPRINGS, n_component - 1) their memory
    """

    k: np.ndarray
    g: np.ndarray
    dk: np.ndarray
    dg: np.ndarray
    peak: np.ndarray
    angle: np.ndarray
    grows: np.ndarray
    elements: ContactParameters
    sliders: np.ndarray

    @classmethod
    def of(cls, x, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, located: bool) -> _Bed:
        """The bed at the deepest approach of the cycle x (n_pair, n_component, n_coeff) [m] and its past."""
        n_pair, n_comp, _ = x.shape
        peak, angle = _deepest(x[:, -1], basis, located)
        peak = peak - parameters.gap
        grows = peak > memory[:, 0]
        k, g, dk, dg = bed(parameters.packed(), np.where(grows, peak, memory[:, 0]))
        ratio = tangential_ratio(parameters.numbers["poisson"])[:, None]
        stiff = np.stack([k if c == n_comp - 1 else ratio * k for c in range(n_comp)], axis=-1).reshape(-1, n_comp)
        elements = ContactParameters(
            parameters.components,
            stiff,
            (g + parameters.gap[:, None]).ravel(),
            {"friction": np.repeat(parameters.numbers["friction"], SPRINGS)},
        )
        sliders = memory[:, 1:].reshape(n_pair, n_comp - 1, SPRINGS).transpose(0, 2, 1).reshape(-1, n_comp - 1)
        return cls(k, g, dk, dg, peak, angle, grows, elements, np.ascontiguousarray(sliders))


def sliders(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis
) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the sliders of all springs over the periodic cycle x (n_pair, n_component, n_coeff), and their load.

    Returns (n_pair, SPRINGS, n_component - 1, n_samples) [m], (n_pair, SPRINGS, n_samples) normal force [N]
    """
    made = _Bed.of(x, parameters, memory, basis, located=False)
    moved = np.repeat(basis.to_time(x), SPRINGS, axis=0)
    pressed = np.maximum(moved[:, -1] - made.elements.gap[:, None], 0.0)
    ratio = tangential_ratio(parameters.numbers["poisson"])
    reach = np.repeat(parameters.numbers["friction"] / ratio, SPRINGS)[:, None] * pressed  # at which one slips
    at, found = made.sliders, np.empty((len(moved), moved.shape[1] - 1, basis.n_samples))
    for _ in range(2):  # the memory of Jenkins elements repeats after the first
        for i in range(basis.n_samples):
            here, off = moved[:, :-1, i], reach[:, i, None]
            at = found[:, :, i] = np.clip(at, here - off, here + off)
    shape = (*made.k.shape, -1, basis.n_samples)
    return found.reshape(shape), made.k[:, :, None] * pressed.reshape(*made.k.shape, -1)


def _cycle(by_elements, x, parameters, memory, basis, jacobian) -> ContactCycle:
    """The bed at the deepest approach of the cycle and its past, its springs by the cycle of Jenkins elements.

    x : (n_pair, n_component, n_coeff) [m]; memory : (n_pair, n_state) at the start
    """
    n_pair, n_comp, n_coeff = x.shape
    made = _Bed.of(x, parameters, memory, basis, located=by_elements is transitions.cycle)
    k, dk, dg = made.k, made.dk, made.dg
    each = by_elements(np.repeat(x, SPRINGS, axis=0), made.elements, made.sliders, basis, jacobian)
    force = each.force.reshape(n_pair, SPRINGS, n_comp, n_coeff)
    bits = each.status.reshape(n_pair, SPRINGS)
    status = np.bitwise_or.reduce(bits & ~SEPARATES, axis=1)
    # the deepest spring is the last to let go: only where it opens the pair does
    status |= bits[:, -1] & SEPARATES
    total = force.sum(axis=1)
    if not jacobian:
        return ContactCycle(total, None, status)
    m = n_comp * n_coeff
    jac = each.jacobian.reshape(n_pair, SPRINGS, m, m)
    slope = jac.sum(axis=1)
    if made.grows.any() and basis.has_static:
        i = np.flatnonzero(made.grows & (made.peak > 0))
        relative = np.divide(dk[i], k[i], out=np.zeros_like(k[i]), where=k[i] > 0)
        still = (n_comp - 1) * n_coeff  # the mean normal displacement: a later touch is as a wider gap
        by_deepest = np.einsum("iq,iqa->ia", relative, force[i].reshape(len(i), SPRINGS, m))
        by_deepest -= np.einsum("iq,iqa->ia", dg[i], jac[i, :, :, still])
        slope[i, :, still:] += by_deepest[:, :, None] * basis.functions(made.angle[i])[:, None, :]
    return ContactCycle(total, slope, status)


def _deepest(x: np.ndarray, basis: HarmonicBasis, located: bool) -> tuple[np.ndarray, np.ndarray]:
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
