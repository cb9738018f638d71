"""Dynamic compliance of one stuck system between its ports, expanded in low modes and powers of s = i h w.

The contact springs, stuck and closed, are part of the linear system: K_s = K + B^T k B, so that it depends neither on
the load nor on wear. Its lowest modes Phi carry the dynamics; the rest is expanded in powers of s:

    D(s)^-1 = W(s) + L(s) S(s)^-1 L'(s),   W(s) = sum_k s^k W_k,   W_0 = K_s^-1 - Phi Lambda^-1 Phi^H,
    W_k = -W_0 (C W_(k-1) + M W_(k-2)),    L(s) = (I - s W(s) C) Phi,
    S(s) = Lambda + s C_m + s^2 - s^2 Phi^H C W(s) C Phi,

A structure that nothing holds has rigid modes R, K_s R = 0 and B R = 0. With K_s + c M R R^H M in its place every
matrix above exists and R are modes like the others; their true Lambda, zero, stands in S. At s = 0 they cannot move:
the static loads must be in equilibrium.

with L'(s) = Phi^H (I - s C W(s)), which for a Hermitian damping matrix is L(-s*)^H. With Coriolis forces C is not
Hermitian; L' then comes from the same recursion with C^H. The error falls like (|s| / omega_next)^order and is measured
against a direct solve. What s multiplies is small beside W_0 and Phi: single precision keeps it exact enough.
Source  block elimination of modal coordinates (ours); static correction of truncated modes as in MacNeal 1971."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from scipy.sparse import csr_matrix

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.linear.stuck_modes import RIGID_MODES, lowest_modes, rigid_motions
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class ExpansionRules:
    """How exact the expansion is, and which modes are rigid."""

    # relative, of the expansion at the highest frequency asked for: below Newton's tolerance
    wanted_error: float = 5e-10
    rounding: float = 1e-7  # largest error that may be rounding
    # modes and powers of s: the last power is even, of mass; damping gives odd ones little
    truncations: tuple[tuple[int, int], ...] = ((24, 3), (48, 3), (24, 5), (48, 5), (96, 3), (48, 7), (96, 7), (192, 7))
    all_modes_below: int = 1500  # coordinates up to which all modes are computed at once
    n_probe: int = 2  # forces that measure the error, and ports at which truncations are compared
    compared_ports: int = 64
    # of entries of the port rows, up to which zeros are left out of products: above it dense is faster
    sparse_share: float = 0.05
    # of a frequency from an undamped resonance, relative: the response is rounding alone
    resonance_distance: float = 1e-13
    # displacement at the contacts beside that elsewhere from which on a motion is not free of them
    resisted: float = 1e-6


RULES = ExpansionRules()


class SingularStuckSystem(Refusal):
    """The structure can move as a rigid body even with every contact stuck."""


class UnbalancedLoad(SingularStuckSystem):
    """The static loads push a structure that nothing holds; shapes : (n, r) its rigid motions."""

    def __init__(self, shapes: np.ndarray):
        super().__init__(
            "the part can move as a rigid body even with all contacts stuck, and its static loads are not in "
            "equilibrium: balance them, clamp the part or add a spring"
        )
        self.shapes = shapes


class UndampedResonance(Refusal):
    """The response of the stuck structure is infinite at this frequency."""


class Expansion:
    """D(s)^-1 between ports (contacts, loads, outputs) of one stuck system; see the module text.

    system : dense, b : (n_contact, n) contact map, stiffness : (n_contact,) stuck contact springs [N/m]
    ports : (n_port, n) rows; contact rows first
    s_max : largest h w [rad/s]; target_error : relative, at s_max; None for RULES.wanted_error
    w0 : (n_port, n_port) W_0; b : (n_port, m) modes; e : (order - 2, n_port, m) W_k C Phi s_max^(k+1) at the ports,
        all three views of `columns` = [w0, b, e_0, ...]
    w0_single, b_single : those of the contacts in single precision
    e_in : the same of C^H, whose adjoint makes L'; e itself where C is Hermitian
    higher : order - 1 matrices (n_port, n_port) W_k s_max^k / unit, views of `single`, which holds them side by side
    error : relative, at s_max, against a direct solve
    rigid : (n, r) motions that nothing resists, mass-normalised; the first r modes
    Raises  SingularStuckSystem where a motion that nothing resists moves the contacts"""

    def __init__(
        self, system: SecondOrderSystem, b: np.ndarray, stiffness: np.ndarray, ports: np.ndarray, s_max: float,
        target_error: float | None = None,
    ):  # fmt: skip
        target_error = RULES.wanted_error if target_error is None else target_error
        self.n_port, self._n_contact = len(ports), len(b)
        self.s_unit = s_max or 1.0
        mass = np.asarray(system.mass)
        damping = np.zeros_like(mass) if system.velocity_matrix is None else np.asarray(system.velocity_matrix)
        stuck = np.asarray(system.stiffness) + b.conj().T @ (stiffness[:, None] * b)
        stuck = 0.5 * (stuck + stuck.conj().T)
        self._system = (mass, damping)
        n = len(mass)
        unconstrained = SingularStuckSystem(
            "the part, or a body of it, can move as a rigid body even with all contacts stuck, and its contacts move "
            "with it: join it to the rest by a tie or a link, hold it by a clamp or a spring, or raise the contact "
            "stiffness; a structure that hangs free as a whole needs nothing"
        )
        count = n if n < RULES.all_modes_below else RULES.truncations[-1][0]
        self.hermitian = system.gyroscopic is None and system.circulatory is None
        self.rigid = np.zeros((n, 0))
        # a rigid mode comes out of the eigenvalue problem as rounding of the stiffest ones, of either sign
        moved, inertia = np.diag(stuck).real, np.diag(mass).real
        rounding = n * np.finfo(float).eps * np.max(moved[inertia > 0] / inertia[inertia > 0])
        try:
            factor = sla.cho_factor(stuck)
            lam, phi = lowest_modes(stuck, mass, count)
        except np.linalg.LinAlgError:
            lam = np.zeros(1)
        if lam[0] <= RIGID_MODES.suspect * rounding:
            try:
                self.rigid, shift = rigid_motions(stuck, mass)
            except np.linalg.LinAlgError:
                if lam[0] <= rounding:
                    raise unconstrained from None
        if self.rigid.shape[1]:
            try:
                if np.abs(b @ self.rigid).max(initial=0.0) > RULES.resisted * np.abs(self.rigid).max():
                    raise unconstrained
                rigid_momentum = mass @ self.rigid
                stuck = stuck + shift * rigid_momentum @ rigid_momentum.conj().T
                factor = sla.cho_factor(stuck)
                lam, phi = lowest_modes(stuck, mass, count)
            except np.linalg.LinAlgError:
                raise unconstrained from None
            phi[:, : self.rigid.shape[1]] = self.rigid  # the lowest ones, and no others are as low
        s = 1j * s_max
        probe = np.random.default_rng(0).normal(size=(self.n_port, RULES.n_probe))
        force = ports.conj().T @ probe
        free = stuck + s * damping + s * s * mass
        self._flow = None if system.circulatory is None else np.asarray(system.circulatory)
        if self._flow is not None:
            free = free + self._flow
        if self.rigid.shape[1]:
            free = free - shift * rigid_momentum @ rigid_momentum.conj().T
        exact = ports @ np.linalg.solve(free, force)
        del stuck, free
        probes = np.linspace(0, len(ports) - 1, min(len(ports), RULES.compared_ports)).astype(int)
        previous: list[tuple[int, int, float]] = []
        # the powers diverge from the frequency of the first mode left out on
        rungs, p = [c for c in RULES.truncations if c[0] < len(lam) and lam[c[0]] > s_max**2], self.n_port
        rungs.sort(key=lambda c: (c[1] - 1) * p * (4 * p + 16 * c[0]) + 48 * c[0] ** 2)  # bytes of three harmonics
        for m, order in rungs:  # tried between the probe and a few ports
            self._build(lam[:m], phi[:, :m], factor, order, np.concatenate([force.conj().T, ports[probes]]))
            displacement = self.at(s).matrix(slice(RULES.n_probe, None), slice(0, RULES.n_probe))
            error = float(np.abs(displacement - exact[probes]).max() / np.abs(exact).max())
            # near a resonance rounding of the direct solve itself is what remains: more modes would not help
            previous_error = min((e for probes, low, e in previous if probes <= m and low <= order), default=np.inf)
            if error <= target_error or 0.5 * previous_error < error < RULES.rounding:
                break
            previous.append((m, order, error))
        else:
            m, order = len(lam), 1 if len(lam) == n else 8
        self._build(lam[:m], phi[:, :m], factor, order, ports)
        self.error = float(np.abs(self.at(s).matrix() @ probe - exact).max() / np.abs(exact).max())
        del self._system, self._flow

    def _build(
        self, lam: np.ndarray, phi: np.ndarray, factor: tuple[np.ndarray, bool], order: int, ports: np.ndarray
    ) -> None:
        mass, damping = self._system
        cphi = damping @ phi
        full = len(lam) == len(mass)

        def quasi_static(y: np.ndarray) -> np.ndarray:  # W_0 y
            return sla.cho_solve(factor, y, check_finite=False) - phi @ ((phi.conj().T @ y) / lam[:, None])

        p = len(ports)
        right = np.concatenate([ports.conj().T, cphi], axis=1)
        y_before, y = np.zeros_like(right), np.zeros_like(right) if full else quasi_static(right)
        self.order, self.n_mode, m = order, len(lam), len(lam)
        n_e = max(order - 2, 0)
        self.columns = np.empty((p, p + m * (1 + n_e)), y.dtype)
        self.w0, self.b = self.columns[:, :p], self.columns[:, p : p + m]
        self.e = [self.columns[:, p + m * (k + 1) : p + m * (k + 2)] for k in range(n_e)]
        self.single = np.empty((p, p * (order - 1)), np.complex64 if np.iscomplexobj(y) else np.float32)
        self.higher = [self.single[:, p * k : p * (k + 1)] for k in range(order - 1)]
        self.t = np.empty((n_e, m, m), y.dtype)
        at_ports = csr_matrix(ports) if np.count_nonzero(ports) < RULES.sparse_share * ports.size else ports
        self.w0[:] = at_ports @ y[:, :p]
        self.b[:] = at_ports @ phi
        # the largest compliance, so that no unit of length or force leaves the range of single precision
        self.unit = float(np.max(np.diag(self.w0).real + (np.abs(self.b) ** 2 / lam).sum(axis=1))) or 1.0
        adjoint = cphi if self.hermitian else damping.conj().T @ phi
        for k in range(order - 1):
            if k < n_e:
                self.e[k][:] = at_ports @ y[:, p:] * self.s_unit ** (k + 1)
                self.t[k] = adjoint.conj().T @ y[:, p:]
            y_before, y = y, -quasi_static(damping @ y + mass @ y_before)
            self.higher[k][:] = at_ports @ y[:, :p] * (self.s_unit ** (k + 1) / self.unit)
        self.e_in = self.e
        if not self.hermitian:
            self.e_in, y_before, y = [], np.zeros_like(adjoint), adjoint if full else quasi_static(adjoint)
            for k in range(n_e):
                self.e_in.append(at_ports @ y * self.s_unit ** (k + 1))
                y_before, y = y, -quasi_static(damping.conj().T @ y + mass @ y_before)
        self.to_ports = np.ascontiguousarray(self.columns[:, p:].T)
        r = self.rigid.shape[1]
        self.lam = np.concatenate([np.zeros(r), lam[r:]])
        self.static_lam = np.concatenate([np.full(r, np.inf), lam[r:]])  # rigid motions stand still
        self.c = phi.conj().T @ cphi
        self.flow = None if self._flow is None else phi.conj().T @ self._flow @ phi
        n = self._n_contact
        self.w0_single, self.b_single = (a.astype(self.single.dtype) for a in (self.w0[:n, :n], self.b[:n]))

    def mirrored(self) -> Expansion:
        """That of the conjugate system, as the wave of the opposite index of a wheel has it."""
        other = object.__new__(Expansion)
        other.__dict__.update(self.__dict__)
        p, m = self.n_port, self.n_mode
        for name in ("columns", "single", "t", "to_ports", "c", "w0_single", "b_single", "rigid", "flow"):
            value = getattr(self, name)
            setattr(other, name, None if value is None else np.conj(value))
        other.w0, other.b = other.columns[:, :p], other.columns[:, p : p + m]
        other.e = [other.columns[:, p + m * (k + 1) : p + m * (k + 2)] for k in range(len(self.e))]
        other.higher = [other.single[:, p * k : p * (k + 1)] for k in range(len(self.higher))]
        other.e_in = other.e if self.e_in is self.e else [np.conj(e) for e in self.e_in]
        return other

    def at(self, s: complex) -> PortCompliance:
        """The compliance at s = i h w."""
        return self.at_each(np.array([s]))[0]

    def at_each(self, s: np.ndarray) -> list[PortCompliance]:
        """The compliance at several s = i h w (n,)."""
        # transposed: LAPACK then factors them where they lie
        cores = np.multiply(s[:, None, None], self.c.T, order="C")
        for k, t in enumerate(self.t):
            cores -= (s ** (k + 2))[:, None, None] * t.T
        diagonals = cores.reshape(len(s), -1)[:, :: self.n_mode + 1]
        diagonals += np.where(s[:, None] != 0, self.lam, self.static_lam) + (s * s)[:, None]
        if self.flow is not None:
            cores += self.flow.T
        compliances = []
        for frequency, core in zip(s, cores, strict=True):
            diagonal = frequency == 0 and self.flow is None
            factor, pivots = (None, None) if diagonal else sla.lapack.zgetrf(core.T, overwrite_a=True)[:2]
            compliances.append(PortCompliance(self, frequency, factor, pivots))
        resonant = np.abs(diagonals).min(axis=1) < RULES.resonance_distance * np.abs(s) ** 2
        if resonant.any():
            hertz = np.abs(s[resonant][0]) / (2 * np.pi)
            raise UndampedResonance(
                f"the stuck structure has an undamped resonance at {hertz:.6g} Hz, where its response "
                "is infinite: give it damping or take another frequency"
            )
        return compliances


@dataclass(frozen=True)
class PortCompliance:
    """D(s)^-1 between ports at one s: sum_k s^k W_k + L S(s)^-1 L'.

    factor and pivots : S(s) = P L U; None at s = 0 without flow, where S is diagonal"""

    expansion: Expansion
    s: complex
    factor: np.ndarray | None
    pivots: np.ndarray | None

    @property
    def ratio(self) -> complex:
        """s over the largest one asked for."""
        return self.s / self.expansion.s_unit

    def through_core(self, z: np.ndarray) -> np.ndarray:
        """S(s)^-1 z for modal forces z (n_mode, ...)."""
        if self.factor is None:
            return (z.T / self.expansion.static_lam).T
        solution: np.ndarray = sla.lapack.zgetrs(self.factor, self.pivots, z)[0]
        return solution.reshape(z.shape)

    def matrix(self, rows: slice = slice(None), columns: slice = slice(None)) -> np.ndarray:
        """Displacement of the ports in `rows` under unit forces at those in `columns`."""
        x, ratio = self.expansion, self.ratio
        modal_left, right = x.b[rows].astype(complex), x.b[columns].conj().T.astype(complex)
        for k, (e, e_in) in enumerate(zip(x.e, x.e_in, strict=True), start=1):
            modal_left -= ratio**k * e[rows]
            right -= ratio**k * e_in[columns].conj().T
        compliance: np.ndarray = modal_left @ self.through_core(right) + x.w0[rows, columns]
        for k, w in enumerate(x.higher, start=1):
            compliance += x.unit * ratio**k * w[rows, columns]
        return compliance

    def slope(self, force: np.ndarray, by: complex) -> np.ndarray:
        """`by` times d / d s of the displacement of all ports under forces (n_port, ...)."""
        x, s, ratio = self.expansion, self.s, self.ratio
        powers = [k * ratio ** (k - 1) / x.s_unit for k in range(1, 1 + max(len(x.e), len(x.higher)))]
        z = x.b.conj().T @ force.astype(complex)
        dz = np.zeros_like(z)
        for k, e in enumerate(x.e_in, start=1):
            part = e.conj().T @ force
            z -= ratio**k * part
            dz -= powers[k - 1] * part
        y = self.through_core(z)
        dz -= 2 * s * y + x.c @ y
        for k, t in enumerate(x.t, start=1):
            dz += (k + 1) * s**k * (t @ y)
        dy = self.through_core(dz)
        out = x.b @ dy
        for k, e in enumerate(x.e, start=1):
            out -= e @ (ratio**k * dy + powers[k - 1] * y)
        for k, w in enumerate(x.higher, start=1):
            out += x.unit * powers[k - 1] * (w @ force)
        return by * out
