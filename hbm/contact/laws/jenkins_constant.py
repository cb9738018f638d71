"""Jenkins elements with a constant normal load: one or two uncoupled tangential directions.

Each tangential spring k_t drags a slider w that holds |T| <= mu N_0; N_0 = 0 is no contact.
Source  Griffin 1980; Tamatam 2021, eq. 3.26-3.28 with N constant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from tribodyn.declare import number
from tribodyn.hbm.contact import located as transitions
from tribodyn.hbm.contact.aft import by_kernel
from tribodyn.hbm.contact.law import SEPARATES, SLIPS, STICKS, ContactCycle, ContactParameters
from tribodyn.hbm.harmonics import HarmonicBasis

COMPONENTS = (("t1", "t2"), ("t1",), ("t2",))
LINEAR_WHERE_STUCK = True

located = transitions.cycle


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    friction: float = number("", low=0.0)
    """Coulomb coefficient."""
    normal_load: float = number("N", low=0.0)
    """Constant normal load of every pair, 0 for no contact."""


def n_state(components: tuple[str, ...]) -> int:
    """One slider position per tangential direction [m]."""
    return len(components)


@numba.njit(cache=True)
def step(x, w, p, f, dfx, dfs, dsx, dss):
    """Advance one pair by one sample; writes force, memory and their derivatives, returns the status bits."""
    limit = p[4] * p[5]  # mu N_0
    bits = 0
    for c in range(x.size):
        kt = p[c]
        T = kt * (x[c] - w[c])
        if p[5] <= 0.0:
            f[c] = 0.0
            w[c] = x[c]
            dsx[c, c] = 1.0
            bits |= SEPARATES
        elif abs(T) <= limit:
            f[c] = T
            dfx[c, c] = kt
            dfs[c, c] = -kt
            dss[c, c] = 1.0
            bits |= STICKS
        else:
            f[c] = limit if T > 0.0 else -limit
            w[c] = x[c] - f[c] / kt
            dsx[c, c] = 1.0
            bits |= SLIPS
    return bits


def cycle(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool = True
) -> ContactCycle:
    """The periodic cycle at the samples of the basis; in a stick, dT/du = k_t minus the instant the stick began.

    x : (n_pair, n_component, n_coeff) [m]; memory : (n_pair, n_component) slider positions at the start [m]
    """
    return by_kernel(_cycle, x, parameters, memory, basis, jacobian)


@numba.njit(cache=True)
def _cycle(x, p, memory, phi, product, single, force, jac, status):
    n_pair, n_comp, _ = x.shape
    for i in range(n_pair):
        if p[i, 5] <= 0.0:
            force[i] = 0.0
            status[i] = SEPARATES
            continue
        for c in range(n_comp):
            limit = p[i, 4] * p[i, 5]
            status[i] |= _slider(p[i, c], limit, i, c, memory[i, c], x, phi, product, single, force, jac)


@numba.njit(cache=True)
def _slider(kt, limit, i, c, w, x, phi, product, single, force, jac):
    """One slider over two cycles: the first settles the memory (the period map is a clamp), the second is kept."""
    n_time = x.shape[2]
    origin = -1  # sample of the last slip; none yet: the slider stands where the load path left it
    for j in range(n_time):
        T = kt * (x[i, c, j] - w)
        if abs(T) > limit:
            w = x[i, c, j] - (limit if T > 0.0 else -limit) / kt
            origin = j
    bits = 0
    start = -1  # first sample of the running stick, -1 while slipping
    stick_origin = -1
    for j in range(n_time):
        T = kt * (x[i, c, j] - w)
        if abs(T) <= limit:
            force[i, c, j] = T
            bits |= STICKS
            if start < 0:
                start, stick_origin = j, origin
            continue
        force[i, c, j] = limit if T > 0.0 else -limit
        w = x[i, c, j] - force[i, c, j] / kt
        bits |= SLIPS
        origin = j
        if start >= 0:
            _add_stick(kt, i, c, start, j, stick_origin, phi, product, single, jac)
            start = -1
    if start >= 0:
        _add_stick(kt, i, c, start, n_time, stick_origin, phi, product, single, jac)
    return bits


@numba.njit(cache=True)
def _add_stick(kt, i, c, start, stop, origin, phi, product, single, jac):
    """d T / d u of one stick over the samples [start, stop)."""
    if jac.shape[0] == 0:
        return
    m = product.shape[1]
    o = c * m
    if origin < 0 and start == 0 and stop == phi.shape[0]:
        for a in range(m):
            jac[i, o + a, o + a] = kt
        return
    for a in range(m):
        weight = single[stop, a] - single[start, a]
        for b in range(m):
            jac[i, o + a, o + b] += kt * (product[stop, a, b] - product[start, a, b])
            if origin >= 0:
                jac[i, o + a, o + b] -= kt * weight * phi[origin, b]
