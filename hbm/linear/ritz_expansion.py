"""The compliance of a model with residual flexibility: modes between all ports, a static rest between the contacts.

    D(s)^-1 = R + Phi S(s)^-1 Phi^T,   S(s) = Lambda + s C_m + s^2,

with R, `reduction.residual_flexibility`, applied by a sparse factor and never a matrix. There is no W_0 and there are
no powers of s here: see `expansion`, whose interface this has.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.linear.expansion import Expansion, SingularStuckSystem
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
        self.left, self.single, self.unit = np.ascontiguousarray(self.b.T), np.zeros((len(ports), 0), np.float32), 1.0
        self.e, self.e_in, self.higher, self.t = [], [], [], np.zeros((0, 0, 0))
        self.error = residual.error(s_max)
