"""What a balance asks of its linear side, and which one a model has."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.compliance import ContactCompliance
from tribodyn.hbm.linear.flexible_compliance import FlexibleCompliance
from tribodyn.hbm.linear.line_compliance import LineCompliance
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.residual_flexibility import FlexibleModel
from tribodyn.reduction.speed_line import SpeedLineModel


class LinearSide(Protocol):
    """The linear side of a balance at its frequency or frequencies, G; see `CompliancePoint`.

    blocks : (n_block, m, m) diagonal blocks of G over equal runs of contact rows with all their coefficients, which
        then precondition; None where `coarse_part` does"""

    @property
    def blocks(self) -> np.ndarray | None: ...

    def apply(self, g: np.ndarray) -> np.ndarray: ...

    def jacobian_product(self, rows: np.ndarray) -> Callable[[np.ndarray], np.ndarray]: ...

    def coarse_part(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]: ...

    @property
    def left_out(self) -> float: ...

    def nearly(self, g: np.ndarray) -> np.ndarray: ...


def compliance_of(
    model: ReducedModel, stiffness: np.ndarray, basis: HarmonicBasis, excitation: Excitation, omega_max: float,
    target_error: float | None = None,
) -> ContactCompliance:  # fmt: skip
    """The contact compliance of a model; arguments as for `ContactCompliance`."""
    if isinstance(model, SpeedLineModel):
        return LineCompliance(model, stiffness, basis, excitation, omega_max, target_error)
    if isinstance(model, FlexibleModel):
        return FlexibleCompliance(model, stiffness, basis, excitation, omega_max, target_error)
    return ContactCompliance(model, stiffness, basis, excitation, omega_max, target_error)
