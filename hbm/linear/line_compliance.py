"""The linear side of a wheel whose speed goes with the frequency: at every frequency that of its speed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.linear.compliance import ContactCompliance
from tribodyn.hbm.linear.compliance_point import CompliancePoint
from tribodyn.reduction.linear import stuck_dynamic_stiffness
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.speed_line import SpeedLineModel


class LineCompliance(ContactCompliance):
    """Contact compliance along a line of speeds; what does not ask for a frequency is that of the model itself."""

    def __init__(self, model: SpeedLineModel, *settings: Any):
        super().__init__(model, *settings)
        self.model, self._settings = model, settings

    def _one_real(self) -> bool:
        """Never: every speed has systems of its own."""
        return False

    def at_model(self, model: ReducedModel) -> ContactCompliance:
        """The compliance, for all frequencies, of the model at one speed."""
        compliance = ContactCompliance(model, *self._settings)
        return compliance if compliance.basis == self.basis else compliance.restricted(self.basis)

    def _make(self, omega: float) -> CompliancePoint:
        return LinePoint(self, omega)


class LinePoint(CompliancePoint):
    """Contact compliance at one frequency of a line of speeds."""

    compliance: LineCompliance
    ports: list[list[LinePorts]]

    def _solved(self) -> list[list[LinePorts]]:
        line = self.compliance
        model_there, changes = line.model.line(self.omega), line.model.line.slope(self.omega)

        def ports(h: int) -> LinePorts:
            (system, B), (change, _) = model_there.at_harmonic(h), changes.at_harmonic(h)
            rows, row_slopes = line.port_rows(system, B), line.port_rows(change, np.zeros_like(B))
            return LinePorts(system, change, B, line.k, rows, row_slopes, 1j * h * self.omega)

        return [[ports(line.basis.harmonics[p]) for p in positions] for _, positions in line.groups]

    def _in_coarse(self, modes: np.ndarray, port: LinePorts) -> np.ndarray:
        c = self.compliance
        shapes = c.preconditioned.T * np.sqrt(c.k)
        return shapes @ port.compliance[: c.n_contact, : c.n_contact] @ shapes.T


@dataclass(frozen=True, eq=False)
class LinePorts:
    """Displacement of ports under forces on ports, both the rows R of few coordinates, by a direct solution.

    system, B, k, rows, s : of D = `stuck_dynamic_stiffness` and R (n_port, n); change, rows_change : system and rows by
    the frequency"""

    system: SecondOrderSystem
    change: SecondOrderSystem
    B: np.ndarray
    k: np.ndarray
    rows: np.ndarray
    rows_change: np.ndarray
    s: complex

    @cached_property
    def factor(self) -> Any:
        """D = P L U."""
        return sla.lu_factor(stuck_dynamic_stiffness(self.system, self.B, self.k, self.s), check_finite=False)

    def _under(self, force: np.ndarray) -> np.ndarray:
        """D^-1 of forces (n, ...)."""
        return np.asarray(sla.lu_solve(self.factor, force.astype(complex), check_finite=False))

    @cached_property
    def compliance(self) -> np.ndarray:
        """R D^-1 R^H (n_port, n_port)."""
        return self.rows @ self._under(self.rows.conj().T)

    def slope(self, force: np.ndarray, by: complex) -> np.ndarray:
        """Of R D^-1 R^H f: R' D^-1 R^H f + R D^-1 (R'^H f - D' D^-1 R^H f); `by`: d s / d omega."""
        change = self.change.stiffness + 2 * self.s * by * self.system.mass
        for of, at in ((self.change, self.s), (self.system, by)):
            change = change if of.velocity_matrix is None else change + at * of.velocity_matrix
        q = self._under(self.rows.conj().T @ force)
        return self.rows_change @ q + self.rows @ self._under(self.rows_change.conj().T @ force - change @ q)

    def matrix(self, rows: slice = slice(None), columns: slice = slice(None)) -> np.ndarray:
        """Displacement of the ports in `rows` under unit forces at those in `columns`."""
        return self.compliance[rows, columns]
