"""Natural modes of K phi = omega^2 M phi, real or Hermitian, and of a turning structure M q'' + G q' + K q = 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import eigh, eigvalsh
from scipy.sparse import block_array, csr_matrix, issparse
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh
from threadpoolctl import threadpool_limits

from tribodyn.fem.factor import Factor, factorise


@dataclass(frozen=True)
class EigenOptions:
    """How natural modes are found.

    dense_below : DOFs up to which all modes of dense matrices are found; beyond, the Lanczos iteration
    restarts : of the Lanczos iteration; a sound mesh needs some ten
    negative : squared frequency below zero, over the largest of a single DOF, that is no rounding any more
    spanned : modes without Coriolis forces that span those with them; a system with fewer coordinates keeps them all
    """

    dense_below: int = 400
    restarts: int = 100
    negative: float = 1e-10
    spanned: int = 300


EIGEN = EigenOptions()
UNSTABLE = "the structure is unstable at rest"
CURE = "its speed or its static load is beyond divergence or buckling; lower it"


class StaticDivergence(ValueError):
    """The structure is unstable at rest."""


def modes(K: Any, M: Any, n: int, factor: Factor | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The n lowest modes, mass-normalised.

    K, M : (N, N) sparse or dense symmetric [N/m], [kg], M positive definite, K positive semidefinite
    factor : factorisation of K that exists already; where K is singular it is shifted a little
    Returns omega (n,) ascending [rad/s], 0 for rigid-body modes to rounding; phi (N, n) [1/sqrt(kg)], each with its
        first large entry positive
    Raises  ValueError where n is not between 1 and N, or the iteration does not converge; StaticDivergence where a
        squared frequency is negative beyond rounding
    """
    size = K.shape[0]
    if not 1 <= n <= size:
        raise ValueError(f"modes: {n} modes were asked of a system with {size} DOFs; ask for 1 to {size}")
    if size <= EIGEN.dense_below or 2 * n >= size or not issparse(K):
        values, phi = eigh(_dense(K), _dense(M), subset_by_index=[0, n - 1])
    else:
        factor, sigma = _factorise_shifted(K, M) if factor is None else (factor, 0.0)
        with threadpool_limits(1):  # two BLAS pools that wait for each other make this many times slower
            try:
                values, phi = eigsh(
                    K,
                    k=n,
                    M=M,
                    sigma=sigma,
                    OPinv=LinearOperator(K.shape, matvec=factor.solve, dtype=float),
                    v0=np.random.default_rng(0).standard_normal(size),
                    maxiter=EIGEN.restarts,
                    tol=getattr(factor, "tolerance", 0.0),  # of solutions by iteration
                )
            except ArpackNoConvergence as trouble:
                raise ValueError(
                    f"{len(trouble.eigenvalues)} of {n} natural frequencies are found in {EIGEN.restarts} restarts: "
                    "the part is too thin or its elements are badly shaped; mesh it with better shaped ones"
                ) from None
        order = np.argsort(values)
        values, phi = values[order], phi[:, order]
    return frequencies(values, K, M), phi * _signs(phi)


def hermitian_modes(K: Any, M: Any, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The n lowest modes of K phi = omega^2 M phi.

    K, M : (N, N) sparse or dense, real symmetric or complex Hermitian [N/m], [kg]; both positive definite where sparse
    Returns omega (n,) ascending [rad/s]; phi (N, n) [1/sqrt(kg)], mass-normalised, their phase arbitrary where complex
    Raises  ValueError where n is not between 1 and N, or a large sparse K is singular

    A large sparse K = R + iS is factorised as the real [[R, -S], [S, R]], so that one factorisation serves all parts
    """
    size = K.shape[0]
    if not (issparse(K) and np.iscomplexobj(K)) or size <= EIGEN.dense_below or 2 * n >= size:
        return modes(K, M, n)
    K = csr_matrix(K)
    factor = factorise(csr_matrix(block_array([[K.real, -K.imag], [K.imag, K.real]])))

    def solve(v: np.ndarray) -> np.ndarray:
        z = factor.solve(np.concatenate([v.real, v.imag]).ravel())
        return z[:size] + 1j * z[size:]

    with threadpool_limits(1):
        values, phi = eigsh(
            K,
            k=n,
            M=M,
            sigma=0.0,
            OPinv=LinearOperator(K.shape, matvec=solve, dtype=complex),
            v0=np.random.default_rng(0).standard_normal(size).astype(complex),
        )
    order = np.argsort(values)
    return frequencies(values[order], K, M), phi[:, order]


def turning_frequencies(K: Any, M: Any, G: Any, n: int) -> np.ndarray:
    """The n lowest frequencies omega > 0 (n,) [rad/s] of motions q exp(i omega t).

    K, M : (N, N) sparse or dense, Hermitian, as for `hermitian_modes`; G : (N, N) anti-Hermitian [N s/m]
    Of a wave of index j these are the motions that run with the rotation where j > 0; those against it belong to -j.
    The pencil is linearised as A y = omega B y, A = diag(K, M), B = [[-H, M], [M, 0]], H = iG, y = (q, omega q)
    Raises  ValueError where n is too large, StaticDivergence as `hermitian_modes` does
    Source  Meirovitch, Computational Methods in Structural Dynamics, 1980, chapter 5
    """
    lowest, phi = hermitian_modes(K, M, min(K.shape[0], max(EIGEN.spanned, 2 * n)))
    m = len(lowest)
    H = 1j * (phi.conj().T @ (G @ phi))
    H = (H + H.conj().T) / 2
    # rigid motions: a shift too small to be seen keeps A definite
    square = np.maximum(lowest, 1e-7 * lowest[-1]) ** 2
    A = np.concatenate([square, np.ones(m)])
    B = np.block([[-H, np.eye(m)], [np.eye(m), np.zeros((m, m))]]) / np.sqrt(np.outer(A, A))
    slowness = eigvalsh(B)
    omega = np.sort(1.0 / slowness[slowness > 0])
    return np.asarray(omega[:n])


def frequencies(values: np.ndarray, K: Any, M: Any) -> np.ndarray:
    """Frequencies (n,) [rad/s] of eigenvalues omega^2 of K, M; 0 where they are zero to rounding.

    Raises  StaticDivergence where one is negative
    """
    stiffest = float(np.max(np.abs(K.diagonal()) / np.abs(M.diagonal())))
    if values.min() < -EIGEN.negative * stiffest:
        raise StaticDivergence(f"{UNSTABLE}, omega^2 = {values.min():.3g} rad2/s2: {CURE}")
    return np.sqrt(np.clip(values, 0, None))


def _factorise_shifted(K: Any, M: Any) -> tuple[Factor, float]:
    """Factorisation of K - sigma M, sigma zero or a small negative shift where K alone is singular."""
    try:
        return factorise(K), 0.0
    except ValueError:
        sigma = -1e-9 * float(np.max(K.diagonal() / M.diagonal()))
    try:
        return factorise(K - sigma * M), sigma
    except ValueError:
        factorise(K, definite=False)  # singular is another matter
        raise StaticDivergence(f"{UNSTABLE}, omega^2 is negative: {CURE}") from None


def _dense(matrix: Any) -> np.ndarray:
    return matrix.toarray() if issparse(matrix) else np.asarray(matrix)


def _signs(phi: np.ndarray) -> np.ndarray:
    """Factor of modulus 1 per column: the first entry close to the largest becomes positive, whatever the rounding."""
    large = np.abs(phi) >= (1 - 1e-6) * np.abs(phi).max(axis=0)
    return np.sign(phi[large.argmax(axis=0), np.arange(phi.shape[1])].conj())
