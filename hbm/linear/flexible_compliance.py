"""The compliance of a model with residual flexibility: modes between all ports, a static rest between the contacts.

    D(s)^-1 = R + Phi S(s)^-1 Phi^T,   S(s) = Lambda + s C_m + s^2,

with R, `reduction.residual_flexibility`, applied by a sparse factor and never a matrix. There is no W_0 and there are
no powers of s here: see `expansion`, whose interface this has."""

from typing import Any

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.linear import all_harmonics
from tribodyn.hbm.linear.compliance import ContactCompliance
from tribodyn.hbm.linear.compliance_point import CompliancePoint
from tribodyn.hbm.linear.expansion import Expansion, SingularStuckSystem
from tribodyn.reduction.residual_flexibility import FlexibleModel, ResidualFlexibility


class RitzExpansion(Expansion):
    """D(s)^-1 between ports of a stuck system with few coordinates and a residual flexibility; see the module text.

    Arguments as for `Expansion`; b and stiffness must be those of the residual flexibility
    b : (n_port, n) modes, b_single those of the contacts in single precision; w0 : None; e, higher : none
    error : relative, of the contact compliance at s_max, by what moves the mass that R leaves out
    Raises  SingularStuckSystem where the stuck structure can move rigidly"""

    def __init__(
        self, system: SecondOrderSystem, b: np.ndarray, stiffness: np.ndarray, ports: np.ndarray, s_max: float,
        residual: ResidualFlexibility,
    ):  # fmt: skip
        self.residual = residual
        self.n_port, self._n_contact = len(ports), len(b)
        self.s_unit = s_max or 1.0
        stuck = np.asarray(system.stiffness) + b.T @ (stiffness[:, None] * b)
        self.lam, phi = sla.eigh(0.5 * (stuck + stuck.T), np.asarray(system.mass))
        if self.lam[0] <= 0.0:
            raise SingularStuckSystem(
                "the part can move as a rigid body even with all contacts stuck: clamp it, or join its bodies"
            )
        self.static_lam, self.rigid, self.flow = self.lam, np.zeros((len(self.lam), 0)), None
        self.hermitian = system.gyroscopic is None
        rate = system.velocity_matrix
        self.c = np.zeros_like(stuck) if rate is None else phi.T @ np.asarray(rate) @ phi
        self.b = ports @ phi
        self.b_single = self.b[: len(b)].astype(np.float32)
        self.w0, self.order, self.n_mode = None, 1, len(self.lam)  # type: ignore[assignment]
        self.w0_single = np.zeros((0, 0), np.float32)
        self.to_ports, self.unit = np.ascontiguousarray(self.b.T), 1.0
        self.single = np.zeros((len(ports), 0), np.float32)
        self.e, self.e_in, self.higher, self.t = [], [], [], np.zeros((0, 0, 0))
        self.error = residual.error(s_max)


class FlexibleCompliance(ContactCompliance):
    """Contact compliance of a model with residual flexibility; stiffness must be that of `model.residual`."""

    def __init__(self, model: FlexibleModel, *settings: Any):
        self.residual = model.residual
        super().__init__(model, *settings)

    def _expansion(self, system: SecondOrderSystem, b: np.ndarray, ports: np.ndarray, s_max: float) -> Expansion:
        return RitzExpansion(system, b, self.k, ports, s_max, self.residual)

    def _check_balance(self) -> None:
        """The stuck structure has no rigid modes: nothing to check."""

    def _static_and_modes(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """R acts in place of W_0, between the contacts alone."""
        x, n = self.groups[0][0], self.n_contact
        stop, p = n + self.n_load, x.n_port
        static = np.zeros((self.basis.n_coeff, p))
        if self.base is not None:
            static[:, :n] = self.residual.apply(self.excited[:n]).T
        products = np.concatenate([static, rows @ x.b[:stop]], axis=1)
        return products, np.concatenate([np.zeros((n, p - stop)), x.b[:n]], axis=1)

    def _make(self, omega: float) -> CompliancePoint:
        return FlexiblePoint(self, omega)


class FlexiblePoint(CompliancePoint):
    """The same at one frequency."""

    compliance: FlexibleCompliance

    def apply(self, g: np.ndarray) -> np.ndarray:
        return self.nearly(g) + self.compliance.residual.apply(g)

    @property
    def left_out(self) -> float:
        return self.compliance.residual.left_out

    def nearly(self, g: np.ndarray) -> np.ndarray:
        """G g by the modes alone."""
        b = self.compliance.groups[0][0].b[: self.compliance.n_contact]
        return np.asarray((all_harmonics.modal(np.ascontiguousarray(g.T) @ b, 0, *self.core) @ b.T).T)
