"""Jenkins elements with variable normal load: one or two uncoupled tangential directions and a unilateral normal one.

N = max(k_n (v - gap), 0); each tangential spring k_t drags a slider w that holds |T| <= mu N and lets go when N = 0.
Source  Yang, Chu and Menq 1998; Tamatam 2021, eq. 3.24-3.28.
"""

from __future__ import annotations

import numba
import numpy as np

from hbm import located as transitions
from hbm.harmonics import HarmonicBasis
from hbm.law import SEPARATES, SLIPS, STICKS, ContactCycle, ContactParameters

COMPONENTS = (("t1", "t2", "n"), ("t1", "n"), ("t2", "n"))

located = transitions.cycle


def n_state(components: tuple[str, ...]) -> int:
    """One slider position per tangential direction [m]."""
    return len(components) - 1


@numba.njit(cache=True)
def step(x, w, p, f, dfx, dfs, dsx, dss):
    """Advance one pair by one sample; writes force, memory and their derivatives, returns the status bits."""
    t = x.size - 1
    kn, mu = p[t], p[3]
    N = kn * (x[t] - p[4])  # eq. 3.24
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


def cycle(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool = True
) -> ContactCycle:
    """The periodic cycle at the samples of the basis, with the Jacobian in closed form between transitions.

    Between two transitions dT/du and dT/dv are known (stick: minus the instant the stick began; slip: mu k_n;
    separation: 0), so a block of the Jacobian is a difference of prefix sums of basis products.
    x : (n_pair, n_component, n_coeff) [m]; memory : (n_pair, n_component - 1) slider positions at the start [m]
    """
    n_pair, n_comp, n_coeff = x.shape
    samples = basis.to_time(x)
    force = np.empty_like(samples)
    jac = np.zeros((n_pair, n_comp * n_coeff, n_comp * n_coeff)) if jacobian else np.zeros((0, 0, 0))
    status = np.empty(n_pair, np.int64)
    product, single = basis.prefix_sums
    _cycle(samples, parameters.packed(), memory, basis.synthesis, product, single, force, jac, status)
    return ContactCycle(basis.from_time(force), jac if jacobian else None, status)


@numba.njit(cache=True)
def _cycle(x, p, memory, phi, product, single, force, jac, status):
    n_pair, n_comp, n_time = x.shape
    n_coeff = phi.shape[1]
    t = n_comp - 1
    want = jac.shape[0] > 0
    for i in range(n_pair):
        kn, mu, gap = p[i, t], p[i, 3], p[i, 4]
        bits = 0
        n_open = 0
        for j in range(n_time):
            N = kn * (x[i, t, j] - gap)
            force[i, t, j] = N if N > 0.0 else 0.0
            if N <= 0.0:
                n_open += 1
        if n_open > 0:
            bits |= SEPARATES
        if want and n_open < n_time:
            _add_normal(kn, n_open, i, t, force, product, jac)
        if n_open < n_time:
            for c in range(t):
                bits |= _tangential(p[i, c], mu, kn, i, c, t, memory[i, c], x, phi, product, single, force, jac)
        else:
            for c in range(t):
                force[i, c, :] = 0.0
        status[i] = bits
    return n_coeff


@numba.njit(cache=True)
def _add_normal(kn, n_open, i, t, force, product, jac):
    """d N / d v : k_n while closed."""
    n_time = force.shape[2]
    m = product.shape[1]
    o = t * m
    if n_open == 0:
        for a in range(m):
            jac[i, o + a, o + a] = kn
        return
    j = 0
    while j < n_time:
        if force[i, t, j] <= 0.0:
            j += 1
            continue
        start = j
        while j < n_time and force[i, t, j] > 0.0:
            j += 1
        for a in range(m):
            for b in range(m):
                jac[i, o + a, o + b] += kn * (product[j, a, b] - product[start, a, b])


@numba.njit(cache=True)
def _tangential(kt, mu, kn, i, c, t, w0, x, phi, product, single, force, jac):
    """One slider over two cycles: the first settles the memory (the period map is a clamp), the second is kept.

    `origin` is the sample where the present stick began, `side` the sign of the slip before it (0: separation).
    """
    n_time = x.shape[2]
    want = jac.shape[0] > 0
    w = w0
    origin = -1  # no transition met yet: the slider stands where the load path left it
    side = 0.0
    for j in range(n_time):
        N = force[i, t, j]
        if N <= 0.0:
            w = x[i, c, j]
            origin, side = j, 0.0
        else:
            T = kt * (x[i, c, j] - w)
            if abs(T) > mu * N:
                side = 1.0 if T > 0.0 else -1.0
                w = x[i, c, j] - side * mu * N / kt
                origin = j
    bits = 0
    start = 0
    kind, kind_origin, kind_side = -1, -1, 0.0  # of the running segment: 0 separation, 1 stick, 2 slip
    for j in range(n_time + 1):
        now = -1
        if j < n_time:
            N = force[i, t, j]
            if N <= 0.0:
                now = 0
                w = x[i, c, j]
                force[i, c, j] = 0.0
                origin, side = j, 0.0
            else:
                T = kt * (x[i, c, j] - w)
                if abs(T) > mu * N:
                    now = 2
                    side = 1.0 if T > 0.0 else -1.0
                    T = side * mu * N
                    w = x[i, c, j] - T / kt
                    origin = j
                    bits |= SLIPS
                else:
                    now = 1
                    bits |= STICKS
                force[i, c, j] = T
        if now == kind and (now != 2 or side == kind_side):
            continue
        if want and kind > 0:
            _add_tangential(kind, kt, mu * kn * kind_side, i, c, t, start, j, kind_origin, phi, product, single, jac)
        start, kind, kind_origin, kind_side = j, now, origin, side
    return bits


@numba.njit(cache=True)
def _add_tangential(kind, kt, slope, i, c, t, start, stop, origin, phi, product, single, jac):
    """d T / d u and d T / d v of one segment of samples [start, stop)."""
    m = product.shape[1]
    n_time = phi.shape[0]
    o, on = c * m, t * m
    if kind == 2:
        for a in range(m):
            for b in range(m):
                jac[i, o + a, on + b] += slope * (product[stop, a, b] - product[start, a, b])
        return
    if origin < 0 and start == 0 and stop == n_time:
        for a in range(m):
            jac[i, o + a, o + a] = kt
        return
    for a in range(m):
        weight = single[stop, a] - single[start, a]
        for b in range(m):
            jac[i, o + a, o + b] += kt * (product[stop, a, b] - product[start, a, b])
            if origin >= 0:
                jac[i, o + a, o + b] -= kt * weight * phi[origin, b]
                jac[i, o + a, on + b] += slope * weight * phi[origin, b]
