"""The linear side of a structure one output of which moves as a given cosine, whatever force that takes.

In harmonic 1 the output moves by y = F a + L g, with the excitation F, its receptance a and the contact forces g. Held
at y, the force is F = (y - L g) / a and the contact moves by

    x = F x_F + G g = y x_F / a + (G - x_F L / a) g :

the compliance of another structure, whose response has no fold where that of the driven one has.
Source  elimination of the force is ours; the test is constant-response control, as in Karaagacli and Ozguven 2021"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.compliance import ContactCompliance
from tribodyn.hbm.linear.compliance_point import CompliancePoint
from tribodyn.refusal import Refusal


class HeldOutput(ContactCompliance):
    """The compliance of `inner` with the fundamental of an output held at amplitude [m] times cos w t.

    row : of the output; the load factor of a balance multiplies the amplitude"""

    inner: ContactCompliance
    row: int
    amplitude: float

    @classmethod
    def of(cls, inner: ContactCompliance, output: str, amplitude: float) -> HeldOutput:
        """The expansions are shared."""
        side = object.__new__(cls)
        side.__dict__.update(inner.__dict__)
        side.inner, side.row, side.amplitude = inner, inner.output_names.index(output), amplitude
        side._points = {}
        return side

    def restricted(self, basis: HarmonicBasis) -> HeldOutput:
        return HeldOutput.of(self.inner.restricted(basis), self.output_names[self.row], self.amplitude)

    def at(self, omega: float) -> HeldPoint:
        point = super().at(omega)
        assert isinstance(point, HeldPoint)
        return point

    def _make(self, omega: float) -> HeldPoint:
        return HeldPoint(self, omega)


class HeldPoint(CompliancePoint):
    """The same at one frequency. receptance : complex, of the output under the excitation as it stands [m]."""

    compliance: HeldOutput

    def __init__(self, compliance: HeldOutput, omega: float):
        self.inner = compliance.inner.at(omega)
        self.__dict__.update(self.inner.__dict__)
        self.compliance = compliance
        self._first = compliance.basis.harmonics.index(1)
        x, y = self._fundamental(self.x_lin), self._fundamental(self.outputs_lin)
        self.receptance = complex(y[compliance.row])
        if self.receptance == 0.0:
            name = compliance.output_names[compliance.row]
            raise Refusal(f"the loads do not move output '{name}' in harmonic 1: its amplitude cannot be held")
        self._per_output = x / self.receptance, y / self.receptance
        missing = compliance.amplitude - self.receptance
        self.x_lin = self._with_fundamental(self.x_lin, self._per_output[0] * missing)
        self.outputs_lin = self._with_fundamental(self.outputs_lin, self._per_output[1] * missing)

    @property
    def left_out(self) -> float:
        """As of the structure without the held output."""
        return self.inner.left_out

    def _fundamental(self, coefficients: np.ndarray) -> np.ndarray:
        """(n,) complex amplitudes of harmonic 1 of coefficients (n, n_coeff)."""
        amplitudes: np.ndarray = self.compliance.basis.to_complex(coefficients)[:, self._first]
        return amplitudes

    def _with_fundamental(self, coefficients: np.ndarray, by: np.ndarray) -> np.ndarray:
        """Coefficients (n, n_coeff) with complex amplitudes (n,) added to harmonic 1."""
        out = np.array(coefficients, float)
        cosine = int(np.flatnonzero(self.compliance.basis.order == 1)[0])
        out[:, cosine] += by.real
        out[:, cosine + 1] -= by.imag
        return out

    def contact_motion(self, g: np.ndarray) -> complex:
        """Motion of the output in harmonic 1 under contact forces g (n_contact, n_coeff) alone [m]."""
        return complex(self._fundamental(self.inner.outputs(g))[self.compliance.row])

    def force(self, g: np.ndarray, factor: float) -> complex:
        """The necessary excitation over the given one; factor : on the amplitude side."""
        return (self.compliance.amplitude * factor - self.contact_motion(g)) / self.receptance

    def apply(self, g: np.ndarray) -> np.ndarray:
        return self._with_fundamental(self.inner.apply(g), -self.contact_motion(g) * self._per_output[0])

    def nearly(self, g: np.ndarray) -> np.ndarray:
        return self._with_fundamental(self.inner.nearly(g), -self.contact_motion(g) * self._per_output[0])

    def outputs(self, g: np.ndarray) -> np.ndarray:
        return self._with_fundamental(self.inner.outputs(g), -self.contact_motion(g) * self._per_output[1])

    def slope(self, g: np.ndarray, load_factor: float) -> tuple[np.ndarray, np.ndarray]:
        """d / d omega of contact displacement and outputs under g and what is held, vibrating part times factor."""
        c = self.compliance
        excited, free = self.inner._slope(c.excited), self.inner._slope(c.pushed(g))
        turn, turn_free = (self._fundamental(part[1])[c.row] for part in (excited, free))
        driven, slopes = self.force(g, load_factor), []
        for e, f, way in zip(excited, free, self._per_output, strict=True):
            first = self._fundamental(e)
            by = driven * (first - way * turn) - way * turn_free - load_factor * first
            slopes.append(self._with_fundamental(e * np.where(c.basis.order, load_factor, 1.0) + f, by))
        return slopes[0], slopes[1]

    def jacobian_product(self, rows: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """The product with G restricted to contact rows (active ones)."""
        free, way = self.inner.jacobian_product(rows), self._per_output[0][rows]
        all_rows = np.zeros((self.compliance.n_contact, self.compliance.basis.n_coeff))

        def product(d: np.ndarray) -> np.ndarray:
            all_rows[rows] = d
            return self._with_fundamental(free(d), -self.contact_motion(all_rows) * way)

        return product
