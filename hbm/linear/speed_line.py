"""The linear side of a wheel whose speed goes with the frequency: at every frequency that of its speed."""

from __future__ import annotations

from typing import Any

import numpy as np

from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.compliance import CompliancePoint, ContactCompliance
from tribodyn.reduction.model import ReducedModel

SLOPE_STEP = 1e-4  # of the speed, relative, of central differences
KEPT = 12  # speeds at hand: those of a peak and of the slopes about it


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
        self._model, self._made_of = model, made_of
        self._there: dict[float, tuple[ReducedModel, ContactCompliance]] = {}

    def there(self, omega: float) -> tuple[ReducedModel, ContactCompliance]:
        """Model and compliance at the speed that belongs to a frequency [rad/s]."""
        if omega not in self._there:
            assert self._model.along is not None
            fast = self._model.along(omega)
            self._there[omega] = fast, ContactCompliance(fast, *self._made_of)
            if len(self._there) > KEPT:
                del self._there[next(iter(self._there))]
        model, compliance = self._there[omega]
        return model, compliance if compliance.basis == self.basis else compliance.restricted(self.basis)

    def at(self, omega: float) -> CompliancePoint:
        """The compliance at one excitation frequency [rad/s], and at its speed."""
        if omega not in self._points:
            self._points[omega] = LinePoint(self, omega)
            if len(self._points) > KEPT:
                del self._points[next(iter(self._points))]
        return self._points[omega]


class LinePoint(CompliancePoint):
    """Contact compliance at one frequency of a line of speeds."""

    def __init__(self, line: LineCompliance, omega: float):
        super().__init__(line.there(omega)[1], omega)
        self._line = line

    def slope(self, g: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """As of any point, with what the speed changes meanwhile."""
        still, high, low = super().slope(g), *(self._aside(1 + step, g) for step in (SLOPE_STEP, -SLOPE_STEP))
        x, y = (s + (a - b) / (2 * SLOPE_STEP * self.omega) for s, a, b in zip(still, high, low, strict=True))
        return x, y

    def _aside(self, factor: float, g: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Contact displacement and outputs at this frequency and another speed."""
        point = CompliancePoint(self._line.there(factor * self.omega)[1], self.omega)
        return (point.x_lin, point.outputs_lin) if g is None else (point.apply(g), point.outputs(g))
