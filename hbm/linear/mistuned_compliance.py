"""The linear side of a wheel whose sectors differ in stiffness: that of sectors alike, corrected on a few shapes.

Sectors alike have a block-circulant compliance H(s): a discrete Fourier transform over the sectors leaves a small
matrix for every nodal diameter. Sector n deviates by P^H d_n P, P its rows on a few shapes (`reduction.nominal_modes`):

    G = H - H P^H (I + d P H P^H)^-1 d P H

of which only the matrix in brackets, a few rows for each sector, is solved (Woodbury). Nothing of the size of the wheel
is decomposed.
Source  Yang and Griffin 2001; Sherman and Morrison 1950; Woodbury 1950"""

from __future__ import annotations

from collections import OrderedDict
from functools import cached_property

import numpy as np
from scipy import fft
from scipy.linalg import inv, lu_factor, lu_solve

from tribodyn.fem.cyclic_symmetry import sector_name
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.nominal_wheel import NominalWheel
from tribodyn.refusal import Refusal


class MistunedCompliance:
    """The compliance of a wheel whose sectors deviate; it serves a balance as `ContactCompliance` does.

    deviation : (N,) relative, of the stiffness of every sector, above -1"""

    base = None

    def __init__(self, nominal: NominalWheel, basis: HarmonicBasis, deviation: np.ndarray):
        self.nominal, self.basis = nominal, basis
        self.deviation = np.asarray(deviation, float)
        if self.deviation.shape != (nominal.n_sectors,) or not np.all(self.deviation > -1):
            raise Refusal(f"mistuning needs {nominal.n_sectors} deviations of stiffness above -1, one per sector")
        self.k = np.tile(nominal.k, nominal.n_sectors)
        self.n_contact = len(self.k)
        self.output_names = tuple(sector_name(name, n) for name in nominal.outputs for n in range(nominal.n_sectors))
        self.error = nominal.error
        self._force = nominal.force
        self._points: OrderedDict[float, MistunedPoint] = OrderedDict()
        # stiffness at rest is the same at every frequency
        self._static: tuple[np.ndarray, np.ndarray] | None = None
        self._static_inverse: np.ndarray | None = None

    def restricted(self, basis: HarmonicBasis) -> MistunedCompliance:
        """The same for fewer of the harmonics."""
        other = object.__new__(MistunedCompliance)
        other.__dict__.update(self.__dict__)
        other.basis, other._points = basis, OrderedDict()
        other._force = self._force[[self.basis.harmonics.index(h) for h in basis.harmonics]]
        return other

    @property
    def force(self) -> np.ndarray:
        """(n_harmonic, N, n_load) amplitudes of the loads [N]."""
        return self._force

    def factor(self, h: float, coupling: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Factors of I + d P H P^H (N r, N r) of a harmonic, from P H P^H by distance of sectors (N, r, r)."""
        if h == 0 and self._static is not None:
            return self._static
        matrix = self.matrix(coupling)
        factors: tuple[np.ndarray, np.ndarray] = lu_factor(matrix, overwrite_a=True, check_finite=False)
        if h == 0:
            self._static = factors
        return factors

    def inverse(self, h: float, coupling: np.ndarray) -> np.ndarray:
        """(I + d P H P^H)^-1 d of a harmonic in single precision; arguments as for `factor`."""
        if h == 0 and self._static_inverse is not None:
            return self._static_inverse
        inverse_matrix = inv(self.matrix(coupling).astype(np.complex64), overwrite_a=True, check_finite=False)
        weighted_inverse: np.ndarray = inverse_matrix * np.repeat(self.deviation, coupling.shape[1]).astype(np.float32)
        if h == 0:
            self._static_inverse = weighted_inverse
        return weighted_inverse

    def matrix(self, coupling: np.ndarray) -> np.ndarray:
        """I + d P H P^H (N r, N r); see `factor`."""
        N, r = self.nominal.n_sectors, coupling.shape[1]
        distance = (np.arange(N)[:, None] - np.arange(N)) % N
        matrix = coupling[distance].transpose(0, 2, 1, 3).reshape(N * r, N * r) * np.repeat(self.deviation, r)[:, None]
        matrix[np.arange(N * r), np.arange(N * r)] += 1.0
        return matrix

    def at(self, omega: float) -> MistunedPoint:
        """The compliance at one excitation frequency [rad/s]; the last ones are kept."""
        point = self._points.pop(omega, None) or MistunedPoint(self, omega)
        self._points[omega] = point
        if len(self._points) > 3:
            self._points.popitem(last=False)
        return point


class MistunedPoint:
    """The compliance of a wheel whose sectors deviate, at one frequency; see `CompliancePoint`.

    x_lin : (N n_c, n_coeff) relative displacement of the stuck, closed wheel under the excitation [m]
    outputs_lin : (n_output, n_coeff) its outputs [m]
    left_out : of its flexibility, by `nearly` and the products"""

    left_out = 0.0

    def __init__(self, compliance: MistunedCompliance, omega: float):
        self.compliance, self.omega = compliance, omega
        a = compliance.nominal
        self._h = np.asarray(compliance.basis.harmonics, float)
        H = np.stack([a.at(1j * h * omega) for h in self._h])
        self._H = H
        self._to_shapes = np.ascontiguousarray(H[:, :, a.ports])  # of the mistuned shapes, under all forces
        self._from_shapes = np.ascontiguousarray(H[:, :, :, a.ports])  # of all ports, under forces on these shapes
        self._contact = np.ascontiguousarray(H[:, :, a.contacts, a.contacts])
        self._coupling = fft.fft(self._to_shapes[:, :, :, a.ports], axis=1) / a.n_sectors  # by distance of two sectors
        self._factors = [compliance.factor(h, blocks) for h, blocks in zip(self._h, self._coupling, strict=True)]
        load = np.zeros((len(self._h), a.n_sectors, a.n_port), complex)
        load[:, :, a.loads] = compliance.force
        displacement = self._displaced(load)
        self.x_lin, self.outputs_lin = self._contact_rows(displacement), self._output_rows(displacement)

    def _displaced(self, force: np.ndarray, H: np.ndarray | None = None) -> np.ndarray:
        """Displacement of all ports under forces on all of them, both (n_harmonic, N, n_port) complex.

        H : other matrices (n_harmonic, N, n_port, n_port) for the way from the forces, such as slopes"""
        H = self._H if H is None else H
        waves = np.matmul(H, fft.ifft(force, axis=1)[..., None])[..., 0]
        reaction = self._reaction(waves[:, :, self.compliance.nominal.ports])
        return np.asarray(fft.fft(waves - np.matmul(self._from_shapes, reaction[..., None])[..., 0], axis=1))

    def _reaction(self, waves: np.ndarray) -> np.ndarray:
        """Waves of the forces that deviating stiffness adds, from the waves of what sectors alike do (n_h, N, r)."""
        n_h, N, r = waves.shape
        if r == 0:
            return waves
        pushed = (fft.fft(waves, axis=1) * self.compliance.deviation[:, None]).reshape(n_h, N * r)
        forces = [
            lu_solve(factor, force, check_finite=False) for factor, force in zip(self._factors, pushed, strict=True)
        ]
        return np.asarray(fft.ifft(np.stack(forces).reshape(n_h, N, r), axis=1))

    def _contact_rows(self, displacement: np.ndarray) -> np.ndarray:
        x = displacement[:, :, self.compliance.nominal.contacts]
        return self.compliance.basis.to_real(x.reshape(len(x), -1).T)

    def _output_rows(self, displacement: np.ndarray) -> np.ndarray:
        y = displacement[:, :, self.compliance.nominal.observed].transpose(2, 1, 0)
        return self.compliance.basis.to_real(y.reshape(-1, y.shape[2]))

    def _on_ports(self, g: np.ndarray) -> np.ndarray:
        a = self.compliance.nominal
        force = np.zeros((len(self._h), a.n_sectors, a.n_port), complex)
        force[:, :, a.contacts] = self._amplitudes(g)
        return force

    def _amplitudes(self, g: np.ndarray) -> np.ndarray:
        return self.compliance.basis.to_complex(g).T.reshape(len(self._h), self.compliance.nominal.n_sectors, -1)

    def apply(self, g: np.ndarray) -> np.ndarray:
        """G g: (N n_c, n_coeff) relative displacement [m] under contact forces g (N n_c, n_coeff) [N]."""
        c = self.compliance.nominal.contacts
        waves = fft.ifft(self._amplitudes(g), axis=1)[..., None]
        reaction = self._reaction(np.matmul(self._to_shapes[:, :, :, c], waves)[..., 0])
        motion = np.matmul(self._contact, waves) - np.matmul(self._from_shapes[:, :, c], reaction[..., None])
        displacement = fft.fft(motion[..., 0], axis=1)
        return self.compliance.basis.to_real(displacement.reshape(len(displacement), -1).T)

    nearly = apply

    def outputs(self, g: np.ndarray) -> np.ndarray:
        """(n_output, n_coeff) outputs under contact forces g alone [m]."""
        return self._output_rows(self._displaced(self._on_ports(g)))

    def slope(self, g: np.ndarray, load_factor: float) -> tuple[np.ndarray, np.ndarray]:
        """d / d omega of contact displacement and outputs under g and the excitation, vibrating part times factor."""
        a = self.compliance.nominal
        force = self._on_ports(g)
        force[:, :, a.loads] += self.compliance.force * np.where(self._h, load_factor, 1.0)[:, None, None]
        # all forces on sectors alike, those of the deviating stiffness among them
        waves = np.matmul(self._H, fft.ifft(force, axis=1)[..., None])[..., 0]
        force[:, :, a.ports] -= fft.fft(self._reaction(waves[:, :, a.ports]), axis=1)
        displacement = self._displaced(force, self._slopes)
        return self._contact_rows(displacement), self._output_rows(displacement)

    @cached_property
    def _slopes(self) -> np.ndarray:
        """(n_harmonic, N, n_port, n_port) d / d omega of the matrices of sectors alike."""
        a = self.compliance.nominal
        return np.stack([1j * h * a.slope(1j * h * self.omega) for h in self._h])

    def jacobian_product(self, rows: np.ndarray) -> JacobianProduct:
        """The product with G restricted to contact rows."""
        return JacobianProduct(self, rows)

    def coarse_part(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """None: blocks of sectors serve instead."""
        return np.zeros((len(rows), 0)), np.zeros((0, 0))

    @cached_property
    def single(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Single precision: contact to contact, contact to shapes, shapes to contact, (I + d P H P^H)^-1 d."""
        c = self.compliance
        parts = self._contact, self._to_shapes[:, :, :, c.nominal.contacts], self._from_shapes[:, :, c.nominal.contacts]
        inverse = [c.inverse(h, blocks) for h, blocks in zip(self._h, self._coupling, strict=True)]
        contact, to_shapes, from_shapes = (np.ascontiguousarray(part, np.complex64) for part in parts)
        return contact, to_shapes, from_shapes, np.stack(inverse)

    @cached_property
    def blocks(self) -> np.ndarray:
        """(N, n_c n_coeff, n_c n_coeff) what the contacts of a sector do to themselves, of its own and its neighbours'
        deviations; a preconditioner."""
        a = self.compliance.nominal
        N, n_c, r = a.n_sectors, len(a.k), self._coupling.shape[2]
        blocks_of_harmonics = np.repeat(self._contact.mean(axis=1)[:, None], N, axis=1)  # (n_h, N, n_c, n_c)
        if r:
            neighbours = np.unique(np.array([-1, 0, 1]) % N)
            to = fft.fft(self._from_shapes[:, :, a.contacts], axis=1)[:, -neighbours % N] / N  # (n_h, near, n_c, r)
            out = fft.fft(self._to_shapes[:, :, :, a.contacts], axis=1)[:, neighbours] / N  # (n_h, near, r, n_c)
            n, m = len(neighbours), len(neighbours) * r
            coupling = (
                self._coupling[:, (neighbours[:, None] - neighbours) % N].transpose(0, 1, 3, 2, 4).reshape(-1, 1, m, m)
            )
            d = np.repeat(self.compliance.deviation[(np.arange(N)[:, None] + neighbours) % N], r, axis=1)[
                None, :, :, None
            ]
            to, out = to.transpose(0, 2, 1, 3).reshape(-1, 1, n_c, m), out.reshape(-1, 1, n * r, n_c)
            blocks_of_harmonics = blocks_of_harmonics - to @ np.linalg.solve(np.eye(m) + d * coupling, d * out)
        return self.compliance.basis.real_matrices(blocks_of_harmonics)


class JacobianProduct:
    """G restricted to rows of the contact, in single precision: as exact as a Newton direction needs."""

    def __init__(self, point: MistunedPoint, rows: np.ndarray):
        self._point, self._rows = point, rows
        self._contact, self._to_shapes, self._from_shapes, self._inverse = point.single

    def __call__(self, d: np.ndarray) -> np.ndarray:
        """G d for d (n_rows, n_coeff)."""
        c = self._point.compliance
        full = np.zeros((c.n_contact, d.shape[1]))
        full[self._rows] = d
        force = c.basis.to_complex(full).astype(np.complex64).T.reshape(len(self._contact), c.nominal.n_sectors, -1)
        waves = fft.ifft(force, axis=1)[..., None]
        wave_motion = np.matmul(self._contact, waves)
        n_h, N, r = self._from_shapes.shape[0], self._from_shapes.shape[1], self._from_shapes.shape[3]
        if r:
            shape_motion = fft.fft(np.matmul(self._to_shapes, waves)[..., 0], axis=1).reshape(n_h, N * r, 1)
            reaction = fft.ifft(np.matmul(self._inverse, shape_motion).reshape(n_h, N, r), axis=1)
            wave_motion -= np.matmul(self._from_shapes, reaction[..., None])
        displacement = fft.fft(wave_motion[..., 0], axis=1).reshape(n_h, -1)
        return c.basis.to_real(displacement.T)[self._rows]
