"""Hill's method for a travelling wave: perturbations of every nodal diameter, which one sector does not show.

A motion that repeats itself from sector to sector, x_n(t) = x_0(t - n phi / w), is perturbed by

    d x_n(t) = exp(lambda t) sum_k X_k exp(i k (w t - n phi)) exp(-i 2 pi d n / N),    phi = 2 pi EO / N,

which solves the linearised equations of the whole wheel for d = 0 .. N - 1 (Floquet in time, Bloch round the wheel):
its harmonic k sees the wave of index k EO + d. With the modes Phi, L of the stuck wheel at that index,

    (lambda + i k w)^2 eta_k + C_k (lambda + i k w) eta_k + L_k eta_k = Phi_k^H dg_k,
    X_k = Phi_k eta_k + W_k dg_k,    dg = (dg/dx) X,

one quadratic eigenproblem for each d; that of N - d is its conjugate. The assumptions are those of `exponents`.
Source  Floquet-Bloch perturbations of a periodic solution with space-time symmetry: Krack and Gross 2019, section 3.7,
for one sector; the extension to all nodal diameters and the elimination of the contact are ours
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.linalg as sla
from scipy.sparse.linalg import LinearOperator, eigs

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.linear.stuck_modes import stuck_modes
from tribodyn.reduction.model import ReducedModel

COPY_DISTANCE, SAME_CENTRE = 0.02, 0.25  # over omega, and of harmonic numbers: how far truncation drives copies apart


GROWS, ACCURACY = 1e-6, 1e-3  # over omega: growth that is looked at, and how exactly
SHARES = (0.25, 0.5, 0.75, *8 * (1.0,))  # of the answer to an exponent itself, on the way to it

_Index = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
Place = tuple[Callable[[int], _Index], int, int, float]  # modes by index, engine order, d, omega
Answer = Callable[[complex], np.ndarray]  # exponent over omega -> as `perturbed_contact.departure`


class WaveModes:
    """Stuck modes and contact flexibility of the wheel by index, each made once.

    n_modes : of each index that move dynamically; the others follow statically
    """

    def __init__(self, model: ReducedModel, stiffness: np.ndarray, n_modes: int):
        from tribodyn.reduction.wave_model import as_wave  # only wheels need it

        wave = as_wave(model)
        self.n_sectors, self.engine_order = wave.n_sectors, wave.engine_order
        self._per_index, self._k, self.m = wave.at_index, np.asarray(stiffness, float).ravel(), n_modes
        self._cache: dict[int, _Index] = {}

    def __call__(self, index: int) -> _Index:
        """Squared frequencies (m,), damping and flow (m, m), contact shapes (n_contact, m), W of the rest."""
        index = index % self.n_sectors
        mirror = 2 * index > self.n_sectors
        key = self.n_sectors - index if mirror else index
        if key not in self._cache:
            self._cache[key] = self._make(key)
        lam, *matrices = self._cache[key]
        c, flow, phi, static = (part.conj() for part in matrices) if mirror else matrices
        return lam, c, flow, phi, static

    def _make(self, index: int) -> _Index:
        system, b = self._per_index(index)
        b, mass = np.asarray(b), np.asarray(system.mass)
        stuck = np.asarray(system.stiffness) + b.conj().T @ (self._k[:, None] * b)
        m = min(self.m, len(mass))
        lam, shapes = (part[..., :m] for part in stuck_modes(stuck, mass)[:2]) if m == len(mass) else sla.eigh(
            stuck, mass, subset_by_index=(0, m - 1)
        )  # fmt: skip
        rate = system.velocity_matrix
        c = np.zeros((m, m)) if rate is None else shapes.conj().T @ np.asarray(rate) @ shapes
        flow = np.zeros((m, m))
        if system.circulatory is not None:
            flow = shapes.conj().T @ np.asarray(system.circulatory) @ shapes
        phi = b @ shapes
        static = np.zeros((len(b), len(b)), phi.dtype)
        if m < len(mass):
            static = b @ sla.solve(stuck, b.conj().T, assume_a="pos") - (phi / lam) @ phi.conj().T
        return lam, c, flow, phi, static


def exponents(
    balance: HarmonicBalance, modes: WaveModes, omega: float, slope: np.ndarray, answer: Answer | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Floquet exponents of a travelling wave against perturbations of every nodal diameter.

    slope : (n_pair, c, n_coeff, c, n_coeff) dg/dx with coefficients [x_0, a_1, b_1, ...] up to the highest harmonic of
        the perturbation; answer : as of `refined`
    Returns exponents (n,) [1/s] and the index d (n,) of each perturbation, from -N/2 + 1 to N/2
    """
    order, n = modes.engine_order, modes.n_sectors
    active = np.flatnonzero(np.abs(slope).max(axis=(1, 2, 3, 4)) > 0)
    blocks = of_exponentials(slope[active])
    c = slope.shape[1]
    rows = (active[:, None] * c + np.arange(c)).ravel()
    values, centres, diameters = [], [], []
    for d in range(n // 2 + 1):
        values_of_index, centre = _of_index(modes, order, d, omega, blocks, rows)
        for sign in (1, -1) if 0 < 2 * d < n else (1,):
            values.append(values_of_index if sign > 0 else values_of_index.conj())
            centres.append(sign * centre)
            diameters.append(np.full(len(values_of_index), sign * d))
    candidates = np.concatenate(values), np.concatenate(centres), np.concatenate(diameters)
    chosen = _once(*candidates, order, n, sum(2 * len(modes(d)[0]) for d in range(n)))
    values, waves = candidates[0][chosen], candidates[2][chosen]
    if answer is not None:
        for d in np.unique(np.abs(waves[values.real > GROWS])):  # what is solved for d holds for -d, conjugated
            rows_of_index, back = np.abs(waves) == d, waves < 0
            distinct, of = np.unique(np.where(back, values.conj(), values)[rows_of_index], return_inverse=True)
            values_of_index = refined(distinct, (modes, order, int(d), omega), slope, answer)[of]
            values[rows_of_index] = np.where(back[rows_of_index], values_of_index.conj(), values_of_index)
    return values * omega, waves


def refined(exponents: np.ndarray, at: Place, slope: np.ndarray, answer: Answer) -> np.ndarray:
    """Exponents (n,), in units of omega: those that grow by the answer `slope` to a steady vibration solved for again.

    Each is followed to the contact's answer to just that exponent, and stays where that leads nowhere
    """
    rows, steady, result = np.arange(slope.shape[0] * slope.shape[1]), of_exponentials(slope), exponents.copy()
    for i in np.flatnonzero(exponents.real > GROWS):
        exponent = exponents[i]
        for share in SHARES:
            before, exponent = exponent, _nearest(exponent, *at, (1 - share) * steady + share * answer(exponent), rows)
            if share == 1 and abs(exponent - before) < ACCURACY:
                result[i] = exponent
                break
    return result


def _once(
    values: np.ndarray, centre: np.ndarray, diameters: np.ndarray, order: int, n_sectors: int, limit: int
) -> np.ndarray:
    """The `wanted` exponents, in units of omega, with the most central perturbations, none of them twice.

    (lambda - i s, d - s EO) with harmonics renumbered by s is the same perturbation as (lambda, d), for whole s
    """
    chosen, count = np.empty(min(limit, len(values)), int), 0
    for i in np.argsort(np.abs(centre), kind="stable"):
        before = chosen[:count]
        offsets = values[before] - values[i]
        shift = np.round(offsets.imag)
        is_copy = np.abs(offsets - 1j * shift) < COPY_DISTANCE
        is_copy &= (shift != 0) & ((diameters[before] - diameters[i] - shift * order) % n_sectors == 0)
        if not np.any(is_copy & (np.abs(centre[i] - centre[before] - shift) < SAME_CENTRE)):
            chosen[count] = i
            count += 1
        if count == limit:
            break
    return chosen[:count]


def of_exponentials(slope: np.ndarray) -> np.ndarray:
    """The derivative (..., n_coeff, c, n_coeff) of cosines and sines on the amplitudes of exp(i k w t), k = -H .. H."""
    nc = slope.shape[-1]
    top = nc // 2
    to_real = np.zeros((nc, nc), complex)  # [x_0, a_1, b_1, ...] of [X_-H, ..., X_H]
    to_real[0, top] = 1.0
    for h in range(1, top + 1):
        to_real[2 * h - 1, [top - h, top + h]] = 1.0
        to_real[2 * h, [top - h, top + h]] = -1j, 1j
    return np.einsum("ka,pcadb,bl->pckdl", np.linalg.inv(to_real), slope, to_real, optimize=True)


def _of_index(
    modes: Callable[[int], _Index], order: int, d: int, omega: float, blocks: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Exponents of perturbations of index d, in units of omega, and the mean k of each; those with it within 1."""
    numbers, constant, linear = _quadratic(modes, order, d, omega, blocks, rows)
    unit = np.eye(len(constant))
    companion = np.block([[np.zeros_like(unit), unit], [-constant, -linear]])
    return _central(numbers, *np.linalg.eig(companion))


def _nearest(now: complex, *problem: Any) -> complex:
    """The exponent of `_of_index` that is nearest to one, by Arnoldi's method on the inverse beside it.

    Source  Saad, Numerical Methods for Large Eigenvalue Problems, 2nd ed., section 8.2; a fifth of the time of all
    """
    numbers, constant, linear = _quadratic(*problem)
    n, shift = len(constant), now + ACCURACY  # at an exponent itself the inverse has no bound
    factors = sla.lu_factor(constant + shift * linear + shift**2 * np.eye(n))

    def inverse(v: np.ndarray) -> np.ndarray:
        x = -sla.lu_solve(factors, v[n:] + linear @ v[:n] + shift * v[:n])
        return np.concatenate([x, v[:n] + shift * x])

    values = np.empty(0)
    if n > 10:
        inverse_values, vectors = eigs(
            LinearOperator((2 * n, 2 * n), inverse, dtype=complex), 4, v0=np.ones(2 * n), tol=1e-11
        )
        values, _ = _central(numbers, shift + 1 / inverse_values, vectors)
    if len(values) == 0:
        values, _ = _of_index(*problem)
    return complex(values[np.argmin(np.abs(values - now))])


def _quadratic(
    modes: Callable[[int], _Index], order: int, d: int, omega: float, blocks: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """k of each harmonic (nc,), constant and linear matrix (nc m, nc m) of the eigenproblem, in units of omega."""
    nc = blocks.shape[-1]
    numbers = np.arange(nc) - nc // 2
    modes_of_harmonic = [modes(int(k) * order + d) for k in numbers]
    coupling = _contact_in_modes(blocks, rows, modes_of_harmonic)
    rate = np.repeat(1j * numbers, len(modes_of_harmonic[0][0]))
    damping = sla.block_diag(*(c / omega for _, c, *_ in modes_of_harmonic))
    spring = np.diag(np.concatenate([lam for lam, *_ in modes_of_harmonic])) - coupling
    spring = spring + sla.block_diag(*(flow for _, _, flow, _, _ in modes_of_harmonic))
    return numbers, np.diag(rate**2) + damping * rate + spring / omega**2, np.diag(2 * rate) + damping


def _central(numbers: np.ndarray, values: np.ndarray, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Those of the values whose perturbations have their mean k within 1, and these means."""
    shapes = vectors[: len(vectors) // 2].reshape(len(numbers), -1, len(values))
    weight = (np.abs(shapes) ** 2).sum(axis=1)
    centre = numbers @ weight / weight.sum(axis=0)
    is_central = np.abs(centre) < 1.0
    return values[is_central], centre[is_central]


def _contact_in_modes(blocks: np.ndarray, rows: np.ndarray, modes: list[_Index]) -> np.ndarray:
    """Phi^H dg of modal displacements, the flexibility W of what follows in series: (nc m, nc m), harmonic by harmonic.

    blocks : (n_active, c, nc, c, nc)
    """
    n_active, c, nc = blocks.shape[:3]
    m, n = len(modes[0][0]), len(rows)
    if n == 0:
        return np.zeros((nc * m, nc * m))
    phi = [shapes[rows] for *_, shapes, _ in modes]
    driven = np.empty((n, nc, nc, m), complex)  # (dg/dx) Phi
    series = np.empty((n, nc, n, nc), complex)  # (dg/dx) W
    for k, (*_, static) in enumerate(modes):
        slope = blocks[..., k]  # (n_active, c, nc, c)
        driven[:, :, k] = np.einsum("pahb,pbm->pahm", slope, phi[k].reshape(n_active, c, m)).reshape(n, nc, m)
        flexible = static[np.ix_(rows, rows)].reshape(n_active, c, n)
        series[..., k] = np.einsum("pahb,pbr->pahr", slope, flexible).reshape(n, nc, n)
    dg = np.linalg.solve(np.eye(n * nc) - series.reshape(n * nc, n * nc), driven.reshape(n * nc, nc * m))
    dg = dg.reshape(n, nc, nc * m)
    return np.concatenate([shape.conj().T @ dg[:, k] for k, shape in enumerate(phi)])
