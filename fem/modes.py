"""Natural modes of K phi = omega^2 M phi, real or Hermitian, and of a turning structure M q'' + G q' + K q = 0."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, cholesky, eigh, solve_triangular
from scipy.sparse import block_array, csr_matrix
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh
from threadpoolctl import threadpool_limits

from tribodyn.fem.factor import Factor, SingularStiffness, factorise
from tribodyn.fem.system import dense
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class EigenOptions:
    """How natural modes are found.

    dense_below : DOFs up to which all modes of dense matrices are found; beyond, the Lanczos iteration
    restarts : of the Lanczos iteration; a sound mesh needs some ten
    negative : squared frequency below zero, over the largest of a single DOF, that is no rounding any more
    turning : relative change of a frequency with Coriolis forces at which its motion is known"""

    dense_below: int = 400
    restarts: int = 100
    negative: float = 1e-10
    turning: float = 1e-9


EIGEN = EigenOptions()
ROUNDING = 1e-14  # of the largest mass, below which there is none
UNSTABLE = "the structure is unstable at rest"
CURE = "its speed or its static load is beyond divergence or buckling; lower it"


class StaticDivergence(Refusal):
    """The structure is unstable at rest."""


class IndefiniteMass(Refusal, LinAlgError):
    """A direction with a negative mass, or with neither mass nor stiffness, so that there are no modes."""


def modes(
    K: Any, M: Any, n: int, sigma: float | None = None, factor: Factor | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The n lowest modes, mass-normalised.

    K, M : (N, N) sparse or dense, symmetric or Hermitian [N/m], [kg], K positive semidefinite, M too where it is dense
    sigma : shift [rad^2/s^2] below the wanted modes; by default 0, or a little below where K is singular
    factor : factorisation of K - sigma M that exists already
    Returns omega (n,) ascending [rad/s], 0 for rigid-body modes to rounding; phi (N, n) [1/sqrt(kg)], each with its
        first large entry positive
    Raises  Refusal where n is not between 1 and N, or the iteration does not converge; StaticDivergence where a
        squared frequency is negative beyond rounding; IndefiniteMass"""
    size = K.shape[0]
    if not 1 <= n <= size:
        raise Refusal(f"modes: {n} modes were asked of a system with {size} DOFs; ask for 1 to {size}")
    if isinstance(K, np.ndarray) or size <= EIGEN.dense_below or 2 * n >= size:
        values, phi, _ = dense_modes(dense(K), dense(M), n)
    else:
        if factor is None:
            factor, sigma = _factorise_shifted(K, M, sigma)
        with threadpool_limits(1):  # two BLAS pools that wait for each other make this many times slower
            try:
                values, phi = eigsh(
                    K,
                    k=n,
                    M=M,
                    sigma=sigma or 0.0,
                    OPinv=LinearOperator(K.shape, matvec=factor.solve, dtype=K.dtype),
                    v0=np.random.default_rng(0).standard_normal(size).astype(K.dtype),
                    maxiter=EIGEN.restarts,
                )
            except ArpackNoConvergence as trouble:
                raise Refusal(
                    f"{len(trouble.eigenvalues)} of {n} natural frequencies are found in {EIGEN.restarts} restarts: "
                    "the part is too thin or its elements are badly shaped; mesh it with better shaped ones"
                ) from None
        order = np.argsort(values)
        values, phi = values[order], phi[:, order]
    large = np.abs(phi) >= (1 - 1e-6) * np.abs(phi).max(axis=0)  # whatever the rounding
    sign = np.sign(phi[large.argmax(axis=0), np.arange(phi.shape[1])].conj())  # the first of these gets positive
    return frequencies(values, K, M), phi * sign


def dense_modes(K: np.ndarray, M: np.ndarray, n: int | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The n lowest modes of dense matrices, all by default, and what follows them without mass.

    Returns squared frequencies (m,) and shapes (N, m) of unit modal mass; static (N, N - M's rank), of unit stiffness:
    directions without mass follow the others at once
    Raises  IndefiniteMass for a negative mass, and for a direction with neither mass nor stiffness"""
    try:
        return *eigh(K, M, subset_by_index=None if n is None else [0, n - 1]), np.zeros((len(M), 0))
    except LinAlgError:
        mass, direction = eigh(M)
    if mass[0] < -ROUNDING * mass[-1]:
        raise IndefiniteMass("the mass matrix has negative eigenvalues: mend it")
    rest, heavy = np.split(direction, [int(np.sum(mass <= ROUNDING * mass[-1]))], axis=1)
    try:
        lower = cholesky(rest.conj().T @ K @ rest, lower=True)
    except LinAlgError:
        raise IndefiniteMass("a coordinate has neither mass nor stiffness: give it one of them") from None
    static = solve_triangular(lower, rest.conj().T, lower=True).conj().T
    heavy = heavy - static @ (static.conj().T @ K @ heavy)
    squares, phi = eigh(heavy.conj().T @ K @ heavy, heavy.conj().T @ M @ heavy)
    return squares[:n], heavy @ phi[:, :n], static


def lowest_squares(K: np.ndarray, M: np.ndarray, n: int) -> np.ndarray:
    """The n lowest squared frequencies of dense matrices; fewer where there are fewer directions with mass."""
    try:
        return np.asarray(eigh(K, M, eigvals_only=True, subset_by_index=(0, n - 1)))
    except LinAlgError:
        return dense_modes(K, M, n)[0]


def turning_frequencies(K: Any, M: Any, G: Any, n: int) -> np.ndarray:
    """The n lowest frequencies omega > 0 (n,) [rad/s] of motions q exp(i omega t).

    K, M : (N, N) sparse or dense, Hermitian, as for `modes`; G : (N, N) anti-Hermitian [N s/m]
    Of a wave of index j these are the motions that run with the rotation where j > 0; those against it belong to -j.
    A large system is projected on modes without Coriolis forces and on corrections of the motions by their residual,
    solved with K, until no frequency changes any more
    Raises  Refusal where n is too large, StaticDivergence as `modes` does
    Source  Meirovitch, Computational Methods in Structural Dynamics, 1980, chapter 5; Davidson, J. Comput. Phys. 17
    (1975) 87"""
    size = K.shape[0]
    if isinstance(K, np.ndarray) or 4 * n >= size:
        return _turning_modes(dense(K), dense(M), dense(G), n)[0]
    K = csr_matrix(K, dtype=complex)
    factor, sigma = _factorise_shifted(K, M, None)
    basis = modes(K, M, 2 * n, sigma, factor)[1]
    last, change = np.zeros(n), np.inf
    while True:
        stiffness, mass, coriolis = (basis.conj().T @ (matrix @ basis) for matrix in (K, M, G))
        omega, motions = _turning_modes(stiffness, mass, coriolis, n)
        last_change, change = change, float(np.max(np.abs(omega - last) / omega))
        if change <= EIGEN.turning or change >= last_change:  # as near as rounding lets it
            return omega
        last, q = omega, basis @ motions
        correction = factor.solve(K @ q + (1j * (G @ q) - (M @ q) * omega) * omega)
        basis = np.linalg.qr(np.hstack([basis, correction / np.linalg.norm(correction, axis=0)]))[0]


def _turning_modes(K: np.ndarray, M: np.ndarray, G: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The same of dense matrices with their motions q (N, n).

    The pencil is linearised as A y = omega B y, A = diag(K, M), B = [[-H, M], [M, 0]], H = iG, y = (q, omega q)"""
    lowest, phi = modes(K, M, K.shape[0])
    m = len(lowest)
    H = 1j * (phi.conj().T @ (G @ phi))
    H = (H + H.conj().T) / 2
    # rigid motions: a shift too small to be seen keeps A definite
    square = np.maximum(lowest, 1e-7 * lowest[-1]) ** 2
    root = np.sqrt(np.concatenate([square, np.ones(m)]))
    pencil = np.block([[-H, np.eye(m)], [np.eye(m), np.zeros((m, m))]]) / np.outer(root, root)
    slowness, y = eigh(pencil, subset_by_index=(2 * m - min(n, m), 2 * m - 1))  # of both signs, m of each
    return 1.0 / slowness[::-1], phi @ (y[:m, ::-1] / root[:m, None])


def frequencies(values: np.ndarray, K: Any, M: Any) -> np.ndarray:
    """Frequencies (n,) [rad/s] of eigenvalues omega^2 of K, M; 0 where they are zero to rounding.

    Raises  StaticDivergence where one is negative"""
    if values.min() < -EIGEN.negative * stiffest(K, M):
        raise StaticDivergence(f"{UNSTABLE}, omega^2 = {values.min():.3g} rad2/s2: {CURE}")
    return np.sqrt(np.clip(values, 0, None))


def stiffest(K: Any, M: Any) -> float:
    """Largest squared frequency of a single DOF [rad2/s2], of those that have a mass."""
    mass = np.abs(M.diagonal())
    return float(np.max(np.abs(K.diagonal())[mass > 0] / mass[mass > 0]))


def _factorise_shifted(K: Any, M: Any, sigma: float | None) -> tuple[Factor, float]:
    """Factorisation of K - sigma M, with a small negative shift where K alone is singular."""
    if sigma is not None:
        return _factorise(K - sigma * M if sigma else K, definite=sigma <= 0), sigma
    try:
        return _factorise(K), 0.0
    except SingularStiffness:
        sigma = -1e-9 * stiffest(K, M)
    try:
        return _factorise(K - sigma * M), sigma
    except SingularStiffness:
        _factorise(K, definite=False)  # singular is another matter
        raise StaticDivergence(f"{UNSTABLE}, omega^2 is negative: {CURE}") from None


@dataclass
class _OfHermitian:
    """Solutions of a Hermitian R + iS by a factor of the real [[R, -S], [S, R]], one for both parts."""

    factor: Factor
    name: str = "of a Hermitian matrix"

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        real, imaginary = np.split(self.factor.solve(np.concatenate([rhs.real, rhs.imag])), 2)
        return np.asarray(real + 1j * imaginary)


def _factorise(K: Any, definite: bool = True) -> Factor:
    if not np.iscomplexobj(K):
        return factorise(K, definite)
    return _OfHermitian(factorise(block_array([[K.real, -K.imag], [K.imag, K.real]]), definite))
