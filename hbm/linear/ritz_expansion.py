"""The compliance of a model with residual flexibility: modes between all ports, a static rest between the contacts.

    D(s)^-1 = R + Phi S(s)^-1 Phi^T,   S(s) = Lambda + s C_m + s^2,

with R, `reduction.residual_flexibility`, applied by a sparse factor and never a matrix. There is no W_0 and there are
no powers of s here: see `expansion`, whose interface this has.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.linear.expansion import Expansion, PortCompliance, SingularStuckSystem, product
from tribodyn.reduction.residual_flexibility import ResidualFlexibility


class RitzExpansion(Expansion):
    """D(s)^-1 between ports of a stuck system with few coordinates and a residual flexibility; see the module text.

    Arguments as for `Expansion`; b and stiffness must be those of the residual flexibility
    b : (n_port, n) modes, b_single those of the contacts in single precision; w0 : None; e, higher : none
    error : relative, of the contact compliance at s_max, by what moves the mass that R leaves out
    Raises  SingularStuckSystem where the stuck structure can move rigidly
    """

    def __init__(
        self,
        system: SecondOrderSystem,
        b: np.ndarray,
        stiffness: np.ndarray,
        ports: np.ndarray,
        s_max: float,
        residual: ResidualFlexibility,
    ):
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
        self.e, self.e_in, self.higher, self.t = [], [], [], np.zeros((0, 0, 0))
        self.error = residual.error(s_max)

    def at(self, s: complex) -> PortCompliance:
        """The compliance at s = i h w."""
        plain = super().at(s)
        return RitzPort(self, s, plain.factor, plain.pivots)


class RitzPort(PortCompliance):
    """D(s)^-1 between ports at one s."""

    def apply(self, force: np.ndarray, columns: slice = slice(None), rows: slice = slice(None)) -> np.ndarray:
        """Displacement of the ports in `rows` under forces (n, ...) at the ports in `columns`."""
        x = self.expansion
        assert isinstance(x, RitzExpansion)
        out = product(x.b[rows], self.through_core(product(x.b[columns].T, force).astype(complex)))
        n = x._n_contact
        pushed, moved = (np.arange(x.n_port)[chosen] for chosen in (columns, rows))
        if (pushed < n).any() and (moved < n).any():
            full = np.zeros((n, *force.shape[1:]), complex)
            full[pushed[pushed < n]] = force[pushed < n]
            parts = np.stack([full.real, full.imag], axis=-1).reshape(n, -1)
            still = x.residual.apply(parts).reshape(*full.shape, 2)
            out[moved < n] += (still[..., 0] + 1j * still[..., 1])[moved[moved < n]]
        return out
