"""Hill's method for a travelling wave: perturbations of every nodal diameter, which one sector does not show.

A motion that repeats itself from sector to sector, x_n(t) = x_0(t - n phi / w), is perturbed by

    d x_n(t) = exp(lambda t) sum_k X_k exp(i k (w t - n phi)) exp(-i 2 pi d n / N),    phi = 2 pi EO / N,

which solves the linearised equations of the whole wheel for d = 0 .. N - 1 (Floquet in time, Bloch round the wheel):
its harmonic k sees the wave of index k EO + d. With the modes Phi, L of the stuck wheel at that index,

    (lambda + i k w)^2 eta_k + C_k (lambda + i k w) eta_k + L_k eta_k = Phi_k^H dg_k,
    X_k = Phi_k eta_k + W_k dg_k,    dg = (dg/dx) X,

one quadratic eigenproblem for each d; that of N - d is its conjugate. The assumptions are those of `exponents`.
Source  Floquet-Bloch perturbations of a periodic solution with space-time symmetry: Krack and Gross 2019, section 3.7,
for one sector; the extension to all nodal diameters and the elimination of the contact are ours"""

import numpy as np
import scipy.linalg as sla

from tribodyn.hbm.linear.stuck_modes import stuck_modes
from tribodyn.hbm.stability.hill_problem import GROWS, Answer, StuckModes, index_exponents, of_exponentials, refined
from tribodyn.reduction.model import ReducedModel

COPY_DISTANCE, SAME_CENTRE = 0.02, 0.25  # over omega, and of harmonic numbers: how far truncation drives copies apart


class WaveModes:
    """Stuck modes and contact flexibility of the wheel by index, each made once.

    n_modes : of each index that move dynamically; the others follow statically"""

    def __init__(self, model: ReducedModel, stiffness: np.ndarray, n_modes: int):
        from tribodyn.reduction.wave_model import as_wave  # only wheels need it

        wave = as_wave(model)
        self.n_sectors, self.engine_order = wave.n_sectors, wave.engine_order
        self._per_index, self._k, self.m = wave.at_index, np.asarray(stiffness, float).ravel(), n_modes
        self._cache: dict[int, StuckModes] = {}

    def __call__(self, index: int) -> StuckModes:
        """Squared frequencies (m,), damping and flow (m, m), contact shapes (n_contact, m), W of the rest."""
        index = index % self.n_sectors
        mirror = 2 * index > self.n_sectors
        key = self.n_sectors - index if mirror else index
        if key not in self._cache:
            self._cache[key] = self._make(key)
        lam, *matrices = self._cache[key]
        c, flow, phi, static = (part.conj() for part in matrices) if mirror else matrices
        return lam, c, flow, phi, static

    def _make(self, index: int) -> StuckModes:
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
    modes: WaveModes, omega: float, slope: np.ndarray, answer: Answer | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Floquet exponents of a travelling wave against perturbations of every nodal diameter.

    slope : (n_pair, c, n_coeff, c, n_coeff) dg/dx with coefficients [x_0, a_1, b_1, ...] up to the highest harmonic of
        the perturbation; answer : as of `refined`
    Returns exponents (n,) [1/s] and the index d (n,) of each perturbation, from -N/2 + 1 to N/2"""
    order, n = modes.engine_order, modes.n_sectors
    active = np.flatnonzero(np.abs(slope).max(axis=(1, 2, 3, 4)) > 0)
    blocks = of_exponentials(slope[active])
    c = slope.shape[1]
    rows = (active[:, None] * c + np.arange(c)).ravel()
    values, centres, diameters = [], [], []
    for d in range(n // 2 + 1):
        values_of_index, centre = index_exponents(modes, order, d, omega, blocks, rows)
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


def _once(
    values: np.ndarray, centre: np.ndarray, diameters: np.ndarray, order: int, n_sectors: int, limit: int
) -> np.ndarray:
    """At most `limit` exponents, in units of omega, with the most central perturbations, none of them twice.

    (lambda - i s, d - s EO) with harmonics renumbered by s is the same perturbation as (lambda, d), for whole s"""
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
