"""The eigenproblem of Hill's method in exponentials, for plain structures and wheels and any answer of the contact.

A plain structure is the wave of index 0 at engine order 0; for a wheel see `wave_exponents`."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import scipy.linalg as sla
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs

# over omega: real parts up to it count as zero, for the solution is no better than that; how exactly they are known
GROWS, ACCURACY = 1e-6, 1e-3
SHARES = (0.25, 0.5, 0.75, *8 * (1.0,))  # of the answer to an exponent itself, on the way to it

StuckModes = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
Place = tuple[Callable[[int], StuckModes], int, int, float]  # modes by index, engine order, d, omega
Answer = Callable[[complex], np.ndarray]  # exponent over omega -> as `perturbed_contact.departure`


def refined(exponents: np.ndarray, at: Place, slope: np.ndarray, answer: Answer) -> np.ndarray:
    """Exponents (n,), in units of omega: those that grow by the answer `slope` to a steady vibration solved for again.

    Each is followed to the contact's answer to just that exponent, and stays where that leads nowhere"""
    rows, steady, result = np.arange(slope.shape[0] * slope.shape[1]), of_exponentials(slope), exponents.copy()
    for i in np.flatnonzero(exponents.real > GROWS):
        exponent = exponents[i]
        for share in SHARES:
            before, exponent = exponent, _nearest(exponent, *at, (1 - share) * steady + share * answer(exponent), rows)
            if share == 1 and abs(exponent - before) < ACCURACY:
                result[i] = exponent
                break
    return result


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


def index_exponents(
    modes: Callable[[int], StuckModes], order: int, d: int, omega: float, blocks: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Exponents of perturbations of index d, in units of omega, and the mean k of each; those with it within 1."""
    numbers, constant, linear = _quadratic(modes, order, d, omega, blocks, rows)
    unit = np.eye(len(constant))
    companion = np.block([[np.zeros_like(unit), unit], [-constant, -linear]])
    return _central(numbers, *np.linalg.eig(companion))


def _nearest(now: complex, *problem: Any) -> complex:
    """The exponent of `index_exponents` that is nearest to one, by Arnoldi's method on the inverse beside it.

    Source  Saad, Numerical Methods for Large Eigenvalue Problems, 2nd ed., section 8.2; a fifth of the time of all"""
    numbers, constant, linear = _quadratic(*problem)
    n, shift = len(constant), now + ACCURACY  # at an exponent itself the inverse has no bound
    factors = sla.lu_factor(constant + shift * linear + shift**2 * np.eye(n))

    def inverse(v: np.ndarray) -> np.ndarray:
        x = -sla.lu_solve(factors, v[n:] + linear @ v[:n] + shift * v[:n])
        return np.concatenate([x, v[:n] + shift * x])

    values = np.empty(0)
    if n > 10:
        with suppress(ArpackNoConvergence):  # then all are computed
            inverse_values, vectors = eigs(
                LinearOperator((2 * n, 2 * n), inverse, dtype=complex), 4, v0=np.ones(2 * n), tol=1e-11
            )
            values, _ = _central(numbers, shift + 1 / inverse_values, vectors)
    if len(values) == 0:
        values, _ = index_exponents(*problem)
    return complex(values[np.argmin(np.abs(values - now))])


def _quadratic(
    modes: Callable[[int], StuckModes], order: int, d: int, omega: float, blocks: np.ndarray, rows: np.ndarray
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


def _contact_in_modes(blocks: np.ndarray, rows: np.ndarray, modes: list[StuckModes]) -> np.ndarray:
    """Phi^H dg of modal displacements, the flexibility W of what follows in series: (nc m, nc m), harmonic by harmonic.

    blocks : (n_active, c, nc, c, nc)"""
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
