"""Jenkins elements stepped through the cycle from sample to sample, to hold the solver's contact forces against.

Plain and slow on purpose: nothing is shared with hbm.contact.
"""

from __future__ import annotations

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State

FINE = 2048  # samples where the solver locates its transitions
LONGEST = 50  # cycles after which the sliders must repeat
ROUNDING = 1e-11  # of all that adds up to a force


def force_error(balance: HarmonicBalance, state: State) -> tuple[float, float]:
    """Relative difference of the contact forces from marched ones, and how large it may be.

    At the samples that the solver has too it is rounding; where it locates its transitions the march is late by up to a
    sample at each, and no force changes faster than its spring.
    """
    located = balance.basis.transitions == "located"
    n = max(FINE, 16 * balance.basis.harmonics[-1]) if located else balance.basis.n_samples
    angle = 2 * np.pi * np.arange(n) / n
    order = balance.basis.order
    phi = _columns(angle, order)
    u = state.x @ phi.T
    force = _march(balance, u)
    weight = np.where(order == 0, 1.0, 2.0) / n
    found = force @ (phi * weight)
    p = balance.contact.only("this check").parameters
    k, mu, gap = p.stiffness, p.numbers["friction"], p.gap
    across = np.abs(u).max(axis=2)
    across[:, -1] += np.abs(gap)
    size = float(np.linalg.norm(k * across))
    off = float(np.linalg.norm(found - state.cycle.force)) / max(size, 1e-300)
    if not located:
        return off, ROUNDING
    speed = np.abs(np.diff(u, axis=2, append=u[:, :, :1])).max(axis=2)  # [m] in a sample
    late = k * speed
    late[:, :-1] += mu[:, None] * late[:, -1:]
    return off, ROUNDING + 2 * float(np.linalg.norm(late)) / max(size, 1e-300)


def _columns(angle: np.ndarray, order: np.ndarray) -> np.ndarray:
    """(n_angle, n_coeff) 1, cos h a, sin h a as the coefficients stand."""
    columns = []
    for position, h in enumerate(order):
        if h == 0:
            columns.append(np.ones_like(angle))
        else:
            first = list(order).index(h) == position
            columns.append(np.cos(h * angle) if first else np.sin(h * angle))
    return np.stack(columns, axis=1)


def _march(balance: HarmonicBalance, u: np.ndarray) -> np.ndarray:
    """Forces (n_pair, n_component, n) [N] of a cycle that repeats, under displacements u of the same shape [m]."""
    p = balance.contact.only("this check").parameters
    k_t, k_n, mu = p.stiffness[:, :-1], p.stiffness[:, -1], p.numbers["friction"]
    normal = np.maximum(k_n[:, None] * (u[:, -1] - p.gap[:, None]), 0.0)
    force = np.empty_like(u)
    force[:, -1] = normal
    slider = balance.memory.copy()
    for _ in range(LONGEST):
        before = slider.copy()
        for j in range(u.shape[2]):
            drag = k_t * (u[:, :-1, j] - slider)
            most = (mu * normal[:, j])[:, None]
            held = np.clip(drag, -most, most)
            force[:, :-1, j] = held
            with np.errstate(divide="ignore", invalid="ignore"):
                slid = np.where(np.abs(drag) > most, u[:, :-1, j] - held / k_t, slider)
            slider = np.where(normal[:, j, None] > 0, slid, u[:, :-1, j])
        if np.abs(slider - before).max() <= 1e-13 * np.abs(u).max():
            break
    return force
