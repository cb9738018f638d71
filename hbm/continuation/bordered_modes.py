"""Modes of the stuck structure, and the bordered dynamic stiffness of one harmonic in them."""

from __future__ import annotations

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
    """With a full D (n, n); border, left : r, l (n,), l = r^H by default."""

    def __init__(self, d: np.ndarray, border: np.ndarray, corner: float, left: np.ndarray | None = None):
        left = border.conj() if left is None else left
        self._factor = sla.lu_factor(np.block([[d, border[:, None]], [left[None], np.array([[corner]])]]))

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution (n + 1,)."""
        return sla.lu_solve(self._factor, rhs)


class DiagonalBordered:
    """With a diagonal D (n,), as proportional damping has it; one of its entries may vanish where r l is largest."""

    def __init__(self, d: np.ndarray, border: np.ndarray, corner: float, left: np.ndarray | None = None):
        self._d, self._r, self._corner = d, border, corner
        self._left = border.conj() if left is None else left
        self._pivot = int(np.abs(border * self._left).argmax())
        with np.errstate(divide="ignore", invalid="ignore"):
            self._inverse = 1.0 / d
        if not corner:
            self._inverse[self._pivot] = 0.0
            ratio = d[self._pivot] / self._left[self._pivot]
            self._scale = border[self._pivot] + ratio * (np.abs(border) ** 2 * self._inverse).sum()
            self._ratio = ratio

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution (n + 1,)."""
        out = np.empty(len(rhs), complex)
        force, wanted = rhs[:-1], rhs[-1]
        if self._corner:
            out[:-1], out[-1] = force * self._inverse, wanted / self._corner
            return out
        k, r, left = self._pivot, self._r, self._left
        others = force * self._inverse
        missing = (force[k] - self._ratio * (wanted - left @ others)) / self._scale
        out[:-1] = others - r * self._inverse * missing
        out[k] = (wanted - left @ out[:-1] + left[k] * out[k]) / left[k]
        out[-1] = missing
        return out


class StuckModes:
    """All modes of the stuck structure that a harmonic sees.

    lam : (n,) squared frequencies; held : the same for static loads; U, O : (n_contact, n), (n_output, n) shapes
    damping, flow : (n, n) what multiplies the velocity, and circulatory forces or None
    proportional : whether nothing couples the modes
    """

    def __init__(self, system: SecondOrderSystem, b: np.ndarray, k: np.ndarray, outputs: tuple[str, ...]):
        mass = np.asarray(system.mass)
        stuck = np.asarray(system.stiffness) + b.conj().T @ (k[:, None] * b)
        self.lam, self.shapes, free = stuck_modes(stuck, mass)
        self.held = np.where(free, np.inf, self.lam)  # static loads in equilibrium do not move what nothing holds
        self.U = b @ self.shapes
        self.UH = self.U.conj().T
        self.O = np.array([system.outputs[name] @ self.shapes for name in outputs])
        rate, flow = system.velocity_matrix, system.circulatory
        left = self.shapes.conj().T
        self.damping = np.zeros_like(mass) if rate is None else left @ np.asarray(rate) @ self.shapes
        self.flow = None if flow is None else left @ np.asarray(flow) @ self.shapes
        size = np.abs(np.diag(self.damping))
        apart = np.abs(self.damping - np.diag(np.diag(self.damping)))
        small = PROPORTIONAL * np.sqrt(np.outer(size, size)) + PROPORTIONAL * 1e-6 * size.max(initial=0.0)
        self.proportional = flow is None and bool((apart <= small).all())
