"""Contact compliance at one frequency: products with G between contacts, loads and outputs."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear import all_harmonics
from tribodyn.hbm.linear.all_harmonics import few_rows

if TYPE_CHECKING:
    from tribodyn.hbm.linear.compliance import ContactCompliance


class CompliancePoint:
    """Contact compliance at one frequency.

    x_lin : (n_contact, n_coeff) relative displacement of the stuck, closed structure under the excitation [m]
    outputs_lin : (n_output, n_coeff) its outputs [m]"""

    blocks = None

    def __init__(self, compliance: ContactCompliance, omega: float):
        self.compliance, self.omega = compliance, omega
        self._turns = omega or 1e-150  # [rad/s] whose powers vanish at rest, where their slopes over it do not
        self._harmonics = np.asarray(compliance.basis.harmonics, float)
        self.ports = self._solved()
        self._excite()

    def under(self, compliance: ContactCompliance, is_equal: bool) -> CompliancePoint:
        """That of the same expansions under other loads, or under the same again."""
        other = copy(self)
        other.compliance = compliance
        if not is_equal:
            other._excite()
        return other

    def _excite(self) -> None:
        compliance, basis = self.compliance, self.compliance.basis
        n, stop = compliance.n_contact, compliance.n_contact + compliance.n_load
        if compliance.outside is not None:
            displacement = self._from_rows(*compliance.outside.excitation, compliance.groups[0][0].to_ports)
            x, self.outputs_lin = displacement[:n], displacement[stop:]
        else:
            excited = slice(n, stop) if compliance.base is None else slice(0, stop)
            ports = self._through_ports(basis.to_complex(compliance.excited[excited]), excited)
            x, self.outputs_lin = basis.to_real(ports[:n]), basis.to_real(ports[stop:])
        self.x_lin = x if compliance.base is None else x - compliance.base

    def _solved(self) -> Any:
        """What gives the displacement of ports, group by group and harmonic by harmonic."""
        s = 1j * self.omega * self._harmonics
        return [expansion.at_each(s[positions]) for expansion, positions in self.compliance.groups]

    def _through_ports(self, force: np.ndarray, columns: slice = slice(None), rows: slice = slice(None)) -> np.ndarray:
        first = self.compliance.groups[0][0]
        out = np.zeros((len(range(*rows.indices(first.n_port))), force.shape[1]), complex)
        for (_, positions), ports in zip(self.compliance.groups, self.ports, strict=True):
            for p, port in zip(positions, ports, strict=True):
                if force[:, p].any():
                    out[:, p] = port.matrix(rows, columns) @ force[:, p]
        return out

    def apply(self, g: np.ndarray) -> np.ndarray:
        """G g: (n_contact, n_coeff) relative displacement [m] under contact forces g (n_contact, n_coeff) [N]."""
        if self.compliance.shared_real:
            return self._apply_shared_real(g)
        return _product(self.dense, self.compliance.basis, g)

    def transposed(self, g: np.ndarray) -> np.ndarray:
        """G^T g; each G_h of one real system is symmetric, so that this is G at the reversed time."""
        basis = self.compliance.basis
        if self.compliance.shared_real:
            back = np.ones(basis.n_coeff)
            back[int(basis.has_static) + 1 :: 2] = -1.0
            return back * self.apply(back * g)
        amplitudes = basis.to_complex(g).conj()
        return basis.to_real((amplitudes.T[:, None] @ self.dense)[:, 0].T.conj())

    @cached_property
    def dense(self) -> np.ndarray:
        """(n_harmonic, n_contact, n_contact) G_h where harmonics share no system: Newton asks for many products."""
        contacts = slice(0, self.compliance.n_contact)
        pairs = zip(self.compliance.groups, self.ports, strict=True)
        ports = {p: port for (_, positions), at in pairs for p, port in zip(positions, at, strict=True)}
        return np.array([ports[p].matrix(contacts, contacts) for p in range(len(ports))])

    @property
    def left_out(self) -> float:
        """Largest share of the contact flexibility that `nearly` and the products of `jacobian_product` leave out."""
        return 0.0

    def nearly(self, g: np.ndarray) -> np.ndarray:
        """G g without what needs a solution by a sparse factor; see `left_out`."""
        return self.apply(g)

    def _apply_shared_real(self, g: np.ndarray) -> np.ndarray:
        """The same for one real system: every matrix meets all harmonics in one real product."""
        n, x = self.compliance.n_contact, self.compliance.groups[0][0]
        rows = np.ascontiguousarray(g.T)
        products, higher = few_rows(rows, x.columns[:n]), few_rows(self.compliance.moving(rows), x.single[:n])
        return self._from_rows(products, higher, x.to_ports, n)

    def _from_rows(
        self, products: np.ndarray, higher: np.ndarray, to_ports: np.ndarray, n: int | None = None
    ) -> np.ndarray:
        """(n, n_coeff) displacement of the first n ports of `left` from forces times [W_0, modes] and W_k, as rows."""
        x, n = self.compliance.groups[0][0], to_ports.shape[1] if n is None else n
        displacement: np.ndarray = all_harmonics.displaced(products, higher, to_ports, n, len(x.e), x.unit, *self.core)
        return displacement

    @cached_property
    def core(self) -> tuple[np.ndarray, bool, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Of one real system: h w over the largest one asked for, and the factors of its core; see `all_harmonics`."""
        x, basis = self.compliance.groups[0][0], self.compliance.basis
        lower_upper = [port.factor.T for port in self.ports[0] if port.factor is not None]  # at rest there are none
        factors = np.array(lower_upper, complex).reshape(-1, x.n_mode, x.n_mode)
        pivots = np.array([p.pivots for p in self.ports[0] if p.pivots is not None], np.int32).reshape(-1, x.n_mode)
        ratio = self._turns / x.s_unit * np.array(basis.dynamic)
        real, imag = (np.ascontiguousarray(part) for part in (factors.real, factors.imag))
        return ratio, basis.has_static, real, imag, pivots, x.static_lam

    def outputs(self, g: np.ndarray) -> np.ndarray:
        """(n_output, n_coeff) outputs under contact forces g alone [m]."""
        c = self.compliance
        o = c.outside
        if o is not None and self.outputs_lin.size:
            rows = np.ascontiguousarray(g.T)
            return self._from_rows(rows @ o.columns, c.moving(rows) @ o.single, o.to_ports)
        contacts, outputs = slice(0, c.n_contact), slice(c.n_contact + c.n_load, None)
        return c.basis.to_real(self._through_ports(c.basis.to_complex(g), contacts, outputs))

    def slope(self, g: np.ndarray, load_factor: float) -> tuple[np.ndarray, np.ndarray]:
        """d / d omega of contact displacement and outputs under g and the excitation, vibrating part times factor."""
        c = self.compliance
        return self._slope(c.excited * np.where(c.basis.order, load_factor, 1.0) + c.pushed(g))

    def _slope(self, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """d / d omega of contact displacement and outputs under port forces (n_port, n_coeff)."""
        c, x = self.compliance, self.compliance.groups[0][0]
        if c.shared_real:
            rows = np.ascontiguousarray(force.T)
            pushed = rows @ x.to_ports.T, c.moving(rows) @ x.single
            displacement_slope = all_harmonics.displaced_slope(
                *pushed, x.to_ports, x.unit, self._turns, x.s_unit, x.c, x.t, *self.core
            )
        else:
            amplitudes, slopes = c.basis.to_complex(force), np.zeros((len(force), len(self._harmonics)), complex)
            for (_, positions), ports in zip(c.groups, self.ports, strict=True):
                for p, port in zip(positions, ports, strict=True):
                    slopes[:, p] = port.slope(amplitudes[:, p], 1j * self._harmonics[p])
            displacement_slope = c.basis.to_real(slopes)
        return displacement_slope[: c.n_contact], displacement_slope[c.n_contact + c.n_load :]

    def jacobian_product(self, rows: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """G restricted to contact rows (active ones) times (n_active, n_coeff), as exact as a Newton direction needs.

        In single precision, where harmonics share a system by W_0 and modes alone"""
        c = self.compliance
        parts = c.on_rows(rows) if c.shared_real else ()
        dense = None if c.shared_real else self.dense[:, rows[:, None], rows].astype(np.complex64)

        def product(d: np.ndarray) -> np.ndarray:
            if dense is not None:
                return _product(dense, c.basis, d)
            displacement: np.ndarray = all_harmonics.nearly_displaced(d, *parts, *self.core)
            return displacement

        return product

    def coarse_part(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """U (n_rows, r) and A (r n_coeff, r n_coeff) with G ~ U A U^T on contact rows; r may be 0."""
        return self.compliance.coarse_shapes[rows], self._coarse_compliance

    @cached_property
    def _coarse_compliance(self) -> np.ndarray:
        """Q^T sqrt(k) G sqrt(k) Q by the modes alone, on all coefficients; Q is `preconditioned`."""
        c, size = self.compliance, self.compliance.preconditioned.shape[1]
        amplitude = np.empty((len(self._harmonics), size, size), complex)
        for modes, (_, positions), ports in zip(c.coarse_parts, c.groups, self.ports, strict=True):
            amplitude[positions] = [self._in_coarse(modes, port) for port in ports]
        return c.basis.real_matrices(amplitude)

    def _in_coarse(self, modes: np.ndarray, port: Any) -> np.ndarray:
        """(r, r) compliance of the `preconditioned` shapes at one harmonic, through the modes of its system."""
        compliance: np.ndarray = modes @ port.through_core(modes.conj().T)
        return compliance


def _product(dense: np.ndarray, basis: HarmonicBasis, force: np.ndarray) -> np.ndarray:
    """Coefficients (n, n_coeff) of G_h (n_harmonic, n, n) times forces (n, n_coeff), as precise as the matrices."""
    return basis.to_real((dense @ basis.to_complex(force).T[..., None].astype(dense.dtype))[..., 0].T)
