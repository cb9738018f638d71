"""Contact compliance: displacement of contact and outputs under contact forces and loads, harmonic by harmonic.

The contact springs, stuck and closed, are part of the linear system: K_s = K + B^T k B, so that it depends neither on
the load nor on wear. Its lowest modes Phi carry the dynamics; the rest is expanded in powers of s = i h w:

    D(s)^-1 = W(s) + L(s) S(s)^-1 L'(s),   W(s) = sum_k s^k W_k,   W_0 = K_s^-1 - Phi Lambda^-1 Phi^H,
    W_k = -W_0 (C W_(k-1) + M W_(k-2)),    L(s) = (I - s W(s) C) Phi,
    S(s) = Lambda + s C_m + s^2 - s^2 Phi^H C W(s) C Phi,

which holds for any damping matrix; the error falls like (|s| / omega_next)^order and is measured against a direct
solve.
Source  block elimination of modal coordinates (ours); static correction of truncated modes as in MacNeal 1971.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sla

from fem.system import SecondOrderSystem
from hbm.excitation import Excitation
from hbm.harmonics import HarmonicBasis
from reduction.model import ReducedModel

RESOLUTION = 5e-10  # relative error allowed in the expansion at the highest frequency asked for
ROUNDING = 1e-7  # largest error that may be rounding
CANDIDATES = ((24, 4), (48, 4), (48, 6), (96, 6), (192, 6))  # modes and powers of s tried in turn
ALL_MODES_BELOW = 1500  # coordinates up to which all modes are computed at once


NO_DISTANCE = 1e-13  # of a frequency from an undamped resonance, relative: the response is rounding alone


class SingularStuckSystem(ValueError):
    """The structure can move as a rigid body even with every contact stuck."""


class UndampedResonance(ValueError):
    """The response of the stuck structure is infinite at this frequency."""


class Expansion:
    """D(s)^-1 between ports (contacts, loads, outputs) of one stuck system; see the module text.

    system : dense, b : (n_contact, n) contact map, stiffness : (n_contact,) stuck contact springs [N/m]
    ports : (n_port, n) rows; contact rows first
    s_max : largest h w that will be asked for [rad/s]
    error : relative error at s_max, against a direct solve
    Raises  SingularStuckSystem
    """

    def __init__(
        self, system: SecondOrderSystem, b: np.ndarray, stiffness: np.ndarray, ports: np.ndarray, s_max: float
    ):
        self.n_port = len(ports)
        self._n_contact = len(b)
        mass = np.asarray(system.mass)
        damping = np.zeros_like(mass) if system.damping is None else np.asarray(system.damping)
        stuck = np.asarray(system.stiffness) + b.conj().T @ (stiffness[:, None] * b)
        stuck = 0.5 * (stuck + stuck.conj().T)
        self._system = (mass, damping, stuck)
        self._ports = ports
        n = len(mass)
        loose = SingularStuckSystem(
            "the part can move as a rigid body even with all contacts stuck: clamp it, add a spring, "
            "or raise the contact stiffness"
        )
        try:
            factor = sla.cho_factor(stuck)
            lam, phi = _modes(stuck, mass, n if n < ALL_MODES_BELOW else CANDIDATES[-1][0])
        except np.linalg.LinAlgError:
            raise loose from None
        # a rigid mode comes out of the eigenvalue problem as rounding of the stiffest ones, of either sign
        if lam[0] <= n * np.finfo(float).eps * np.max(np.diag(stuck).real / np.diag(mass).real):
            raise loose
        before = np.inf
        last = (len(lam), 1 if len(lam) == n else 8)
        for m, order in (*(c for c in CANDIDATES if c[0] < len(lam)), last):
            self._build(lam[:m], phi[:, :m], factor, order)
            self.error = self._measure_error(1j * s_max)
            # near a resonance rounding of the direct solve itself is what remains: more modes would not help
            if self.error <= RESOLUTION or 0.5 * before < self.error < ROUNDING:
                break
            before = self.error

    def _build(self, lam: np.ndarray, phi: np.ndarray, factor: tuple[np.ndarray, bool], order: int) -> None:
        mass, damping, _ = self._system
        cphi = damping @ phi
        full = len(lam) == len(mass)

        def quasi_static(y: np.ndarray) -> np.ndarray:  # W_0 y
            return sla.cho_solve(factor, y) - phi @ ((phi.conj().T @ y) / lam[:, None])

        right = np.concatenate([self._ports.conj().T, cphi], axis=1)
        y_before, y = np.zeros_like(right), np.zeros_like(right) if full else quasi_static(right)
        moments = []
        for _ in range(order):
            moments.append(y)
            if full:
                break
            y_before, y = y, -quasi_static(damping @ y + mass @ y_before)
        p, n = self.n_port, self._n_contact
        self.order = len(moments)
        self.w = np.stack([self._ports @ y[:, :p] for y in moments])  # (order, port, port)
        self.e = np.stack([self._ports @ y[:, p:] for y in moments])  # (order, port, mode)
        self.t = np.stack([cphi.conj().T @ y[:, p:] for y in moments])  # (order, mode, mode)
        self.b = self._ports @ phi  # (port, mode)
        self.lam = lam
        self.c = phi.conj().T @ cphi
        self.w0 = np.ascontiguousarray(self.w[0, :n, :n])
        # higher moments contribute |s| / omega_next and less: single precision keeps them exact enough
        single = np.complex64 if np.iscomplexobj(self.w) else np.float32
        self.w0_single, self.b_single = self.w0.astype(single), self.b[:n].astype(single)
        self.higher = np.ascontiguousarray(self.w[1:, :n, :n], dtype=single)

    def at(self, s: complex) -> PortCompliance:
        """The compliance at s = i h w."""
        power = s ** np.arange(self.order)
        left = self.b - s * np.tensordot(power, self.e, 1)
        right = self.b.conj().T - s * np.tensordot(power, self.e.conj().transpose(0, 2, 1), 1)
        core = np.diag(self.lam + s * s) + s * self.c - s * s * np.tensordot(power, self.t, 1)
        return PortCompliance(self, s, power, left, right, self._inverse(core, s))

    def _inverse(self, core: np.ndarray, s: complex) -> np.ndarray:
        """Inverse of the modal dynamic stiffness; raises UndampedResonance."""
        try:
            inverse = np.linalg.inv(core)
            lost = NO_DISTANCE * np.abs(inverse).max() * abs(s) ** 2 > 1.0
        except np.linalg.LinAlgError:
            lost = True
        if lost:
            raise UndampedResonance(
                f"the stuck structure has an undamped resonance at {abs(s) / (2 * np.pi):.6g} Hz, where its response "
                "is infinite: give it damping or take another frequency"
            )
        return inverse

    def _measure_error(self, s: complex) -> float:
        mass, damping, stuck = self._system
        probe = np.random.default_rng(0).normal(size=(self.n_port, 2))
        exact = self._ports @ np.linalg.solve(stuck + s * damping + s * s * mass, self._ports.conj().T @ probe)
        return float(np.abs(self.at(s).apply(probe) - exact).max() / np.abs(exact).max())


def _modes(stiffness: np.ndarray, mass: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The lowest modes: squared frequencies (count,) and shapes (n, count) of unit modal mass.

    They come from the compliance's side, M phi = nu K phi: rounding is then relative to the softest mode, however much
    stiffer the contact springs are, and what it does to stiff ones is as small as their share in the compliance.
    """
    n = len(mass)
    nu, phi = sla.eigh(mass, stiffness, subset_by_index=None if count >= n else (n - count, n - 1))
    nu, phi = nu[::-1], phi[:, ::-1]
    lam = 1.0 / np.maximum(nu, np.finfo(float).eps ** 2 * nu[0])  # without mass: as good as rigid
    return lam, phi * np.sqrt(lam)


@dataclass(frozen=True)
class PortCompliance:
    """D(s)^-1 between ports at one s: sum_k s^k W_k + left core right."""

    expansion: Expansion
    s: complex
    power: np.ndarray
    left: np.ndarray
    right: np.ndarray
    core: np.ndarray

    @cached_property
    def core_single(self) -> np.ndarray:
        """The core in single precision."""
        return self.core.astype(np.complex64)

    @cached_property
    def core_on_pairs(self) -> np.ndarray:
        """The same as a real matrix on [a, b], or on x_0 where s = 0."""
        re, im = self.core.real, self.core.imag
        return (re if self.s == 0 else np.block([[re, im], [-im, re]])).astype(np.float32)

    def apply(self, force: np.ndarray, columns: slice = slice(None), rows: slice = slice(None)) -> np.ndarray:
        """Displacement of the ports in `rows` under forces (n, ...) at the ports in `columns`."""
        w = self.expansion.w
        out = self.left[rows] @ (self.core @ (self.right[:, columns] @ force))
        for k in range(self.expansion.order):
            out = out + self.power[k] * _product(w[k, rows, columns], force)
        return out

    def slope(self, force: np.ndarray) -> np.ndarray:
        """d (apply) / d s."""
        x = self.expansion
        k = np.arange(x.order)
        d_power = np.concatenate([[0.0], k[1:] * self.power[:-1]])
        se = self.power + self.s * d_power  # d (s s^k) / d s
        sst = 2 * self.s * self.power + self.s**2 * d_power
        d_left = -np.tensordot(se, x.e, 1)
        d_right = -np.tensordot(se, x.e.conj().transpose(0, 2, 1), 1)
        d_core = 2 * self.s * np.eye(len(x.lam)) + x.c - np.tensordot(sst, x.t, 1)
        inner = self.core @ (self.right @ force)
        out = d_left @ inner + self.left @ (self.core @ (d_right @ force - d_core @ inner))
        for j in range(1, x.order):
            out = out + d_power[j] * _product(x.w[j], force)
        return out


def _product(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """matrix @ vector, without widening a real matrix to complex."""
    if np.iscomplexobj(matrix) or not np.iscomplexobj(vector):
        return matrix @ vector
    return matrix @ vector.real + 1j * (matrix @ vector.imag)


class ContactCompliance:
    """The linear side of a harmonic balance: G_h(w) between contacts, loads and outputs of a reduced model.

    model : reduced model; stiffness : (n_pair, n_component) stuck springs [N/m]
    excitation : loads whose names are ports; omega_max : largest excitation frequency that will be asked for [rad/s]
    """

    def __init__(
        self, model: ReducedModel, stiffness: np.ndarray, basis: HarmonicBasis, excitation: Excitation, omega_max: float
    ):
        self.basis = basis
        self.k = np.asarray(stiffness, float).ravel()
        self.n_contact = len(self.k)
        system, _ = model.at_harmonic(basis.harmonics[-1])
        excitation.check(basis, system.loads)
        self.output_names = tuple(system.outputs)
        load_names = sorted({name for _, name in excitation.loads})
        self.n_load = len(load_names)
        self._load = np.zeros((len(load_names), len(basis.harmonics)), complex)
        for (h, name), value in excitation.loads.items():
            if h in basis.harmonics:
                self._load[load_names.index(name), basis.harmonics.index(h)] = value
        self.base = excitation.base
        self.groups: list[tuple[Expansion, list[int]]] = []
        seen = [model.at_harmonic(h) for h in basis.harmonics]
        sharing: dict[int, list[int]] = {}
        for position, (system, _) in enumerate(seen):
            sharing.setdefault(id(system), []).append(position)
        for positions in sharing.values():
            system, b = seen[positions[0]]
            loads = [np.conj(system.loads[name])[None] for name in load_names]
            outputs = [system.outputs[name][None] for name in self.output_names]
            ports = np.concatenate([np.asarray(rows) for rows in (b, *loads, *outputs)])
            s_max = basis.harmonics[positions[-1]] * omega_max
            self.groups.append((Expansion(system, np.asarray(b), self.k, ports, s_max), positions))
        self.error = max(e.error for e, _ in self.groups)
        self.shared_real = len(self.groups) == 1 and not np.iscomplexobj(self.groups[0][0].w0)

    def restricted(self, basis: HarmonicBasis) -> ContactCompliance:
        """The same for fewer of the harmonics; the expansions are shared."""
        old = self.basis.harmonics
        other = object.__new__(ContactCompliance)
        other.__dict__.update(self.__dict__)
        other.basis = basis
        other._load = self._load[:, [old.index(h) for h in basis.harmonics]]
        other.base = None if self.base is None else self.basis.transfer(self.base, basis)
        kept = [(e, [basis.harmonics.index(old[p]) for p in ps if old[p] in basis.harmonics]) for e, ps in self.groups]
        other.groups = [(expansion, positions) for expansion, positions in kept if positions]
        other.shared_real = len(other.groups) == 1 and not np.iscomplexobj(other.groups[0][0].w0)
        return other

    def at(self, omega: float) -> CompliancePoint:
        """The compliance at one excitation frequency [rad/s]."""
        return CompliancePoint(self, omega)

    def port_force(self, g: np.ndarray | None) -> np.ndarray:
        """(n_port, n_harmonic) complex port forces: g [N] at the contacts alone, or the excitation where g is None."""
        if g is not None:
            contact, load = self.basis.to_complex(g), np.zeros_like(self._load)
        else:
            base = np.zeros((self.n_contact, self.basis.n_coeff)) if self.base is None else self.base
            contact, load = self.basis.to_complex(self.k[:, None] * base), self._load
        return np.concatenate([contact, load, np.zeros((len(self.output_names), load.shape[1]))])


class CompliancePoint:
    """Contact compliance at one frequency.

    x_lin : (n_contact, n_coeff) relative displacement of the stuck, closed structure under the excitation [m]
    outputs_lin : (n_output, n_coeff) its outputs [m]
    """

    def __init__(self, compliance: ContactCompliance, omega: float):
        self._c = compliance
        self.omega = omega
        basis = compliance.basis
        self._harmonics = np.asarray(basis.harmonics, float)
        self._ports = [
            [expansion.at(1j * basis.harmonics[p] * omega) for p in positions]
            for expansion, positions in compliance.groups
        ]
        n, stop = compliance.n_contact, compliance.n_contact + compliance.n_load
        excited = slice(n, stop) if compliance.base is None else slice(0, stop)
        ports = self._through_ports(compliance.port_force(None)[excited], excited)
        x, self.outputs_lin = basis.to_real(ports[:n]), basis.to_real(ports[stop:])
        self.x_lin = x if compliance.base is None else x - compliance.base

    def _through_ports(self, force: np.ndarray, columns: slice = slice(None), rows: slice = slice(None)) -> np.ndarray:
        first = self._c.groups[0][0]
        out = np.zeros((len(range(*rows.indices(first.n_port))), force.shape[1]), complex)
        for (_, positions), ports in zip(self._c.groups, self._ports, strict=True):
            for p, port in zip(positions, ports, strict=True):
                out[:, p] = port.apply(force[:, p], columns, rows)
        return out

    def apply(self, g: np.ndarray) -> np.ndarray:
        """G g: (n_contact, n_coeff) relative displacement [m] under contact forces g (n_contact, n_coeff) [N]."""
        n, basis = self._c.n_contact, self._c.basis
        if self._c.shared_real:
            return self._apply_shared_real(g)
        force = basis.to_complex(g)
        out = np.zeros_like(force)
        for (expansion, positions), ports in zip(self._c.groups, self._ports, strict=True):
            for p, port in zip(positions, ports, strict=True):
                f = force[:, p]
                y = _product(expansion.w0, f) + port.left[:n] @ (port.core @ (port.right[:, :n] @ f))
                for k, moment in enumerate(expansion.higher, start=1):
                    y += port.power[k] * _product(moment, f.astype(np.complex64))
                out[:, p] = y
        return basis.to_real(out)

    def _apply_shared_real(self, g: np.ndarray) -> np.ndarray:
        """The same for one real system: every moment meets all harmonics in one real product."""
        n, basis = self._c.n_contact, self._c.basis
        expansion, ports = self._c.groups[0][0], self._ports[0]
        force = basis.to_complex(g)
        moved = np.zeros_like(force)
        for i, port in enumerate(ports):
            moved[:, i] = port.left[:n] @ (port.core @ (port.right[:, :n] @ force[:, i]))
        if len(expansion.higher):
            dynamic = slice(int(basis.has_static), None)
            f = force[:, dynamic]
            columns = np.concatenate([f.real, f.imag], axis=1).astype(np.float32)
            higher = (expansion.higher.reshape(-1, n) @ columns).reshape(len(expansion.higher), n, -1)
            half = f.shape[1]
            for k, z in enumerate(higher, start=1):
                power = np.array([port.power[k] for port in ports[dynamic]])
                moved[:, dynamic] += power * (z[:, :half] + 1j * z[:, half:])
        return basis.to_real(moved) + expansion.w0 @ g

    def outputs(self, g: np.ndarray) -> np.ndarray:
        """(n_output, n_coeff) outputs under contact forces g alone [m]."""
        c = self._c
        contacts, outputs = slice(0, c.n_contact), slice(c.n_contact + c.n_load, None)
        return c.basis.to_real(self._through_ports(c.basis.to_complex(g), contacts, outputs))

    def slope(self, g: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """d / d omega of contact displacement and outputs under g alone, or under the excitation where g is None."""
        c = self._c
        force = c.port_force(g)
        moved = np.zeros_like(force)
        for (_, positions), ports in zip(c.groups, self._ports, strict=True):
            for p, port in zip(positions, ports, strict=True):
                moved[:, p] = 1j * self._harmonics[p] * port.slope(force[:, p])
        return c.basis.to_real(moved[: c.n_contact]), c.basis.to_real(moved[c.n_contact + c.n_load :])

    def jacobian_product(self, rows: np.ndarray) -> JacobianProduct:
        """The product with G restricted to contact rows (active ones), to the accuracy a Newton direction needs."""
        return JacobianProduct(self._c, self._ports, rows)


class JacobianProduct:
    """G restricted to active rows, as exact as a Newton direction needs: W_0 and the lowest modes, single precision."""

    def __init__(self, compliance: ContactCompliance, ports: list[list[PortCompliance]], rows: np.ndarray):
        self._basis = compliance.basis
        self._shared_real = compliance.shared_real
        self._groups = []
        everything = len(rows) == compliance.n_contact
        for (expansion, positions), at in zip(compliance.groups, ports, strict=True):
            w0, b = expansion.w0_single, expansion.b_single
            if not everything:
                w0, b = w0[np.ix_(rows, rows)], b[rows]
            cores = [p.core_on_pairs if self._shared_real else p.core_single for p in at]
            self._groups.append((w0, b, np.ascontiguousarray(b.conj().T), cores, positions))

    def __call__(self, d: np.ndarray) -> np.ndarray:
        """G d for d (n_active, n_coeff)."""
        if self._shared_real:
            w0, b, bt, cores, _ = self._groups[0]
            single = d.astype(np.float32)
            z = bt @ single
            column = 0
            for core in cores:  # on [a, b] of one harmonic, or on x_0
                width = len(core) // len(z)
                part = core @ z[:, column : column + width].T.ravel()
                z[:, column : column + width] = part.reshape(width, -1).T
                column += width
            return w0 @ single + b @ z
        force = self._basis.to_complex(d).astype(np.complex64)
        moved = np.empty_like(force)
        for w0, b, bt, cores, positions in self._groups:
            for core, p in zip(cores, positions, strict=True):
                f = force[:, p]
                moved[:, p] = _product(w0, f) + _product(b, core @ _product(bt, f))
        return self._basis.to_real(moved)
