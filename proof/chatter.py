"""Chattering: when pairs open and close within a cycle, how long they touch, how fast they meet.

The normal approach of a pair is a trigonometric polynomial of its harmonics, so its openings and closings are the roots
of that polynomial on the unit circle: found exactly, whatever the number of time samples."""

from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.harmonics import HarmonicBasis

CIRCLE_DISTANCE = 1e-6  # from the unit circle, within which a root is an instant: a double root is good to 1e-8
NO_OVERLAP = 1e-13  # relative to the largest amplitude: rounding


@dataclass(frozen=True)
class Chatter:
    """What every pair does in one cycle.

    omega : [rad/s]
    touching : (n_pair,) share of the cycle in contact, 1 where the pair never opens and 0 where it never closes
    opening, closing : instants of separation and of impact [s], one array per pair, from 0 to the period
    approach : approach velocity at each of the closings [m/s], one array per pair"""

    omega: float
    touching: np.ndarray
    opening: tuple[np.ndarray, ...]
    closing: tuple[np.ndarray, ...]
    approach: tuple[np.ndarray, ...]

    @property
    def impact_velocity(self) -> np.ndarray:
        """(n_pair,) largest approach velocity at an impact, 0 without one [m/s]."""
        return np.array([speeds.max(initial=0.0) for speeds in self.approach])

    @property
    def contact_duration(self) -> np.ndarray:
        """(n_pair,) time in contact during one cycle [s]."""
        return self.touching * 2 * np.pi / self.omega


def chatter(balance: HarmonicBalance, state: State) -> Chatter:
    """Chattering of a balance state.

    Raises  ValueError where the law has no normal component"""
    components = balance.contact.components
    if "n" not in components:
        raise ValueError("chattering needs a contact law with a normal component: take components with n")
    basis, gap = balance.basis, balance.contact.gap
    approach = state.x[:, components.index("n")]
    touching, opening, closing, speed = [], [], [], []
    for coefficients, level in zip(approach, gap, strict=True):
        angles = sign_changes(basis, coefficients, level)
        velocity = state.omega * (basis.functions(angles) @ (basis.rate.T @ coefficients))
        shut = velocity > 0.0
        ends = np.append(angles[1:], angles[:1] + 2 * np.pi) if len(angles) else np.array([2 * np.pi])
        starts = angles if len(angles) else np.zeros(1)
        closed = basis.functions(0.5 * (starts + ends)) @ coefficients > level
        touching.append(float((ends - starts)[closed].sum() / (2 * np.pi)))
        opening.append(angles[~shut] / state.omega)
        closing.append(angles[shut] / state.omega)
        speed.append(velocity[shut])
    return Chatter(state.omega, np.array(touching), tuple(opening), tuple(closing), tuple(speed))


def sign_changes(basis: HarmonicBasis, coefficients: np.ndarray, level: float = 0.0) -> np.ndarray:
    """Angles in [0, 2 pi), ascending, at which sum_h a_h cos h t + b_h sin h t passes a level; grazing is no passage.

    coefficients : (n_coeff,)"""
    top = basis.harmonics[-1]
    amplitudes = basis.to_complex(coefficients)
    polynomial = np.zeros(2 * top + 1, complex)  # of z = exp(i t), times z^top
    for h, amplitude in zip(basis.harmonics, amplitudes, strict=True):
        polynomial[top + h] += 0.5 * amplitude
        polynomial[top - h] += 0.5 * np.conj(amplitude)
    polynomial[top] -= level
    size = np.abs(polynomial).max()
    if size == 0.0:
        return np.empty(0)
    polynomial[np.abs(polynomial) < 1e-15 * size] = 0.0
    roots = np.roots(polynomial[::-1])
    angles = np.sort(np.angle(roots[np.abs(np.abs(roots) - 1) < CIRCLE_DISTANCE]) % (2 * np.pi))
    if len(angles) < 2:
        return np.empty(0)
    between = 0.5 * (angles + np.append(angles[1:], angles[0] + 2 * np.pi))
    value = basis.functions(between) @ coefficients - level
    real = np.abs(value) > NO_OVERLAP * size  # else two roots that rounding has torn apart
    side = np.sign(value[real])
    if len(side) == 0:
        return np.empty(0)
    before = np.concatenate([side[-1:], side[:-1]])
    return angles[real][side != before]
