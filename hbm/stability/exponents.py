"""Stability of periodic solutions: Floquet exponents by Hill's method.

Hill: a perturbation exp(lambda t) p(t), p periodic, of the modal coordinates of the stuck structure obeys

    (lambda + w D)^2 eta + C (lambda + w D) eta + Lambda eta = Phi^T dg,    D = d / d(w t) on Fourier coefficients,
    dx = Phi eta + W_0 dg,    dg = dg/dx dx,

so the contact is eliminated exactly and what is left is a small quadratic eigenproblem. Modes that are not kept follow
statically (W_0), and the contact law answers as to a steady vibration (its derivative by alternating frequency/time):
exact where lambda = 0, so that a fold is where an exponent passes zero, and an approximation for laws with memory
where it is not. Of small contacts an exponent that grows by it is solved for again with the law's answer to just that
exponent (perturbed_contact). Floquet multipliers of the integrated motion (`floquet`) need neither assumption.
Source  Hill's method and the choice of exponents by their centre: Lazarus and Thomas 2010; Guillot et al. 2020; the
elimination of the contact is ours"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.contact_law import SLIPS, STICKS
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.compliance import ContactCompliance
from tribodyn.hbm.stability import hill_problem, perturbed_contact
from tribodyn.hbm.threads import single
from tribodyn.refusal import Refusal

if TYPE_CHECKING:
    from tribodyn.hbm.stability.wave_exponents import WaveModes

FOLD = "fold"
CLEAR = 0.02  # growth or decay over omega, of which Hill's method is sure although sliders remember their path
_WAVES: WeakKeyDictionary[ContactCompliance, WaveModes] = WeakKeyDictionary()  # for all solutions of one wheel


@dataclass(frozen=True)
class HillRules:
    """What Hill's method keeps and takes for rounding; see docs/developers/ablations.md."""

    fewest_modes: int = 20  # friction makes modes far above the excitation flutter, too
    most_modes: int = 30
    copy_distance: float = 0.02  # over omega: how far truncation may drive copies of one exponent apart
    equally_central: float = 1e-5  # difference of the mean harmonics of two perturbations that is rounding
    most_refined: int = 500  # coefficients of the contact up to which exponents that grow are solved for again


RULES = HillRules()


@dataclass(frozen=True)
class Stability:
    """Floquet exponents of one periodic solution.

    omega : [rad/s]
    exponents : (n,) complex, growth rates lambda [1/s], largest real part first; imaginary parts within (-w/2, w/2]
    diameters : (n,) of a travelling wave, index of each perturbation's wave beside that of the solution, 0 where it
        repeats itself from sector to sector as the solution does; None of a motion that is no wave"""

    omega: float
    exponents: np.ndarray
    diameters: np.ndarray | None = None

    @property
    def n_unstable(self) -> int:
        """Number of exponents that grow."""
        return int(np.sum(self.exponents.real > hill_problem.GROWS * self.omega))

    @property
    def stable(self) -> bool:
        """Whether no perturbation grows."""
        return self.n_unstable == 0

    @property
    def is_clear(self) -> bool:
        """Whether the leading exponent is far enough from the axis for what Hill's method leaves out."""
        return bool(abs(self.exponents[0].real) > CLEAR * self.omega)

    @property
    def crossing(self) -> str:
        """What the leading exponent does when its real part passes zero: "fold", "flip" or "Neimark-Sacker"."""
        share = abs(self.exponents[0].imag) / self.omega
        return FOLD if share < 1e-3 else "flip" if share > 0.5 - 1e-3 else "Neimark-Sacker"


@single
def stability(balance: HarmonicBalance, state: State, n_modes: int | None = None, top: int | None = None) -> Stability:
    """Stability of one solution.

    state : converged
    n_modes : modes that move dynamically, by default those below three times the highest harmonic, at least
        RULES.fewest_modes and at most RULES.most_modes of them
    top : highest harmonic of the perturbation, by default that of the balance
    A displacement that is prescribed in harmonic 0 alone is free to grow: the force that holds it stays as it is.
    Raises  ValueError for models whose harmonics see different systems, but for such a displacement and travelling
        waves"""
    balance = balance.standing(state.omega)
    model = balance.model
    model.require_masters("stability")
    if balance.contact.needs_velocity:
        raise Refusal("Hill's method serves no contact law that needs velocities: verify judges stability in time")
    if model.is_wave:
        return _of_wave(balance, state, n_modes, top)
    if not model.has_motion_in_time:
        raise Refusal(
            "stability needs one system for all harmonics: perturbations of a stored cyclic part see other systems "
            "than the solution does"
        )
    return Stability(state.omega, _sorted(_hill(balance, state, n_modes, top), state.omega)[0])


def remembers(balance: HarmonicBalance, state: State) -> bool:
    """Whether sliders move in a cycle: the contact's answer to a perturbation depends on how fast that grows."""
    return balance.memory.shape[1] > 0 and bool(np.any(state.cycle.status & SLIPS))


def _sorted(exponents: np.ndarray, omega: float) -> tuple[np.ndarray, np.ndarray]:
    """Imaginary parts brought into (-w/2, w/2], largest real part first; and the order that makes it so."""
    turns = np.ceil(exponents.imag / omega - 0.5)
    exponents = exponents - 1j * omega * turns
    order = np.lexsort((exponents.imag, -exponents.real))
    return exponents[order], order


def _perturbed(balance: HarmonicBalance, top: int | None) -> HarmonicBasis:
    """All harmonics of a perturbation up to the highest, by default that of the balance."""
    top = balance.basis.harmonics[-1] if top is None else top
    return HarmonicBasis(tuple(range(top + 1)), max(balance.basis.n_samples, 4 * top + 1), balance.basis.transitions)


def _moving(balance: HarmonicBalance, state: State, n_modes: int | None, top: int) -> int:
    """How many modes move dynamically."""
    frequencies = np.sqrt(balance.compliance.groups[-1][0].lam)
    if n_modes is None:
        n_modes = int(np.clip(np.sum(frequencies < 3 * (top + 1) * state.omega), RULES.fewest_modes, RULES.most_modes))
    return min(n_modes, len(balance.model.system.mass))


def _of_wave(balance: HarmonicBalance, state: State, n_modes: int | None, top: int | None) -> Stability:
    from tribodyn.hbm.stability import wave_exponents  # only wheels need it

    basis, linear = _perturbed(balance, top), balance.compliance
    n_modes_moving = _moving(balance, state, n_modes, basis.harmonics[-1])
    modes = _WAVES.get(linear)
    if modes is None or modes.m != n_modes_moving:
        modes = _WAVES[linear] = wave_exponents.WaveModes(balance.model, linear.k, n_modes_moving)
    slope, answer = _departure_slope(balance, state, basis), _answer(balance, state, basis)
    values, diameters = wave_exponents.exponents(modes, state.omega, slope, answer)
    exponents, order = _sorted(values, state.omega)
    return Stability(state.omega, exponents, diameters[order])


def _hill(balance: HarmonicBalance, state: State, n_modes: int | None, top: int | None) -> np.ndarray:
    basis = _perturbed(balance, top)
    expansion = balance.compliance.groups[-1][0]  # a displacement prescribed in harmonic 0 alone is free to grow
    m = min(_moving(balance, state, n_modes, basis.harmonics[-1]), len(expansion.lam))
    n_contact = balance.compliance.n_contact
    phi, residual_shapes = expansion.b[:n_contact, :m], expansion.b[:n_contact, m:]
    static = expansion.w0[:n_contact, :n_contact] + (residual_shapes / expansion.lam[m:]) @ residual_shapes.T
    slope, answer = _departure_slope(balance, state, basis), _answer(balance, state, basis)
    coupling = _contact_in_modes(slope, phi, static)
    nc = basis.n_coeff
    unit = np.eye(nc)
    turn = np.kron(np.eye(m), basis.rate.T)  # d / d(w t)
    damping = np.kron(expansion.c[:m, :m] / state.omega, unit)
    spring = np.kron(np.diag(expansion.lam[:m]), unit) - coupling
    if expansion.flow is not None:
        spring = spring + np.kron(expansion.flow[:m, :m], unit)
    constant = turn @ turn + damping @ turn + spring / state.omega**2
    companion = np.block([[np.zeros_like(turn), np.eye(len(turn))], [-constant, -2 * turn - damping]])
    values, vectors = np.linalg.eig(companion)
    exponents = _central(values, *_centre(vectors[: m * nc], m, basis), 2 * m)
    if answer is not None:
        flow = np.zeros((m, m)) if expansion.flow is None else expansion.flow[:m, :m]
        modes = expansion.lam[:m], expansion.c[:m, :m], flow, phi, static
        # each with its conjugate
        distinct, of = np.unique(np.where(exponents.imag < 0, exponents.conj(), exponents), return_inverse=True)
        distinct = hill_problem.refined(distinct, (lambda index: modes, 0, 0, state.omega), slope, answer)[of]
        exponents = np.where(exponents.imag < 0, distinct.conj(), distinct)
    return exponents * state.omega


def _answer(balance: HarmonicBalance, state: State, basis: HarmonicBasis) -> hill_problem.Answer | None:
    """The contact's answer to a perturbation; None of large contacts and several laws."""
    if not balance.contact.has_one_law or balance.contact.stiffness.size * basis.n_coeff > RULES.most_refined:
        return None
    return perturbed_contact.answer_of(balance, state, basis.harmonics[-1])


def _departure_slope(balance: HarmonicBalance, state: State, basis: HarmonicBasis) -> np.ndarray:
    """dg/dx of every pair with all harmonics of the perturbation: (n_pair, c, n_coeff, c, n_coeff)."""
    n_pair, c, _ = state.x.shape
    x = np.zeros((n_pair, c, basis.n_coeff))
    has_cosine: dict[int, int] = {}
    for i, h in enumerate(balance.basis.order):
        if h <= basis.harmonics[-1]:
            x[:, :, 0 if h == 0 else 2 * h - 1 + has_cosine.get(h, 0)] = state.x[:, :, i]
            has_cosine[h] = 1
    cycle = balance.contact.cycle(x, basis, balance.memory)
    jac = cycle.slope
    slope = -jac.reshape(n_pair, c, basis.n_coeff, c, basis.n_coeff)
    k = balance.compliance.k.reshape(n_pair, c)
    for j in range(c):
        for a in range(basis.n_coeff):
            slope[:, j, a, j, a] += k[:, j]
    for joint in balance.contact.joints:  # where a slider stood still it does so in a small perturbation, too
        if getattr(joint.module, "LINEAR_WHERE_STUCK", False):
            slope[joint.rows[cycle.status[joint.rows] == STICKS]] = 0.0
    return slope


def _contact_in_modes(slope: np.ndarray, phi: np.ndarray, static: np.ndarray) -> np.ndarray:
    """Phi^T dg of modal displacements, contact flexibility `static` (W_0) in series: (m n_coeff, m n_coeff)."""
    _, c, nc = slope.shape[:3]
    active = np.flatnonzero(np.abs(slope).max(axis=(1, 2, 3, 4)) > 0)
    if len(active) == 0:
        return np.zeros((phi.shape[1] * nc, phi.shape[1] * nc))
    rows = (active[:, None] * c + np.arange(c)).ravel()
    d = slope[active]
    n, m = len(rows), phi.shape[1]
    series = np.einsum("ipc,pcadb->iapdb", static[np.ix_(rows, rows)].reshape(n, len(active), c), d).reshape(n * nc, -1)
    modal = np.kron(phi[rows], np.eye(nc))
    dx = np.linalg.solve(np.eye(n * nc) - series, modal).reshape(len(active), c * nc, m * nc)
    return modal.T @ (d.reshape(len(active), c * nc, c * nc) @ dx).reshape(n * nc, m * nc)


def _centre(vectors: np.ndarray, m: int, basis: HarmonicBasis) -> tuple[np.ndarray, np.ndarray]:
    """Mean and mean square of the harmonics of each perturbation, weighted with its square.

    Copies of one exponent have means one apart"""
    shape = vectors.reshape(m, basis.n_coeff, -1)
    a, b = shape[:, 1::2], shape[:, 2::2]
    plus = (np.abs(a - 1j * b) ** 2).sum(axis=0) / 4
    minus = (np.abs(a + 1j * b) ** 2).sum(axis=0) / 4
    still = (np.abs(shape[:, 0]) ** 2).sum(axis=0)
    h, size = np.asarray(basis.dynamic), still + plus.sum(axis=0) + minus.sum(axis=0)
    return h @ (plus - minus) / size, h**2 @ (plus + minus) / size


def _central(values: np.ndarray, centre: np.ndarray, spread: np.ndarray, count: int) -> np.ndarray:
    """The `wanted` exponents, in units of omega, with the most central perturbations, none of them twice.

    (lambda + i k, centre - k) is the same perturbation as (lambda, centre), for every whole k. Where even and odd
    harmonics do not meet, each set has all exponents with perturbations as central: those that reach further are
    truncated later."""
    chosen: list[int] = []
    for i in np.lexsort((-spread, np.round(np.abs(centre) / RULES.equally_central))):
        shift = np.round(values[i].imag - values[chosen].imag)
        is_copy = np.abs(values[i] - values[chosen] - 1j * shift) < RULES.copy_distance
        if not np.any(is_copy & (shift != 0) & (np.abs(centre[i] - centre[chosen] + shift) < 0.25)):
            chosen.append(int(i))
        if len(chosen) == count:
            break
    return values[chosen]
