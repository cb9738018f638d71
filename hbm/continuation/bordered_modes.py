"""Modes of the stuck structure, and the bordered dynamic stiffness of one harmonic in them."""

from typing import Protocol

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.linear.stuck_modes import stuck_modes

PROPORTIONAL = 1e-6  # of the damping of two modes: less between them is rounding


class Bordered(Protocol):
    """[D, r; l, 0] of one harmonic, or [D, 0; 0, 1] where nothing borders it; solves for rhs (n + 1,)."""

    def solve(self, rhs: np.ndarray) -> np.ndarray: ...


class DenseBordered:
    """With a full D (n, n); border, row : r, l (n,), l = r^H by default."""

    def __init__(self, d: np.ndarray, border: np.ndarray, corner: float, row: np.ndarray | None = None):
        row = border.conj() if row is None else row
        self._factor = sla.lu_factor(np.block([[d, border[:, None]], [row[None], np.array([[corner]])]]))

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution (n + 1,)."""
        return sla.lu_solve(self._factor, rhs)


class DiagonalBordered:
    """With a diagonal D (n,), as proportional damping has it; one of its entries may vanish where r l is largest."""

    def __init__(self, d: np.ndarray, border: np.ndarray, corner: float, row: np.ndarray | None = None):
        self._r, self._corner = border, corner
        self._row = border.conj() if row is None else row
        self._pivot = int(np.abs(border * self._row).argmax())
        with np.errstate(divide="ignore", invalid="ignore"):
            self._inverse = 1.0 / d
        if not corner:
            self._inverse[self._pivot] = 0.0
            ratio = d[self._pivot] / self._row[self._pivot]
            self._scale = border[self._pivot] + ratio * (np.abs(border) ** 2 * self._inverse).sum()
            self._ratio = ratio

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution (n + 1,)."""
        out = np.empty(len(rhs), complex)
        force, amplitude = rhs[:-1], rhs[-1]
        if self._corner:
            out[:-1], out[-1] = force * self._inverse, amplitude / self._corner
            return out
        k, r, row = self._pivot, self._r, self._row
        unbordered = force * self._inverse
        multiplier = (force[k] - self._ratio * (amplitude - row @ unbordered)) / self._scale
        out[:-1] = unbordered - r * self._inverse * multiplier
        out[k] = (amplitude - row @ out[:-1] + row[k] * out[k]) / row[k]
        out[-1] = multiplier
        return out


class StuckModes:
    """All modes of the stuck structure that a harmonic sees.

    lam : (n,) squared frequencies; static_lam : the same for static loads; U, O : (n_contact, n), (n_output, n) shapes
    damping, flow : (n, n) what multiplies the velocity, and circulatory forces or None
    proportional : whether nothing couples the modes"""

    def __init__(self, system: SecondOrderSystem, b: np.ndarray, k: np.ndarray, outputs: tuple[str, ...]):
        mass = np.asarray(system.mass)
        stuck = np.asarray(system.stiffness) + b.conj().T @ (k[:, None] * b)
        self.lam, self.shapes, free = stuck_modes(stuck, mass)
        self.static_lam = np.where(free, np.inf, self.lam)  # static loads in equilibrium do not move what nothing holds
        self.U = b @ self.shapes
        self.UH = self.U.conj().T
        self.O = np.array([system.outputs[name] @ self.shapes for name in outputs])
        rate, flow = system.velocity_matrix, system.circulatory
        to_modes = self.shapes.conj().T
        self.damping = np.zeros_like(mass) if rate is None else to_modes @ np.asarray(rate) @ self.shapes
        self.flow = None if flow is None else to_modes @ np.asarray(flow) @ self.shapes
        size = np.abs(np.diag(self.damping))
        coupling = np.abs(self.damping - np.diag(np.diag(self.damping)))
        small = PROPORTIONAL * np.sqrt(np.outer(size, size)) + PROPORTIONAL * 1e-6 * size.max(initial=0.0)
        self.proportional = flow is None and bool((coupling <= small).all())
