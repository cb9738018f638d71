"""Forces of a flow on the vibrating blades of a wheel, by influence coefficients of one family of modes.

With a_n the amplitude of the family's mode on sector n, and unit modal mass and frequency w_j of the stuck wheel,

    a_n'' + w^2 (a_n + sum_k c_k a_(n+k)) = 0,    c(j) = sum_k c_k exp(-i 2 pi j k / N),

so that a wave of index j has the aerodynamic damping ratio Im c(j) / 2 and the relative shift of frequency Re c(j) / 2,
as a flow solver gives them. The coefficients hold at w_j. In time they are forces by displacement and by velocity with
real circulant matrices: what is even in j is a symmetric stiffness Re c and damping Im c / w, what is odd a skew one,
circulatory Im c and gyroscopic Re c / w.
Source  influence coefficients: Hanamura, Tanaka and Yamaguchi 1980; eigenvalues by nodal diameter: Whitehead 1966,
Crawley 1988 (AGARD-AG-298, chapter 19); the matrices in time are ours"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.reduction.wave_model import WaveModel


@dataclass(frozen=True)
class Flow:
    """Influence coefficients of a family of modes.

    influence : distance k of the blade that moves, positive on the left -> c_k, dimensionless
    mode : number of the family, from 0, among the modes of the stuck wheel at each index"""

    influence: Mapping[int, complex] = field(default_factory=dict)
    mode: int = 0

    def of_index(self, index: int, n_sectors: int) -> complex:
        """c(j): Im c / 2 is the aerodynamic damping ratio of the wave, Re c / 2 its relative shift of frequency."""
        turn = -2j * np.pi * index / n_sectors
        return complex(sum(c * np.exp(turn * (k % n_sectors)) for k, c in self.influence.items()))

    def scaled(self, factor: float) -> Flow:
        """The same with all coefficients times a factor, such as the density of the gas."""
        return replace(self, influence={k: factor * c for k, c in self.influence.items()})


def with_flow(wave: WaveModel, springs: np.ndarray, flow: Flow) -> WaveModel:
    """A travelling wave with the forces of a flow; springs : (n_pair, n_component) of stuck contacts [N/m]."""

    def flown(index: int, system: SecondOrderSystem, B: np.ndarray) -> SecondOrderSystem:
        _, omega, shape = family(system, np.asarray(B), springs, flow.mode)
        parts = parts_of(flow, index, wave.n_sectors, omega)
        force = np.asarray(system.mass) @ shape
        return added(system, *(part * np.outer(force, force.conj()) for part in parts))

    return wave.with_index_systems(flown)


def family(
    system: SecondOrderSystem, B: np.ndarray, springs: np.ndarray, mode: int
) -> tuple[np.ndarray, float, np.ndarray]:
    """Stuck stiffness, frequency [rad/s] and mass-normalised shape (n,) of one mode of an index."""
    stuck = stuck_stiffness(np.asarray(system.stiffness), B, springs)
    square, shape = sla.eigh(stuck, np.asarray(system.mass), subset_by_index=(mode, mode))
    return stuck, float(np.sqrt(square[0])), shape[:, 0]


def aeroelastic(wave: WaveModel, springs: np.ndarray, flow: Flow, n_modes: int = 20) -> dict[int, complex]:
    """Eigenvalue lambda [1/s] of the family's wave with the stuck wheel in the flow, for every index from -N/2 + 1.

    wave : with its damping and Coriolis forces, without the flow; n_modes : modes of each index that take part
    The frequency is Im lambda > 0: the wave of index j runs with the rotation for j > 0. Re lambda > 0 is flutter"""
    n, flown = wave.n_sectors, with_flow(wave, springs, flow)
    eigenvalues = {}
    for index in range(-((n - 1) // 2), n // 2 + 1):
        system, B = flown.at_index(index)
        stuck, _, shape = family(system, np.asarray(B), springs, flow.mode)
        size = min(n_modes, len(stuck))
        square, shapes = sla.eigh(stuck, np.asarray(system.mass), subset_by_index=(0, size - 1))
        rate, circulatory = system.velocity_matrix, system.circulatory
        stiffness = np.diag(square) + shapes.conj().T @ np.asarray(circulatory) @ shapes
        damping = np.zeros((size, size)) if rate is None else shapes.conj().T @ np.asarray(rate) @ shapes
        values, vectors = np.linalg.eig(np.block([[np.zeros((size, size)), np.eye(size)], [-stiffness, -damping]]))
        likeness = np.abs((shapes.conj().T @ np.asarray(system.mass) @ shape).conj() @ vectors[:size])
        likeness = likeness / np.linalg.norm(vectors[:size], axis=0) * (values.imag > 0)
        eigenvalues[index] = complex(values[int(np.argmax(likeness))])
    return eigenvalues


def parts_of(flow: Flow, index: int, n_sectors: int, omega: float) -> tuple[complex, complex, complex, complex]:
    """Stiffness, damping, gyroscopic and circulatory coefficient of a wave of an index."""
    coefficient = flow.of_index(index, n_sectors)
    if 2 * index % n_sectors == 0:  # its own mirror: all is even, and real
        return omega**2 * coefficient.real, omega * coefficient.imag, 0.0, 0.0
    mirror = flow.of_index(-index, n_sectors)
    even, odd = (coefficient + mirror) / 2, (coefficient - mirror) / 2
    return omega**2 * even.real, omega * even.imag, -1j * omega * odd.real, 1j * omega**2 * odd.imag


def added(
    system: SecondOrderSystem, stiffness: np.ndarray, damping: np.ndarray, swirl: np.ndarray, flow: np.ndarray
) -> SecondOrderSystem:
    def total(present: np.ndarray | None, addition: np.ndarray) -> np.ndarray:
        return addition if present is None else np.asarray(present) + addition

    return replace(
        system,
        stiffness=total(system.stiffness, stiffness),
        damping=total(system.damping, damping),
        gyroscopic=total(system.gyroscopic, swirl),
        circulatory=total(system.circulatory, flow),
    )
