"""The linear side of a wheel whose sectors differ in stiffness: that of sectors alike, corrected on a few shapes.

Sectors alike have a block-circulant compliance H(s): a discrete Fourier transform over the sectors leaves a small
matrix for every nodal diameter. Sector n deviates by P^H d_n P, P its rows on a few shapes (`reduction.nominal_modes`):

    G = H - H P^H (I + d P H P^H)^-1 d P H

of which only the matrix in brackets, a few rows for each sector, is solved (Woodbury). Nothing of the size of the wheel
is decomposed.
Source  Yang and Griffin 2001; Sherman and Morrison 1950; Woodbury 1950
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy import fft
from scipy.linalg import inv, lu_factor, lu_solve

from tribodyn.fem.cyclic_symmetry import sector_name
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.expansion import Expansion
from tribodyn.reduction.wave_model import WaveModel
from tribodyn.refusal import Refusal

ROOM = 2e8  # bytes of matrices of sectors alike that are kept for frequencies met again


class Alike:
    """Port compliances of a wheel of sectors alike, contacts stuck and closed; shared by all that deviate from it.

    model : a travelling wave whose outputs hold the rows `ports`; springs : (n_pair, n_component) of one sector [N/m]
    excitation : of sector 0; a wave of the model's engine order brings it to the others
    omega_max : largest excitation frequency to come [rad/s]
    """

    def __init__(
        self,
        model: WaveModel,
        springs: np.ndarray,
        basis: HarmonicBasis,
        excitation: Excitation,
        omega_max: float,
        ports: tuple[str, ...],
    ):
        self.n_sectors = N = model.n_sectors
        self.k = np.asarray(springs, float).ravel()
        system, _ = model.at_index(0)
        excitation.check(basis, system.loads)
        self.load_names = names = tuple(sorted({name for _, name in excitation.loads}))
        self.outputs = tuple(name for name in system.outputs if name not in ports)
        counts = np.cumsum([0, len(self.k), len(names), len(self.outputs), len(ports)])
        self.contacts, self.loads, self.seen, self.ports = (slice(*pair) for pair in pairwise(counts))
        self.n_port = int(counts[-1])
        self._of_index: list[Expansion] = []
        for index in range(N // 2 + 1):
            system, B = model.at_index(index)
            rows = [np.conj(system.loads[name]) for name in names]
            rows += [system.outputs[name] for name in (*self.outputs, *ports)]
            together = np.concatenate([np.asarray(B), np.array(rows).reshape(len(rows), -1)])
            s_max = basis.harmonics[-1] * omega_max
            self._of_index.append(Expansion(system, np.asarray(B), self.k, together, s_max))
        self._mirrored = [None if one.hermitian else one.mirrored() for one in self._of_index]
        self.error = max(one.error for one in self._of_index)
        self.force = np.zeros((len(basis.harmonics), N, len(names)), complex)
        order = model.engine_order
        for (h, name), value in excitation.loads.items():
            if h in basis.harmonics:
                turned = value * np.exp(-2j * np.pi * (h * order * np.arange(N) % N) / N)
                self.force[basis.harmonics.index(h), :, names.index(name)] = turned
        self._kept: OrderedDict[complex, np.ndarray] = OrderedDict()

    def at(self, s: complex) -> np.ndarray:
        """(N, n_port, n_port) compliance of every wave at s = i h w, index by index."""
        if s in self._kept:
            self._kept.move_to_end(s)
            return self._kept[s]
        found = self._of_every_index(lambda one: one.at(s).matrix())
        self._kept[s] = found
        while len(self._kept) > 1 and len(self._kept) * found.nbytes > ROOM:
            self._kept.popitem(last=False)
        return found

    def slope(self, s: complex) -> np.ndarray:
        """d (at) / d s."""
        return self._of_every_index(lambda one: one.at(s).slope(np.eye(self.n_port), 1.0))

    def _of_every_index(self, make: Callable[[Expansion], np.ndarray]) -> np.ndarray:
        N = self.n_sectors
        found = np.empty((N, self.n_port, self.n_port), complex)
        for index, (one, other) in enumerate(zip(self._of_index, self._mirrored, strict=True)):
            found[index] = make(one)
            if 0 < 2 * index < N:  # without what turns, a wave the other way is reciprocal to this one
                found[N - index] = found[index].T if other is None else make(other)
        return found


class MistunedCompliance:
    """The compliance of a wheel whose sectors deviate; it serves a balance as `ContactCompliance` does.

    deviation : (N,) relative, of the stiffness of every sector, above -1
    """

    base = None

    def __init__(self, alike: Alike, basis: HarmonicBasis, deviation: np.ndarray):
        self.alike, self.basis = alike, basis
        self.deviation = np.asarray(deviation, float)
        if self.deviation.shape != (alike.n_sectors,) or not np.all(self.deviation > -1):
            raise Refusal(f"mistuning needs {alike.n_sectors} deviations of stiffness above -1, one per sector")
        self.k = np.tile(alike.k, alike.n_sectors)
        self.n_contact = len(self.k)
        self.output_names = tuple(sector_name(name, n) for name in alike.outputs for n in range(alike.n_sectors))
        self.error = alike.error
        self._force = alike.force
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

    def factor(self, h: float, around: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Factors of I + d P H P^H (N r, N r) of a harmonic, from P H P^H by distance of sectors (N, r, r)."""
        if h == 0 and self._static is not None:
            return self._static
        matrix = self.matrix(around)
        found: tuple[np.ndarray, np.ndarray] = lu_factor(matrix, overwrite_a=True, check_finite=False)
        if h == 0:
            self._static = found
        return found

    def inverse(self, h: float, around: np.ndarray) -> np.ndarray:
        """(I + d P H P^H)^-1 d of a harmonic in single precision; arguments as for `factor`."""
        if h == 0 and self._static_inverse is not None:
            return self._static_inverse
        made = inv(self.matrix(around).astype(np.complex64), overwrite_a=True, check_finite=False)
        found: np.ndarray = made * np.repeat(self.deviation, around.shape[1]).astype(np.float32)
        if h == 0:
            self._static_inverse = found
        return found

    def matrix(self, around: np.ndarray) -> np.ndarray:
        """I + d P H P^H (N r, N r); see `factor`."""
        N, r = self.alike.n_sectors, around.shape[1]
        apart = (np.arange(N)[:, None] - np.arange(N)) % N
        matrix = around[apart].transpose(0, 2, 1, 3).reshape(N * r, N * r) * np.repeat(self.deviation, r)[:, None]
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
    left_out : of its flexibility, by `nearly` and the products
    """

    left_out = 0.0

    def __init__(self, compliance: MistunedCompliance, omega: float):
        self.compliance, self.omega = compliance, omega
        a = compliance.alike
        self._h = np.asarray(compliance.basis.harmonics, float)
        H = np.stack([a.at(1j * h * omega) for h in self._h])
        self._H = H
        self._moved = np.ascontiguousarray(H[:, :, a.ports])  # of the mistuned shapes, under all forces
        self._back = np.ascontiguousarray(H[:, :, :, a.ports])  # of all ports, under forces on these shapes
        self._contact = np.ascontiguousarray(H[:, :, a.contacts, a.contacts])
        self._around = fft.fft(self._moved[:, :, :, a.ports], axis=1) / a.n_sectors  # by distance of two sectors
        self._factors = [compliance.factor(h, one) for h, one in zip(self._h, self._around, strict=True)]
        load = np.zeros((len(self._h), a.n_sectors, a.n_port), complex)
        load[:, :, a.loads] = compliance.force
        moved = self._displaced(load)
        self.x_lin, self.outputs_lin = self._contact_rows(moved), self._output_rows(moved)

    def _displaced(self, force: np.ndarray, H: np.ndarray | None = None) -> np.ndarray:
        """Displacement of all ports under forces on all of them, both (n_harmonic, N, n_port) complex.

        H : other matrices (n_harmonic, N, n_port, n_port) for the way from the forces, such as slopes
        """
        H = self._H if H is None else H
        there = np.matmul(H, fft.ifft(force, axis=1)[..., None])[..., 0]
        reaction = self._reaction(there[:, :, self.compliance.alike.ports])
        return np.asarray(fft.fft(there - np.matmul(self._back, reaction[..., None])[..., 0], axis=1))

    def deviating(self, force: np.ndarray) -> np.ndarray:
        """Forces (n_harmonic, N, r) of the deviating stiffness on its shapes, under forces (n_harmonic, N, n_port)."""
        moved = self._displaced(force)[:, :, self.compliance.alike.ports]
        return -self.compliance.deviation[:, None] * moved

    def _reaction(self, waves: np.ndarray) -> np.ndarray:
        """Waves of the forces that deviating stiffness adds, from the waves of what sectors alike do (n_h, N, r)."""
        n_h, N, r = waves.shape
        if r == 0:
            return waves
        pushed = (fft.fft(waves, axis=1) * self.compliance.deviation[:, None]).reshape(n_h, N * r)
        found = [lu_solve(factor, one, check_finite=False) for factor, one in zip(self._factors, pushed, strict=True)]
        return np.asarray(fft.ifft(np.stack(found).reshape(n_h, N, r), axis=1))

    def _contact_rows(self, moved: np.ndarray) -> np.ndarray:
        x = moved[:, :, self.compliance.alike.contacts]
        return self.compliance.basis.to_real(x.reshape(len(x), -1).T)

    def _output_rows(self, moved: np.ndarray) -> np.ndarray:
        y = moved[:, :, self.compliance.alike.seen].transpose(2, 1, 0)
        return self.compliance.basis.to_real(y.reshape(-1, y.shape[2]))

    def _on_ports(self, g: np.ndarray) -> np.ndarray:
        a = self.compliance.alike
        force = np.zeros((len(self._h), a.n_sectors, a.n_port), complex)
        force[:, :, a.contacts] = self._amplitudes(g)
        return force

    def _amplitudes(self, g: np.ndarray) -> np.ndarray:
        return self.compliance.basis.to_complex(g).T.reshape(len(self._h), self.compliance.alike.n_sectors, -1)

    def apply(self, g: np.ndarray) -> np.ndarray:
        """G g: (N n_c, n_coeff) relative displacement [m] under contact forces g (N n_c, n_coeff) [N]."""
        c = self.compliance.alike.contacts
        waves = fft.ifft(self._amplitudes(g), axis=1)[..., None]
        reaction = self._reaction(np.matmul(self._moved[:, :, :, c], waves)[..., 0])
        there = np.matmul(self._contact, waves) - np.matmul(self._back[:, :, c], reaction[..., None])
        moved = fft.fft(there[..., 0], axis=1)
        return self.compliance.basis.to_real(moved.reshape(len(moved), -1).T)

    nearly = apply

    def outputs(self, g: np.ndarray) -> np.ndarray:
        """(n_output, n_coeff) outputs under contact forces g alone [m]."""
        return self._output_rows(self._displaced(self._on_ports(g)))

    def slope(self, g: np.ndarray, load_factor: float) -> tuple[np.ndarray, np.ndarray]:
        """d / d omega of contact displacement and outputs under g and the excitation, vibrating part times factor."""
        a = self.compliance.alike
        force = self._on_ports(g)
        force[:, :, a.loads] += self.compliance.force * np.where(self._h, load_factor, 1.0)[:, None, None]
        # all forces on sectors alike, those of the deviating stiffness among them
        waves = np.matmul(self._H, fft.ifft(force, axis=1)[..., None])[..., 0]
        force[:, :, a.ports] -= fft.fft(self._reaction(waves[:, :, a.ports]), axis=1)
        moved = self._displaced(force, self._slopes)
        return self._contact_rows(moved), self._output_rows(moved)

    @cached_property
    def _slopes(self) -> np.ndarray:
        """(n_harmonic, N, n_port, n_port) d / d omega of the matrices of sectors alike."""
        a = self.compliance.alike
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
        parts = self._contact, self._moved[:, :, :, c.alike.contacts], self._back[:, :, c.alike.contacts]
        inverse = [c.inverse(h, one) for h, one in zip(self._h, self._around, strict=True)]
        contact, moved, back = (np.ascontiguousarray(part, np.complex64) for part in parts)
        return contact, moved, back, np.stack(inverse)

    @cached_property
    def blocks(self) -> np.ndarray:
        """(N, n_c n_coeff, n_c n_coeff) what the contacts of a sector do to themselves, of its own and its neighbours'
        deviations; a preconditioner."""
        a = self.compliance.alike
        N, n_c, r = a.n_sectors, len(a.k), self._around.shape[2]
        found = np.repeat(self._contact.mean(axis=1)[:, None], N, axis=1)  # (n_h, N, n_c, n_c)
        if r:
            near = np.unique(np.array([-1, 0, 1]) % N)
            to = fft.fft(self._back[:, :, a.contacts], axis=1)[:, -near % N] / N  # (n_h, near, n_c, r)
            out = fft.fft(self._moved[:, :, :, a.contacts], axis=1)[:, near] / N  # (n_h, near, r, n_c)
            n, m = len(near), len(near) * r
            around = self._around[:, (near[:, None] - near) % N].transpose(0, 1, 3, 2, 4).reshape(-1, 1, m, m)
            d = np.repeat(self.compliance.deviation[(np.arange(N)[:, None] + near) % N], r, axis=1)[None, :, :, None]
            to, out = to.transpose(0, 2, 1, 3).reshape(-1, 1, n_c, m), out.reshape(-1, 1, n * r, n_c)
            found = found - to @ np.linalg.solve(np.eye(m) + d * around, d * out)
        return self.compliance.basis.real_matrices(found)


class JacobianProduct:
    """G restricted to rows of the contact, in single precision: as exact as a Newton direction needs."""

    def __init__(self, point: MistunedPoint, rows: np.ndarray):
        self._point, self._rows = point, rows
        self._contact, self._moved, self._back, self._inverse = point.single

    def __call__(self, d: np.ndarray) -> np.ndarray:
        """G d for d (n_rows, n_coeff)."""
        c = self._point.compliance
        full = np.zeros((c.n_contact, d.shape[1]))
        full[self._rows] = d
        force = c.basis.to_complex(full).astype(np.complex64).T.reshape(len(self._contact), c.alike.n_sectors, -1)
        waves = fft.ifft(force, axis=1)[..., None]
        there = np.matmul(self._contact, waves)
        n_h, N, r = self._back.shape[0], self._back.shape[1], self._back.shape[3]
        if r:
            moved = fft.fft(np.matmul(self._moved, waves)[..., 0], axis=1).reshape(n_h, N * r, 1)
            reaction = fft.ifft(np.matmul(self._inverse, moved).reshape(n_h, N, r), axis=1)
            there -= np.matmul(self._back, reaction[..., None])
        found = fft.fft(there[..., 0], axis=1).reshape(n_h, -1)
        return c.basis.to_real(found.T)[self._rows]
