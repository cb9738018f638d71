"""Iwan's joint of four parameters: Jenkins elements side by side, most of them weak, under a variable normal load.

Before full slip a pair holds F(u) = k u - c u^(chi + 2): its loss over a cycle grows with the power chi + 3 of the
amplitude, so that its damping ratio grows with the power chi + 1; chi = 0 is a density of slip limits that is finite at
zero. By Segalman: F_S = mu N with the normal force N of the pair, K_T its tangential stiffness, chi the exponent, and
beta = (1 - weak) / weak. The distribution has SLIDERS - 1 cells in geometric progression, each with the stiffness and
the slip force of its part, and one slider for the pinning force that all of it reaches at once. From 0.02 of the
largest reach on, the loss is within 7 % of that of the whole distribution, the force within 2 %.
Source  Iwan 1966; Segalman, J. Appl. Mech. 72 (2005) 752; cells of equal ratio after it, their midpoints ours"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numba
import numpy as np

from tribodyn.declarations import number
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactCycle, ContactParameters
from tribodyn.hbm.contact.laws import jenkins
from tribodyn.hbm.harmonics import HarmonicBasis

COMPONENTS = jenkins.COMPONENTS
LINEAR_WHERE_STUCK = True
SLIDERS = 16  # of a pair in one direction
RATIO = 1.4  # of the reach of a slider over that of the one before


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    friction: float = number("", role="friction", low=0.0, usual=(0.0, 1.5))
    """Coulomb coefficient of full slip."""
    weak: float = number("", default=1.0, low=0.0, high=1.0)
    """Share of the tangential stiffness that the weak sliders have, 1 / (1 + beta); 0 for one Jenkins element."""
    exponent: float = number("", default=0.0, above=-1.0, high=2.0)
    """Exponent chi of the density of slip limits."""


def n_state(components: tuple[str, ...]) -> int:
    """Slider positions in each tangential direction [m], slider by slider."""
    return SLIDERS * (len(components) - 1)


@numba.njit(cache=True)
def _slider(j, weak, chi):
    """Share of the stiffness of slider j, and its reach over that of a pair that is one Jenkins element."""
    mean = (chi + 1) / (chi + 2)  # reach of all weak sliders together over the largest
    largest = 1 / (1 - weak + weak * mean)  # as all limits add to mu N
    if j == SLIDERS - 1:
        return 1 - weak, largest
    high = RATIO ** (j + 2 - SLIDERS)
    low = high / RATIO if j > 0 else 0.0
    share = high ** (chi + 1) - low ** (chi + 1)
    return weak * share, largest * mean * (high ** (chi + 2) - low ** (chi + 2)) / share


@numba.njit(cache=True)
def _count(weak):
    """Number of sliders with a stiffness."""
    return (SLIDERS - 1) * (weak > 0) + (weak < 1)


@numba.njit(cache=True)
def step(x, w, p, f, dfx, dfs, dsx, dss):
    """Advance one pair by one sample; writes force, memory and their derivatives, returns the status bits."""
    t, weak, chi = x.size - 1, p[5], p[6]
    n = _count(weak)
    kn = 1 / n * p[t]  # of one slider, as in `_cycle`
    N = kn * (x[t] - p[3])
    f[:] = 0.0
    f[t] = max(n * N, 0.0)
    dfx[t, t] = p[t] if N > 0.0 else 0.0
    bits = 0 if N > 0.0 else SEPARATES
    for j in range(SLIDERS):
        share, reach = _slider(j, weak, chi)
        mu = share * reach * n * p[4]
        for c in range(t):
            r, kt = j * t + c, share * p[c]
            T = kt * (x[c] - w[r])
            if N <= 0.0 or share == 0.0:
                w[r] = x[c]
                dsx[r, c] = 1.0
            elif abs(T) <= mu * N:
                f[c] += T
                dfx[c, c] += kt
                dfs[c, r] = -kt
                dss[r, r] = 1.0
                bits |= STICKS
            else:
                sign = 1.0 if T > 0.0 else -1.0
                f[c] += sign * mu * N
                dfx[c, t] += sign * mu * kn
                w[r] = x[c] - sign * mu * N / kt
                dsx[r, c] = 1.0
                dsx[r, t] = -sign * mu * kn / kt
                bits |= SLIPS
    return bits


@numba.njit(cache=True)
def _sliders(weak, chi):
    """(n_pair, SLIDERS) shares and reaches."""
    share, reach = np.empty((weak.size, SLIDERS)), np.empty((weak.size, SLIDERS))
    for i in range(weak.size):
        for j in range(SLIDERS):
            share[i, j], reach[i, j] = _slider(j, weak[i], chi[i])
    return share, reach


def _cycle(
    of_elements: Callable[..., ContactCycle],
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool,
) -> ContactCycle:  # fmt: skip
    """The sum of the cycles of all Jenkins elements with a stiffness; each has its part of the normal spring."""
    numbers, n_t = parameters.numbers, len(parameters.components) - 1
    share, reach = _sliders(numbers["weak"], numbers["exponent"])
    pair, slider = np.nonzero(share)
    first, n_active = np.flatnonzero(np.diff(pair, prepend=-1)), np.count_nonzero(share, axis=1)
    scale = np.full((len(pair), n_t + 1), 1 / n_active[pair, None])
    scale[:, :-1] = share[pair, slider, None]
    friction = (share * reach * n_active[:, None] * numbers["friction"][:, None])[pair, slider]
    elements = replace(parameters.subset(pair), numbers={"friction": friction})
    elements = replace(elements, stiffness=scale * elements.stiffness)
    rest = np.ascontiguousarray(memory.reshape(-1, SLIDERS, n_t)[pair, slider])
    cycle = of_elements(x[pair], elements, rest, basis, jacobian)
    slope = np.add.reduceat(cycle.slope, first) if jacobian else None
    return ContactCycle(np.add.reduceat(cycle.force, first), slope, np.bitwise_or.reduceat(cycle.status, first))


def sampled_cycle(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool = True
) -> ContactCycle:
    """The periodic cycle at the samples of the basis."""
    return _cycle(jenkins.sampled_cycle, x, parameters, memory, basis, jacobian)


def event_based_cycle(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, jacobian: bool = True
) -> ContactCycle:
    """The periodic cycle with the transitions of every slider located between samples."""
    return _cycle(jenkins.event_based_cycle, x, parameters, memory, basis, jacobian)
