"""Contact compliance: displacement of contact and outputs under contact forces and loads, harmonic by harmonic.

The expansion of each system of the model (see `expansion`) at every harmonic of one frequency. Where all harmonics
share one real system, as they do without cyclic symmetry, products are made with all harmonics at once, coefficients
as rows.

A model with residual flexibility has no dense compliance: see `ritz_expansion`. Newton's directions are then found with
the modes alone, and what these leave out is a product with a sparse factor.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear import all_harmonics
from tribodyn.hbm.linear.all_harmonics import few_rows
from tribodyn.hbm.linear.expansion import Expansion, UnbalancedLoad
from tribodyn.hbm.linear.ritz_expansion import RitzExpansion
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.residual_flexibility import FlexibleModel


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
    wanted : relative error of dense compliances at the highest harmonic of it that is small enough; None: as a run
        needs it
    """

    def __init__(
        self,
        model: ReducedModel,
        stiffness: np.ndarray,
        basis: HarmonicBasis,
        excitation: Excitation,
        omega_max: float,
        wanted: float | None = None,
    ):
        self.basis, self.wanted = basis, wanted
        self.k = np.asarray(stiffness, float).ravel()
        self.n_contact = len(self.k)
        system, _ = model.at_harmonic(basis.harmonics[-1])
        excitation.check(basis, system.loads)
        self.output_names = tuple(system.outputs)
        self.load_names = sorted({name for _, name in excitation.loads})
        self.n_load = len(self.load_names)
        self._excite(excitation)
        self.residual = model.residual if isinstance(model, FlexibleModel) else None
        self.groups: list[tuple[Expansion, list[int]]] = []
        for positions, mirrored in model.shared_systems(basis.harmonics):
            system, b = model.at_harmonic(basis.harmonics[positions[0]])
            ports = self.port_rows(system, np.asarray(b))
            s_max = basis.harmonics[max([*positions, *mirrored])] * omega_max
            if self.residual is not None:
                ritz = RitzExpansion(system, np.asarray(b), self.k, ports, s_max, self.residual)
                self.groups.append((ritz, positions))
                continue
            self.groups.append((Expansion(system, np.asarray(b), self.k, ports, s_max, wanted), positions))
            if mirrored:
                self.groups.append((self.groups[-1][0].mirrored(), mirrored))
        self._check_balance()
        self.error = max(e.error for e, _ in self.groups)
        self.shared_real = self._one_real()
        self.coarse = self._coarse_modes()
        self._points: dict[float, CompliancePoint] = {}
        self._most = RULES.points_kept
        self._active: tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]] | None = None

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
        for made in ("outside", "excited"):
            other.__dict__.pop(made, None)
        other._excite(excitation)
        other._check_balance()
        widest = max(e.n_mode if self.shared_real else max(e.n_mode, self.n_contact) for e, _ in self.groups)
        size = 32 * widest**2 * len(self.basis.harmonics)  # of a complex matrix and its parts, or of factors besides
        other._most = max(RULES.points_kept, int(RULES.shared_room / size))
        same = np.array_equal(other._load, self._load) and other.base is self.base is None
        other._points = {omega: point.under(other, same) for omega, point in self._points.items()}
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
        if not self.basis.has_static or self.residual is not None:
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
        old = self.basis.harmonics
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.basis = basis
        other._active, other._points = None, {}
        for made in ("outside", "coarse_parts", "coarse_shapes", "excited"):
            other.__dict__.pop(made, None)
        other._load = self._load[:, [old.index(h) for h in basis.harmonics]]
        other.base = None if self.base is None else self.basis.transfer(self.base, basis)
        kept = [(e, [basis.harmonics.index(old[p]) for p in ps if old[p] in basis.harmonics]) for e, ps in self.groups]
        other.groups = [(expansion, positions) for expansion, positions in kept if positions]
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
        beside the contact springs that it hardly couples the pairs.
        """
        n, root = self.n_contact, np.sqrt(self.k)
        shapes = [root[:, None] * e.b[:n] / np.sqrt(e.static_lam) for e, _ in self.groups]
        parts = [part for b in shapes for part in ((b.real, b.imag) if np.iscomplexobj(b) else (b,))]
        columns = np.concatenate(parts, axis=1)
        left, size, _ = np.linalg.svd(columns, full_matrices=False)
        return np.ascontiguousarray(left[:, size**2 > RULES.preconditioned_share * len(self.groups)])

    def on_rows(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """W_0, empty where there is none, modes and these transposed of one real system at some contact rows.

        In single precision; the last ones are kept.
        """
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
        if len(self._points) > self._most:
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
        stop, p = n + self.n_load, x.n_port
        rows = np.ascontiguousarray(self.excited[:stop].T)
        if self.residual is None:
            moved, columns = rows @ x.columns[:stop], np.concatenate([x.w0[:n, stop:], x.columns[:n, p:]], axis=1)
        else:  # in place of W_0, between the contacts alone
            still, none = np.zeros((self.basis.n_coeff, p)), np.zeros((n, p - stop))
            if self.base is not None:
                still[:, :n] = self.residual.apply(self.excited[:n]).T
            moved, columns = np.concatenate([still, rows @ x.b[:stop]], axis=1), np.concatenate([none, x.b[:n]], axis=1)
        higher = [w[:n, stop:] for w in x.higher]
        return Outside(
            (moved, self.moving(rows) @ x.single[:stop]),
            columns,
            np.concatenate(higher, axis=1) if higher else x.single[:n],
            np.ascontiguousarray(x.left[:, stop:]),
        )

    @cached_property
    def excited(self) -> np.ndarray:
        """(n_port, n_coeff) port forces of the excitation."""
        base = np.zeros((self.n_contact, self.basis.n_coeff)) if self.base is None else self.base
        found = self.pushed(self.k[:, None] * base)
        found[self.n_contact : self.n_contact + self.n_load] = self.basis.to_real(self._load)
        return found

    def pushed(self, g: np.ndarray) -> np.ndarray:
        """(n_port, n_coeff) port forces of contact forces g (n_contact, n_coeff) [N]."""
        found = np.zeros((self.n_contact + self.n_load + len(self.output_names), self.basis.n_coeff))
        found[: self.n_contact] = g
        return found


@dataclass(frozen=True)
class Outside:
    """What the excitation and the outputs of one real system take from its matrices, see `Expansion`.

    excitation : its forces as rows times [W_0, modes] (n_coeff, n_port + n_left), and times the W_k (n_row, n_k n_port)
    columns : (n_contact, n_output + n_left) [W_0, modes]; single : (n_contact, n_k n_output) the W_k
    left : (n_left, n_output)
    """

    excitation: tuple[np.ndarray, np.ndarray]
    columns: np.ndarray
    single: np.ndarray
    left: np.ndarray


def compliance_of(
    model: ReducedModel,
    stiffness: np.ndarray,
    basis: HarmonicBasis,
    excitation: Excitation,
    omega_max: float,
    wanted: float | None = None,
) -> ContactCompliance:
    """The contact compliance of a model; arguments as for `ContactCompliance`."""
    if model.follows_frequency:
        from tribodyn.hbm.linear.line_compliance import line_compliance  # only operating lines of wheels need it

        return line_compliance(model, stiffness, basis, excitation, omega_max, wanted)
    return ContactCompliance(model, stiffness, basis, excitation, omega_max, wanted)


class CompliancePoint:
    """Contact compliance at one frequency.

    x_lin : (n_contact, n_coeff) relative displacement of the stuck, closed structure under the excitation [m]
    outputs_lin : (n_output, n_coeff) its outputs [m]
    """

    blocks = None

    def __init__(self, compliance: ContactCompliance, omega: float):
        self.compliance, self.omega = compliance, omega
        self._turns = omega or 1e-150  # [rad/s] whose powers vanish at rest, where their slopes over it do not
        self._harmonics = np.asarray(compliance.basis.harmonics, float)
        self.ports = self._solved()
        self._excite()

    def under(self, compliance: ContactCompliance, same: bool) -> CompliancePoint:
        """That of the same expansions under other loads, or under the same again."""
        other = copy(self)
        other.compliance = compliance
        if not same:
            other._excite()
        return other

    def _excite(self) -> None:
        compliance, basis = self.compliance, self.compliance.basis
        n, stop = compliance.n_contact, compliance.n_contact + compliance.n_load
        if compliance.outside is not None:
            moved = self._from_rows(*compliance.outside.excitation, compliance.groups[0][0].left)
            x, self.outputs_lin = moved[:n], moved[stop:]
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
        residual = self.compliance.residual
        if residual is not None:
            return self.nearly(g) + residual.apply(g)
        if self.compliance.shared_real:
            return self._apply_shared_real(g)
        return _moved(self.dense, self.compliance.basis, g)

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
        residual = self.compliance.residual
        return 0.0 if residual is None else residual.left_out

    def nearly(self, g: np.ndarray) -> np.ndarray:
        """G g without what a factor would have to be asked for; see `left_out`."""
        if self.compliance.residual is None:
            return self.apply(g)
        b = self.compliance.groups[0][0].b[: self.compliance.n_contact]
        return np.asarray((all_harmonics.modal(np.ascontiguousarray(g.T) @ b, 0, *self.core) @ b.T).T)

    def _apply_shared_real(self, g: np.ndarray) -> np.ndarray:
        """The same for one real system: every matrix meets all harmonics in one real product."""
        n, x = self.compliance.n_contact, self.compliance.groups[0][0]
        rows = np.ascontiguousarray(g.T)
        moved, higher = few_rows(rows, x.columns[:n]), few_rows(self.compliance.moving(rows), x.single[:n])
        return self._from_rows(moved, higher, x.left, n)

    def _from_rows(self, moved: np.ndarray, higher: np.ndarray, left: np.ndarray, n: int | None = None) -> np.ndarray:
        """(n, n_coeff) displacement of the first n ports of `left` from forces times [W_0, modes] and W_k, as rows."""
        x, n = self.compliance.groups[0][0], left.shape[1] if n is None else n
        found: np.ndarray = all_harmonics.displaced(moved, higher, left, n, len(x.e), x.unit, *self.core)
        return found

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
            return self._from_rows(rows @ o.columns, c.moving(rows) @ o.single, o.left)
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
            pushed = rows @ x.left.T, c.moving(rows) @ x.single
            moved = all_harmonics.displaced_slope(*pushed, x.left, x.unit, self._turns, x.s_unit, x.c, x.t, *self.core)
        else:
            amplitudes, slopes = c.basis.to_complex(force), np.zeros((len(force), len(self._harmonics)), complex)
            for (_, positions), ports in zip(c.groups, self.ports, strict=True):
                for p, port in zip(positions, ports, strict=True):
                    slopes[:, p] = port.slope(amplitudes[:, p], 1j * self._harmonics[p])
            moved = c.basis.to_real(slopes)
        return moved[: c.n_contact], moved[c.n_contact + c.n_load :]

    def jacobian_product(self, rows: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """G restricted to contact rows (active ones) times (n_active, n_coeff), as exact as a Newton direction needs.

        In single precision, where harmonics share a system by W_0 and modes alone
        """
        c = self.compliance
        parts = c.on_rows(rows) if c.shared_real else ()
        dense = None if c.shared_real else self.dense[:, rows[:, None], rows].astype(np.complex64)

        def product(d: np.ndarray) -> np.ndarray:
            if dense is not None:
                return _moved(dense, c.basis, d)
            found: np.ndarray = all_harmonics.nearly_displaced(d, *parts, *self.core)
            return found

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
        found: np.ndarray = modes @ port.through_core(modes.conj().T)
        return found


def _moved(dense: np.ndarray, basis: HarmonicBasis, force: np.ndarray) -> np.ndarray:
    """Coefficients (n, n_coeff) of G_h (n_harmonic, n, n) times forces (n, n_coeff), as precise as the matrices."""
    return basis.to_real((dense @ basis.to_complex(force).T[..., None].astype(dense.dtype))[..., 0].T)
