"""Jenkins elements with variable normal load: one or two uncoupled tangential directions and a unilateral normal one.

N = max(k_n (v - gap), 0); each tangential spring k_t drags a slider w that holds |T| <= mu N and lets go when N = 0.
Source  Yang, Chu and Menq 1998; Tamatam 2021, eq. 3.24-3.28."""

from dataclasses import dataclass

import numba
import numpy as np

from tribodyn.declarations import number
from tribodyn.hbm.contact import jenkins_cycle
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactCycle, ContactParameters
from tribodyn.hbm.contact.trigonometric import compiled
from tribodyn.hbm.harmonics import HarmonicBasis

COMPONENTS = (("t1", "t2", "n"), ("t1", "n"), ("t2", "n"))
LINEAR_WHERE_STUCK = True

OPEN, STICK, FORWARD, BACKWARD = 0, 1, 2, 3  # kinds of samples; slip by its sense
SIDE = np.array([0.0, 0.0, 1.0, -1.0])  # sign of T in slip


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    friction: float = number("", role="friction", low=0.0, usual=(0.0, 1.5))
    """Coulomb coefficient."""


def n_state(components: tuple[str, ...]) -> int:
    """One slider position per tangential direction [m]."""
    return len(components) - 1


@numba.njit(cache=True)
def step(x, w, p, f, dfx, dfs, dsx, dss):
    """Advance one pair by one sample; writes force, memory and their derivatives, returns the status bits."""
    t = x.size - 1
    kn, mu = p[t], p[4]
    N = kn * (x[t] - p[3])  # eq. 3.24
    if N <= 0.0:
        for c in range(t):
            f[c] = 0.0
            w[c] = x[c]
            dsx[c, c] = 1.0
        f[t] = 0.0
        return SEPARATES
    f[t] = N
    dfx[t, t] = kn
    bits = 0
    for c in range(t):
        kt = p[c]
        T = kt * (x[c] - w[c])  # eq. 3.26
        if abs(T) <= mu * N:
            f[c] = T
            dfx[c, c] = kt
            dfs[c, c] = -kt
            dss[c, c] = 1.0
            bits |= STICKS
        else:
            sign = 1.0 if T > 0.0 else -1.0
            f[c] = sign * mu * N  # eq. 3.27
            w[c] = x[c] - f[c] / kt  # eq. 3.28
            dfx[c, t] = sign * mu * kn
            dsx[c, c] = 1.0
            dsx[c, t] = -sign * mu * kn / kt
            bits |= SLIPS
    return bits


event_based_cycle = jenkins_cycle.cycle


def sampled_cycle(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool = True
) -> ContactCycle:
    """The periodic cycle at the samples of the basis, with the Jacobian in closed form between transitions.

    Between two transitions dT/du and dT/dv are known (stick: minus the instant the stick began; slip: mu k_n;
    separation: 0), so a block of the Jacobian is a difference of prefix sums of basis products.
    x : (n_pair, n_component, n_coeff) [m]; memory : (n_pair, n_component - 1) slider positions at the start [m]"""
    n_pair, n_comp, n_coeff = x.shape
    samples = basis.to_time(x)
    force, status = np.empty_like(samples), np.zeros(n_pair, np.int64)
    jac = np.zeros((n_pair if jacobian else 0, n_comp * n_coeff, n_comp * n_coeff))
    _cycle(samples, parameters.packed(), memory, basis.synthesis, *basis.prefix_sums, force, jac, status)
    return ContactCycle(basis.from_time(force), jac if jacobian else None, status)


@numba.njit(cache=True)
def _cycle(x, p, memory, phi, product, single, force, jac, status):
    n_pair, n_comp, n_time = x.shape
    has_slope = jac.shape[0] > 0
    kind, slider, no_slope = np.empty(n_time, np.int8), np.empty(n_time), np.empty((0, 0))
    for i in range(n_pair):
        slope = jac[i] if has_slope else no_slope
        k = p[i, :n_comp]
        status[i] = element(k, p[i, 4], p[i, 3], memory[i], x[i], phi, product, single, force[i], slope, kind, slider)


@compiled
def element(k, mu, gap, memory, x, phi, product, single, force, jac, kind, slider):
    """The cycle of one element; writes its force (n_component, n_samples), adds to its Jacobian, returns the bits.

    k : (n_component,) [N/m]; memory : (n_component - 1,); x : (n_component, n_samples); an empty jac is not asked for
    kind, slider : (n_samples,) to work on"""
    n_comp, n_time = x.shape
    t = n_comp - 1
    want = jac.shape[0] > 0
    kn, n_open, v, pressed = k[t], 0, x[t], force[t]
    for j in range(n_time):
        N = kn * (v[j] - gap)
        pressed[j] = N if N > 0.0 else 0.0
        n_open += N <= 0.0
    bits = SEPARATES if n_open > 0 else 0
    if want and n_open < n_time:
        _add_normal(kn, n_open, pressed, product, t, jac)
    for c in range(t):
        if n_open == n_time:
            force[c, :] = 0.0
            continue
        origin, sense = _march(k[c], mu, memory[c], x[c], pressed, force[c], kind, slider)
        bits |= _add_tangential(k[c], mu * kn, kind, origin, sense, c, t, phi, product, single, want, jac)
    return bits


@compiled
def _add_normal(kn, n_open, N, product, t, jac):
    """d N / d v : k_n while closed."""
    n_time = N.size
    m = product.shape[1]
    o = t * m
    if n_open == 0:
        for a in range(m):
            jac[o + a, o + a] += kn
        return
    j = 0
    while j < n_time:
        if not N[j] > 0.0:  # no number either
            j += 1
            continue
        start = j
        while j < n_time and N[j] > 0.0:
            j += 1
        for a in range(m):
            for b in range(m):
                jac[o + a, o + b] += kn * (product[j, a, b] - product[start, a, b])


@compiled
def _march(kt, mu, w, u, N, T, kind, slider):
    """One slider over its periodic cycle: force T, kind of every sample and slider position after it.

    The period map is a clamp, so the first cycle settles the memory; the second is marched until it meets the first.
    Returns the last sample of the first cycle that does not stick, which decides where the slider stands, and its kind;
    -1 where the slider stands where the load path left it"""
    origin, sense = -1, OPEN
    for turn in range(2):
        for j in range(u.size):
            if N[j] <= 0.0:
                w, T[j], kind[j] = u[j], 0.0, OPEN
            else:
                pull, limit = kt * (u[j] - w), mu * N[j]
                if pull > limit:
                    T[j], kind[j] = limit, FORWARD
                    w = u[j] - limit / kt
                elif pull < -limit:
                    T[j], kind[j] = -limit, BACKWARD
                    w = u[j] + limit / kt
                else:
                    T[j], kind[j] = pull, STICK
            if turn == 1 and slider[j] == w:
                break
            slider[j] = w
            if turn == 0 and kind[j] != STICK:
                origin, sense = j, kind[j]
    return origin, sense


@compiled
def _add_tangential(kt, slope, kind, origin, sense, c, t, phi, product, single, want, jac):
    """The status bits of one slider and, if wanted, d T / d u and d T / d v, one segment after the other.

    `origin` is the sample where the present stick began, `side` the slope of the slip before it (0: separation)."""
    n_time, m = phi.shape
    o, on = c * m, t * m
    if origin < 0:
        if want:
            for a in range(m):
                jac[o + a, o + a] += kt
        return STICKS
    side = slope * SIDE[sense]
    start, bits = 0, 0
    for j in range(1, n_time + 1):
        now = kind[start]
        if j < n_time and kind[j] == now:
            continue
        first, last = product[start], product[j]
        bits |= STICKS if now == STICK else 0 if now == OPEN else SLIPS
        if not want:
            pass
        elif now == STICK:
            for a in range(m):
                weight = single[j, a] - single[start, a]
                for b in range(m):
                    jac[o + a, o + b] += kt * (last[a, b] - first[a, b] - weight * phi[origin, b])
                    jac[o + a, on + b] += side * weight * phi[origin, b]
        else:
            origin, side = j - 1, slope * SIDE[now]
            if now != OPEN:
                for a in range(m):
                    for b in range(m):
                        jac[o + a, on + b] += side * (last[a, b] - first[a, b])
        start = j
    return bits
