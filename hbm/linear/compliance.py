"""Contact compliance: displacement of contact and outputs under contact forces and loads, harmonic by harmonic.

The expansion of each system of the model (see `expansion`) at every harmonic of one frequency. Where all harmonics
share one real system, as they do without cyclic symmetry, products are made with all harmonics at once, coefficients
as rows.

A model with residual flexibility has no dense compliance: see `flexible_compliance`. Newton's directions are then found
with the modes alone, and what these leave out is a product with a sparse factor."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.compliance_point import CompliancePoint
from tribodyn.hbm.linear.expansion import Expansion, UnbalancedLoad
from tribodyn.reduction.model import ReducedModel


@dataclass(frozen=True)
class ComplianceRules:
    """What is kept at hand, and how large the preconditioner gets."""

    points_kept: int = 4  # frequencies at hand, for the duties of a mission that are solved in turn
    shared_room: float = 256e6  # bytes of those at hand where problems that are solved one after another share them
    # of the contact flexibility, on average over the systems of the harmonics, from which on a mode counts in the
    # preconditioner. Its matrix has the modes times the coefficients: so many rows at most, unless these are
    # FEWEST_COARSE modes. 0 to 31 on 20 pairs of a wheel: 0.09 s with 6 modes, 10 s with all 60
    preconditioned_share: float = 0.1
    most_coarse: int = 1000
    fewest_coarse: int = 8
    # of the static loads, on a motion that nothing resists, taken for rounding: decks give coordinates in seven digits
    unbalanced: float = 1e-5


RULES = ComplianceRules()


class ContactCompliance:
    """The linear side of a harmonic balance: G_h(w) between contacts, loads and outputs of a reduced model.

    model : reduced model; stiffness : (n_pair, n_component) stuck springs [N/m], of a model with residual flexibility
        those that this was made with
    excitation : loads whose names are ports; omega_max : largest excitation frequency that will be asked for [rad/s]
    target_error : relative error of dense compliances at the highest harmonic of omega_max; None for the default"""

    def __init__(
        self, model: ReducedModel, stiffness: np.ndarray, basis: HarmonicBasis, excitation: Excitation,
        omega_max: float, target_error: float | None = None,
    ):  # fmt: skip
        self.basis, self.target_error = basis, target_error
        self.k = np.asarray(stiffness, float).ravel()
        self.n_contact = len(self.k)
        system, _ = model.at_harmonic(basis.harmonics[-1])
        excitation.check(basis, system.loads)
        self.output_names = tuple(system.outputs)
        self.load_names = sorted({name for _, name in excitation.loads})
        self.n_load = len(self.load_names)
        self._excite(excitation)
        self.groups: list[tuple[Expansion, list[int]]] = []
        for positions, mirrored in model.shared_systems(basis.harmonics):
            system, b = model.at_harmonic(basis.harmonics[positions[0]])
            ports = self.port_rows(system, np.asarray(b))
            s_max = basis.harmonics[max([*positions, *mirrored])] * omega_max
            self.groups.append((self._expansion(system, np.asarray(b), ports, s_max), positions))
            if mirrored:
                self.groups.append((self.groups[-1][0].mirrored(), mirrored))
        self._check_balance()
        self.error = max(e.error for e, _ in self.groups)
        self.shared_real = self._one_real()
        self.coarse = self._coarse_modes()
        self._points: dict[float, CompliancePoint] = {}
        self._capacity = RULES.points_kept
        self._active: tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]] | None = None

    def _expansion(self, system: SecondOrderSystem, b: np.ndarray, ports: np.ndarray, s_max: float) -> Expansion:
        """The expansion of one system with its contact map b."""
        return Expansion(system, b, self.k, ports, s_max, self.target_error)

    def _excite(self, excitation: Excitation) -> None:
        """Take the amplitudes of the loads and the motion of the ground."""
        harmonics = self.basis.harmonics
        self._load = np.zeros((self.n_load, len(harmonics)), complex)
        for (h, name), value in excitation.loads.items():
            if h in harmonics:
                self._load[self.load_names.index(name), harmonics.index(h)] = value
        self.base = excitation.base

    def under(self, excitation: Excitation) -> ContactCompliance:
        """The same under other amplitudes of its loads; takes over the frequencies at hand, and keeps more of them."""
        other = copy(self)
        for name in ("outside", "excited"):
            other.__dict__.pop(name, None)
        other._excite(excitation)
        other._check_balance()
        widest = max(e.n_mode if self.shared_real else max(e.n_mode, self.n_contact) for e, _ in self.groups)
        size = 32 * widest**2 * len(self.basis.harmonics)  # of a complex matrix and its parts, or of factors besides
        other._capacity = max(RULES.points_kept, int(RULES.shared_room / size))
        is_equal = np.array_equal(other._load, self._load) and other.base is self.base is None
        other._points = {omega: point.under(other, is_equal) for omega, point in self._points.items()}
        self._points = {}
        return other

    def at_model(self, model: ReducedModel) -> ContactCompliance:
        """The compliance, for all frequencies, of the model at one of them."""
        return self

    def port_rows(self, system: SecondOrderSystem, b: np.ndarray) -> np.ndarray:
        """(n_port, n) rows of the contacts b, the loads and the outputs of a system."""
        loads = [np.conj(system.loads[name])[None] for name in self.load_names]
        return np.concatenate([b, *loads, *(system.outputs[name][None] for name in self.output_names)])

    def stuck_frequencies(self, harmonic: int) -> np.ndarray:
        """(n,) lowest natural frequencies of the structure that a harmonic sees, its contacts stuck, undamped [Hz]."""
        position = self.basis.harmonics.index(harmonic)
        lam = next(expansion.lam for expansion, positions in self.groups if position in positions)
        return np.sqrt(np.maximum(lam, 0.0)) / (2 * np.pi)

    def _one_real(self) -> bool:
        """Whether one real symmetric system serves all harmonics."""
        first = self.groups[0][0]
        return len(self.groups) == 1 and first.hermitian and not np.iscomplexobj(first.w0)

    def _check_balance(self) -> None:
        """Raise UnbalancedLoad where static loads push a rigid motion of a structure that nothing holds."""
        if not self.basis.has_static:
            return
        expansion = next(expansion for expansion, positions in self.groups if 0 in positions)
        loads = slice(self.n_contact, self.n_contact + self.n_load)
        pushed = expansion.b[loads, : expansion.rigid.shape[1]] * self._load[:, :1]
        if np.abs(pushed.sum(axis=0)).max(initial=0.0) > RULES.unbalanced * np.abs(pushed).max(initial=0.0):
            each = np.abs(expansion.b[loads]) * np.abs(self._load[:, :1])
            if np.abs(pushed.sum(axis=0)).max() > RULES.unbalanced * each.max():
                raise UnbalancedLoad(expansion.rigid)

    def restricted(self, basis: HarmonicBasis) -> ContactCompliance:
        """The same for fewer of the harmonics; the expansions are shared."""
        all_harmonics = self.basis.harmonics
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.basis = basis
        other._active, other._points = None, {}
        for name in ("outside", "coarse_parts", "coarse_shapes", "excited"):
            other.__dict__.pop(name, None)
        other._load = self._load[:, [all_harmonics.index(h) for h in basis.harmonics]]
        other.base = None if self.base is None else self.basis.transfer(self.base, basis)
        remaining = [
            (e, [basis.harmonics.index(all_harmonics[p]) for p in ps if all_harmonics[p] in basis.harmonics])
            for e, ps in self.groups
        ]
        other.groups = [(expansion, positions) for expansion, positions in remaining if positions]
        other.shared_real = other._one_real()
        return other

    @property
    def preconditioned(self) -> np.ndarray:
        """(n_contact, r) the first of the coarse modes, as many as so many coefficients afford."""
        return self.coarse[:, : max(RULES.fewest_coarse, RULES.most_coarse // self.basis.n_coeff)]

    @cached_property
    def coarse_parts(self) -> list[np.ndarray]:
        """Share of the modes of each group in the `preconditioned` shapes, Q^T sqrt(k) b: (r, m)."""
        weighted = self.preconditioned.T * np.sqrt(self.k)
        return [weighted @ expansion.b[: self.n_contact] for expansion, _ in self.groups]

    @cached_property
    def coarse_shapes(self) -> np.ndarray:
        """(n_contact, r) displacement of the `preconditioned` shapes, zero where nothing is sprung."""
        root, shapes = np.sqrt(self.k)[:, None], self.preconditioned
        return np.divide(shapes, root, out=np.zeros(shapes.shape), where=root > 0)

    def _coarse_modes(self) -> np.ndarray:
        """(n_contact, r) shapes Q of sqrt(k) x, orthonormal, that carry the contact flexibility but for a small share.

        Those that carry most come first. The contact patch moves nearly as a rigid body; what is left is so stiff
        beside the contact springs that it hardly couples the pairs."""
        n, root = self.n_contact, np.sqrt(self.k)
        shapes = [root[:, None] * e.b[:n] / np.sqrt(e.static_lam) for e, _ in self.groups]
        parts = [part for b in shapes for part in ((b.real, b.imag) if np.iscomplexobj(b) else (b,))]
        columns = np.concatenate(parts, axis=1)
        shapes_of_contact, size, _ = np.linalg.svd(columns, full_matrices=False)
        return np.ascontiguousarray(shapes_of_contact[:, size**2 > RULES.preconditioned_share * len(self.groups)])

    def on_rows(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """W_0, empty where there is none, modes and these transposed of one real system at some contact rows.

        In single precision; the last ones are kept."""
        if self._active is None or not np.array_equal(self._active[0], rows):
            e = self.groups[0][0]
            w0, b = e.w0_single, e.b_single
            if len(rows) < self.n_contact:
                w0, b = w0[np.ix_(rows, rows)] if len(w0) else w0, b[rows]
            self._active = (rows, (w0, b, np.ascontiguousarray(b.T)))
        return self._active[1]

    def at(self, omega: float) -> CompliancePoint:
        """The compliance at one excitation frequency [rad/s]; the last ones are kept."""
        point = self._points.pop(omega, None) or self._make(omega)
        self._points[omega] = point
        if len(self._points) > self._capacity:
            del self._points[next(iter(self._points))]
        return point

    def _make(self, omega: float) -> CompliancePoint:
        return CompliancePoint(self, omega)

    def moving(self, rows: np.ndarray) -> np.ndarray:
        """The rows of harmonics >= 1 of (n_coeff, ...), single precision: powers of s multiply no others."""
        return rows[int(self.basis.has_static) :].astype(np.float32)

    @cached_property
    def outside(self) -> Outside | None:
        """What excitation and outputs take from the matrices of one real system; None where there are several."""
        if not self.shared_real:
            return None
        x, n = self.groups[0][0], self.n_contact
        stop = n + self.n_load
        rows = np.ascontiguousarray(self.excited[:stop].T)
        displacement, columns = self._static_and_modes(rows)
        higher = [w[:n, stop:] for w in x.higher]
        return Outside(
            (displacement, self.moving(rows) @ x.single[:stop]),
            columns,
            np.concatenate(higher, axis=1) if higher else x.single[:n],
            np.ascontiguousarray(x.to_ports[:, stop:]),
        )

    def _static_and_modes(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Port forces `rows` (n_coeff, n) times [W_0, modes], and these (n_contact, n_output + n_modal) for outputs."""
        x, n = self.groups[0][0], self.n_contact
        stop = n + self.n_load
        return rows @ x.columns[:stop], np.concatenate([x.w0[:n, stop:], x.columns[:n, x.n_port :]], axis=1)

    @cached_property
    def excited(self) -> np.ndarray:
        """(n_port, n_coeff) port forces of the excitation."""
        base = np.zeros((self.n_contact, self.basis.n_coeff)) if self.base is None else self.base
        force = self.pushed(self.k[:, None] * base)
        force[self.n_contact : self.n_contact + self.n_load] = self.basis.to_real(self._load)
        return force

    def pushed(self, g: np.ndarray) -> np.ndarray:
        """(n_port, n_coeff) port forces of contact forces g (n_contact, n_coeff) [N]."""
        force = np.zeros((self.n_contact + self.n_load + len(self.output_names), self.basis.n_coeff))
        force[: self.n_contact] = g
        return force


@dataclass(frozen=True)
class Outside:
    """What the excitation and the outputs of one real system take from its matrices, see `Expansion`.

    excitation : forces as rows times [W_0, modes] (n_coeff, n_port + n_modal), and times the W_k (n_row, n_k n_port)
    columns : (n_contact, n_output + n_modal) [W_0, modes]; single : (n_contact, n_k n_output) the W_k
    to_ports : (n_modal, n_output)"""

    excitation: tuple[np.ndarray, np.ndarray]
    columns: np.ndarray
    single: np.ndarray
    to_ports: np.ndarray
