"""The linear side of a wheel whose speed goes with the frequency: at every frequency that of its speed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.compliance import CompliancePoint, ContactCompliance
from tribodyn.reduction.linear import stuck_dynamic_stiffness
from tribodyn.reduction.model import ReducedModel


def compliance_of(
    model: ReducedModel,
    stiffness: np.ndarray,
    basis: HarmonicBasis,
    excitation: Excitation,
    omega_max: float,
    wanted: float | None = None,
) -> ContactCompliance:
    """The contact compliance of a model, along its speeds where these go with the frequency."""
    kind = ContactCompliance if model.along is None else LineCompliance
    return kind(model, stiffness, basis, excitation, omega_max, wanted)


class LineCompliance(ContactCompliance):
    """Contact compliance along a line of speeds; what does not ask for a frequency is that of the model itself."""

    def __init__(self, model: ReducedModel, *made_of: Any):
        super().__init__(model, *made_of)
        self.model, self._made_of = model, made_of

    def _one_real(self) -> bool:
        """Never: every speed has systems of its own."""
        return False

    def there(self, omega: float) -> tuple[ReducedModel, ContactCompliance]:
        """Model and compliance, for all frequencies, at the speed that belongs to one [rad/s]."""
        assert self.model.along is not None
        model = self.model.along(omega)
        compliance = ContactCompliance(model, *self._made_of)
        return model, compliance if compliance.basis == self.basis else compliance.restricted(self.basis)

    def _make(self, omega: float) -> CompliancePoint:
        return LinePoint(self, omega)


class LinePoint(CompliancePoint):
    """Contact compliance at one frequency of a line of speeds."""

    compliance: LineCompliance
    ports: list[list[LinePorts]]

    def _solved(self) -> list[list[LinePorts]]:
        line = self.compliance
        assert line.model.along is not None
        there, slopes = line.model.along(self.omega), line.model.along.slope(self.omega)

        def ports(h: int) -> LinePorts:
            (system, B), (slope, _) = there.at_harmonic(h), slopes.at_harmonic(h)
            rows, moved = line.port_rows(system, B), line.port_rows(slope, np.zeros_like(B))
            return LinePorts(system, slope, B, line.k, rows, moved, 1j * h * self.omega, 1j * h)

        return [[ports(line.basis.harmonics[p]) for p in positions] for _, positions in line.groups]

    def slope(self, g: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """As of any point, with what the speed changes meanwhile."""
        c = self.compliance
        force = c.port_force(g)
        moved = np.zeros_like(force)
        for (_, positions), ports in zip(c.groups, self.ports, strict=True):
            for p, port in zip(positions, ports, strict=True):
                moved[:, p] = port.slopes @ force[:, p]
        return c.basis.to_real(moved[: c.n_contact]), c.basis.to_real(moved[c.n_contact + c.n_load :])

    def _in_coarse(self, modes: np.ndarray, port: LinePorts) -> np.ndarray:
        c = self.compliance
        shapes = c.preconditioned.T * np.sqrt(c.k)
        return shapes @ port.moved[: c.n_contact, : c.n_contact] @ shapes.T


@dataclass(frozen=True, eq=False)
class LinePorts:
    """Displacement of ports under forces on ports, both the rows R of few coordinates, by a direct solution.

    system, B, k, rows, s : of D = `stuck_dynamic_stiffness` and R (n_port, n); slope, rows_slope, s_slope : these by
    the frequency
    """

    system: SecondOrderSystem
    slope: SecondOrderSystem
    B: np.ndarray
    k: np.ndarray
    rows: np.ndarray
    rows_slope: np.ndarray
    s: complex
    s_slope: complex

    @cached_property
    def factor(self) -> Any:
        """D = P L U."""
        return sla.lu_factor(stuck_dynamic_stiffness(self.system, self.B, self.k, self.s), check_finite=False)

    @cached_property
    def under(self) -> np.ndarray:
        """D^-1 R^H (n, n_port)."""
        return np.asarray(sla.lu_solve(self.factor, self.rows.conj().T.astype(complex), check_finite=False))

    @cached_property
    def moved(self) -> np.ndarray:
        """R D^-1 R^H (n_port, n_port)."""
        return self.rows @ self.under

    @cached_property
    def slopes(self) -> np.ndarray:
        """The same by the frequency: R' D^-1 R^H + R D^-1 R'^H - R D^-1 D' D^-1 R^H."""
        left = sla.lu_solve(self.factor, self.rows.conj().T.astype(complex), trans=2, check_finite=False).conj().T
        change = self.slope.stiffness + 2 * self.s * self.s_slope * self.system.mass
        for of, by in ((self.slope, self.s), (self.system, self.s_slope)):
            change = change if of.velocity_matrix is None else change + by * of.velocity_matrix
        found: np.ndarray = self.rows_slope @ self.under + left @ (self.rows_slope.conj().T - change @ self.under)
        return found

    def apply(self, force: np.ndarray, columns: slice = slice(None), rows: slice = slice(None)) -> np.ndarray:
        """Displacement of the ports in `rows` under forces (n, ...) at the ports in `columns`."""
        return self.moved[rows, columns] @ force

    def matrix(self, rows: slice = slice(None), columns: slice = slice(None)) -> np.ndarray:
        """Displacement of the ports in `rows` under unit forces at those in `columns`."""
        return self.moved[rows, columns]
