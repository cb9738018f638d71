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
import sys
from dataclasses import dataclass

import numba
import numpy as np

from tribodyn.declarations import number
from tribodyn.hbm.contact import aft, planar_cycle
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

    Where a pair has unequal springs, or no friction, all step implicitly.
    x : (n_pair, 3, n_coeff) [m]; memory : (n_pair, 2) sliders at the start [m]"""
    k = parameters.stiffness
    if ((k[:, 0] == k[:, 1]) & (k[:, 0] > 0) & (parameters.numbers["friction"] > 0)).all():
        return planar_cycle.cycle(x, parameters, memory, basis, jacobian)
    return aft.march(sys.modules[__name__], x, parameters, memory, basis, jacobian)
