"""Contact compliance: displacement of the contact and of the outputs under contact forces and loads, harmonic by harmonic.

The contact springs, stuck and closed, are part of the linear system: K_s = K + B^T k B, so that it depends neither on
the load nor on wear. Its lowest modes Phi carry the dynamics; the rest is expanded in powers of s = i h w around statics,

    D(s)^-1 = W(s) + L(s) S(s)^-1 L'(s),   W(s) = sum_k s^k W_k,   W_0 = K_s^-1 - Phi Lambda^-1 Phi^H,
    W_k = -W_0 (C W_(k-1) + M W_(k-2)),    L(s) = (I - s W(s) C) Phi,
    S(s) = Lambda + s C_m + s^2 - s^2 Phi^H C W(s) C Phi,

which holds for any damping matrix; the error falls like (|s| / omega_next)^order and is measured against a direct solve.
Source  block elimination of modal coordinates (ours); static correction of truncated modes as in MacNeal 1971.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla

from fem.system import SecondOrderSystem
from hbm.excitation import Excitation
from hbm.harmonics import HarmonicBasis
from reduction.model import ReducedModel

RESOLUTION = 5e-10  # relative error allowed in the expansion at the highest frequency asked for
CANDIDATES = ((24, 4), (48, 4), (48, 6), (96, 6), (192, 6))  # modes and powers of s tried in turn
ALL_MODES_BELOW = 1500  # coordinates up to which all modes are computed at once


class SingularStuckSystem(ValueError):
    """The structure can move as a rigid body even with every contact stuck."""


class Expansion:
    """D(s)^-1 between ports (contacts, loads, outputs) of one stuck system; see the module text.

    system : dense, b : (n_contact, n) contact map, stiffness : (n_contact,) stuck contact springs [N/m]
    ports : (n_port, n) rows; contact rows first
    s_max : largest h w that will be asked for [rad/s]
    error : relative error at s_max, against a direct solve
    Raises  SingularStuckSystem
    """

    def __init__(self, system: SecondOrderSystem, b: np.ndarray, stiffness: np.ndarray, ports: np.ndarray, s_max: float):
        self.n_port = len(ports)
        self._n_contact = len(b)
        mass = np.asarray(system.mass)
        damping = np.zeros_like(mass) if system.damping is None else np.asarray(system.damping)
        stuck = np.asarray(system.stiffness) + b.conj().T @ (stiffness[:, None] * b)
        stuck = 0.5 * (stuck + stuck.conj().T)
        self._system = (mass, damping, stuck)
        self._ports = ports
        n = len(mass)
        try:
            factor = sla.cho_factor(stuck)
        except np.linalg.LinAlgError:
            raise SingularStuckSystem(
                "the part can move as a rigid body even with all contacts stuck: clamp it, add a spring, "
                "or raise the contact stiffness"
            ) from None
        lam, phi = sla.eigh(stuck, mass, subset_by_index=None if n < ALL_MODES_BELOW else (0, CANDIDATES[-1][0] - 1))
        for m, order in [*((m, order) for m, order in CANDIDATES if m < len(lam)), (len(lam), 1 if len(lam) == n else 8)]:
            self._build(lam[:m], phi[:, :m], factor, order)
            self.error = self._measure_error(1j * s_max)
            if self.error <= RESOLUTION:
                break

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
        p = self.n_port
        self.order = len(moments)
        self.w = np.stack([self._ports @ y[:, :p] for y in moments])  # (order, port, port)
        self.e = np.stack([self._ports @ y[:, p:] for y in moments])  # (order, port, mode)
        self.t = np.stack([cphi.conj().T @ y[:, p:] for y in moments])  # (order, mode, mode)
        self.b = self._ports @ phi  # (port, mode)
        n = self._n_contact
        self.contact_moments = np.ascontiguousarray(self.w[:, :n, :n])
        self.contact_modes = np.ascontiguousarray(self.b[:n])
        self.lam = lam
        self.c = phi.conj().T @ cphi

    def at(self, s: complex) -> PortCompliance:
        """The compliance at s = i h w."""
        power = s ** np.arange(self.order)
        left = self.b - s * np.tensordot(power, self.e, 1)
        right = self.b.conj().T - s * np.tensordot(power, self.e.conj().transpose(0, 2, 1), 1)
        core = np.diag(self.lam + s * s) + s * self.c - s * s * np.tensordot(power, self.t, 1)
        return PortCompliance(self, s, power, left, right, np.linalg.inv(core))

    def _measure_error(self, s: complex) -> float:
        mass, damping, stuck = self._system
        probe = np.random.default_rng(0).normal(size=(self.n_port, 2))
        exact = self._ports @ np.linalg.solve(stuck + s * damping + s * s * mass, self._ports.conj().T @ probe)
        return float(np.abs(self.at(s).apply(probe) - exact).max() / np.abs(exact).max())


@dataclass(frozen=True)
class PortCompliance:
    """D(s)^-1 between ports at one s: sum_k s^k W_k + left core right."""

    expansion: Expansion
    s: complex
    power: np.ndarray
    left: np.ndarray
    right: np.ndarray
    core: np.ndarray

    def apply(self, force: np.ndarray) -> np.ndarray:
        """(n_port, ...) displacement of the ports under port forces (n_port, ...)."""
        w = self.expansion.w
        out = self.left @ (self.core @ (self.right @ force))
        for k in range(self.expansion.order):
            out = out + self.power[k] * (w[k] @ force)
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
            out = out + d_power[j] * (x.w[j] @ force)
        return out


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
        self._n_load = len(load_names)
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

    def split(self, ports: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Complex port displacements -> real coefficients of the contacts and of the outputs."""
        return self.basis.to_real(ports[: self.n_contact]), self.basis.to_real(ports[self.n_contact + self._n_load :])


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
            [expansion.at(1j * basis.harmonics[p] * omega) for p in positions] for expansion, positions in compliance.groups
        ]
        x, self.outputs_lin = compliance.split(self._through_ports(compliance.port_force(None)))
        self.x_lin = x if compliance.base is None else x - compliance.base

    def _through_ports(self, force: np.ndarray, slope: bool = False) -> np.ndarray:
        out = np.zeros_like(force)
        for (_, positions), ports in zip(self._c.groups, self._ports, strict=True):
            for p, port in zip(positions, ports, strict=True):
                out[:, p] = port.slope(force[:, p]) if slope else port.apply(force[:, p])
        return out

    def apply(self, g: np.ndarray) -> np.ndarray:
        """G g: (n_contact, n_coeff) relative displacement [m] under contact forces g (n_contact, n_coeff) [N]."""
        n, basis = self._c.n_contact, self._c.basis
        force = basis.to_complex(g)
        out = np.zeros_like(force)
        for (expansion, positions), ports in zip(self._c.groups, self._ports, strict=True):
            w = expansion.contact_moments
            f = force[:, positions]
            columns = f if np.iscomplexobj(w) else np.concatenate([f.real, f.imag], axis=1)
            moved = (w.reshape(-1, n) @ columns).reshape(len(w), n, -1)
            if not np.iscomplexobj(w):
                moved = moved[..., : len(positions)] + 1j * moved[..., len(positions) :]
            powers = np.stack([port.power for port in ports], axis=1)
            y = np.einsum("kp,knp->np", powers, moved)
            for i, port in enumerate(ports):
                y[:, i] += port.left[:n] @ (port.core @ (port.right[:, :n] @ f[:, i]))
            out[:, positions] = y
        return basis.to_real(out)

    def outputs(self, g: np.ndarray) -> np.ndarray:
        """(n_output, n_coeff) outputs under contact forces g alone [m]."""
        return self._c.split(self._through_ports(self._c.port_force(g)))[1]

    def slope(self, g: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """d / d omega of contact displacement and outputs under g alone, or under the excitation where g is None."""
        moved = self._through_ports(self._c.port_force(g), slope=True)
        return self._c.split(moved * (1j * self._harmonics))

    def jacobian_product(self, rows: np.ndarray) -> JacobianProduct:
        """The product with G restricted to contact rows (active ones), to the accuracy a Newton direction needs."""
        return JacobianProduct(self._c, self._ports, rows)


class JacobianProduct:
    """G restricted to active rows: static remainder W_0 plus the dynamics of the lowest modes."""

    def __init__(self, compliance: ContactCompliance, ports: list[list[PortCompliance]], rows: np.ndarray):
        self._basis = compliance.basis
        self._groups = []
        for (expansion, positions), at in zip(compliance.groups, ports, strict=True):
            everything = len(rows) == compliance.n_contact
            w0 = expansion.contact_moments[0] if everything else np.ascontiguousarray(expansion.contact_moments[0][np.ix_(rows, rows)])
            b = expansion.contact_modes if everything else np.ascontiguousarray(expansion.contact_modes[rows])
            self._groups.append((w0, b, b.conj().T.copy(), [p.core for p in at], positions))

    def __call__(self, d: np.ndarray) -> np.ndarray:
        """G d for d (n_active, n_coeff)."""
        out = np.empty_like(d)
        if len(self._groups) == 1 and not np.iscomplexobj(self._groups[0][0]):
            w0, b, bt, cores, _ = self._groups[0]
            np.matmul(w0, d, out=out)
            z = self._basis.to_complex(bt @ d)
            for i, core in enumerate(cores):
                z[:, i] = core @ z[:, i]
            out += b @ self._basis.to_real(z)
            return out
        force = self._basis.to_complex(d)
        moved = np.empty_like(force)
        for w0, b, bt, cores, positions in self._groups:
            for core, p in zip(cores, positions, strict=True):
                moved[:, p] = w0 @ force[:, p] + b @ (core @ (bt @ force[:, p]))
        return self._basis.to_real(moved)
