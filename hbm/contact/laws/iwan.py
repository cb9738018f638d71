"""Iwan's joint of four parameters: Jenkins elements side by side, most of them weak, under a variable normal load.

Before full slip a pair holds F(u) = k u - c u^(chi + 2), so that its damping ratio grows with the power chi + 1 of the
amplitude; at chi = 0 the density of slip limits is finite at zero. By Segalman F_S = mu N, K_T = k, and beta =
(1 - weak) / weak. The density is split into SLIDERS - 1 cells in geometric progression, each with the stiffness and
slip force of its part; one slider more has the rest, which slips last. From 0.02 of the largest reach on, the loss of a
cycle is within 10 % of that of the density itself.
Source  Iwan 1966; Segalman, J. Appl. Mech. 72 (2005) 752"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numba
import numpy as np

from tribodyn.declarations import number
from tribodyn.hbm.contact.compiled_law import stamp_with
from tribodyn.hbm.contact.contact_law import ContactCycle, ContactParameters
from tribodyn.hbm.contact.laws import jenkins
from tribodyn.hbm.harmonics import HarmonicBasis

COMPONENTS = jenkins.COMPONENTS
LINEAR_WHERE_STUCK = True
SLIDERS = 16  # of a pair in one direction
RATIO = 1.4  # of the reach of a slider over that of the one before


@dataclass(frozen=True)
class Parameters(jenkins.Parameters):
    """The law's own numbers; friction is that of full slip."""

    weak: float = number("", default=1.0, low=0.0, high=1.0)
    """Share of the tangential stiffness that slips bit by bit, 1 / (1 + beta); 0 for one Jenkins element."""
    exponent: float = number("", default=0.0, above=-1.0, high=2.0)
    """Exponent chi of the density of slip limits."""


def n_state(components: tuple[str, ...]) -> int:
    """Slider positions in each tangential direction [m], slider by slider."""
    return SLIDERS * (len(components) - 1)


@numba.njit(cache=True)
def _slider(j, weak, chi):
    """Share of the stiffness of slider j, and its reach over that of a pair that is one Jenkins element."""
    mean = (chi + 1) / (chi + 2)  # reach of the density as a whole over the largest
    largest = 1 / (1 - weak + weak * mean)  # as all limits add to mu N
    if j == SLIDERS - 1:
        return 1 - weak, largest
    high = RATIO ** (j + 2 - SLIDERS)
    low = high / RATIO if j > 0 else 0.0
    share = high ** (chi + 1) - low ** (chi + 1)
    return weak * share, largest * mean * (high ** (chi + 2) - low ** (chi + 2)) / share


@numba.njit(cache=True)
def step(x, w, p, f, dfx, dfs, dsx, dss):
    """Advance one pair by one sample; writes force, memory and their derivatives, returns the status bits."""
    t, n = x.size - 1, (SLIDERS - 1) * (p[5] > 0) + (p[5] < 1)  # sliders with a stiffness
    q, g, bits = np.empty(5), np.empty(t + 1), 0
    f[:] = 0.0
    for j in range(SLIDERS):
        share, reach = _slider(j, p[5], p[6])
        if share == 0.0:
            continue
        q[:t], q[t], q[3], q[4] = share * p[:t], 1 / n * p[t], p[3], share * reach * n * p[4]  # as in `_cycle`
        rows = slice(j * t, (j + 1) * t)
        dgx, dgs, dwx, dww = np.zeros((t + 1, t + 1)), np.zeros((t + 1, t)), np.zeros((t, t + 1)), np.zeros((t, t))
        bits |= jenkins.step(x, w[rows], q, g, dgx, dgs, dwx, dww)
        f += g
        dfx += dgx
        dfs[:, rows], dsx[rows], dss[rows, rows] = dgs, dwx, dww
    return bits


def _cycle(
    of_elements: Callable[..., ContactCycle], x: np.ndarray, parameters: ContactParameters, memory: np.ndarray,
    basis: HarmonicBasis, jacobian: bool = True,
) -> ContactCycle:  # fmt: skip
    """The sum of the cycles of all Jenkins elements with a stiffness; each has its part of the normal spring."""
    n_t = len(parameters.components) - 1
    shapes = np.stack([parameters.numbers[name] for name in ("weak", "exponent")], axis=1)
    kinds, kind = np.unique(shapes, axis=0, return_inverse=True)
    sliders = np.array([[_slider(j, *numbers) for j in range(SLIDERS)] for numbers in kinds.tolist()])[kind]
    pair, slider = np.nonzero(sliders[..., 0])
    first, n_active = np.flatnonzero(np.diff(pair, prepend=-1)), np.bincount(pair)[pair]
    share, reach = sliders[pair, slider].T
    scale = np.append(np.repeat(share[:, None], n_t, axis=1), 1 / n_active[:, None], axis=1)
    elements = parameters.subset(pair)
    friction = share * reach * n_active * elements.numbers["friction"]
    elements = replace(elements, stiffness=scale * elements.stiffness, numbers={"friction": friction})
    rest = np.ascontiguousarray(memory.reshape(-1, SLIDERS, n_t)[pair, slider])
    cycle = of_elements(x[pair], elements, rest, basis, jacobian)
    slope = np.add.reduceat(cycle.slope, first) if jacobian else None
    return ContactCycle(np.add.reduceat(cycle.force, first), slope, np.bitwise_or.reduceat(cycle.status, first))


sampled_cycle = partial(_cycle, jenkins.sampled_cycle)
event_based_cycle = partial(_cycle, jenkins.event_based_cycle)  # transitions of every slider located
stamp_with(globals(), jenkins)
