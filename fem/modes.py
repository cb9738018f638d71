"""Natural modes of K phi = omega^2 M phi."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import issparse
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh
from threadpoolctl import threadpool_limits

from tribodyn.fem.factor import Factor, factorise

DENSE_BELOW = 400
RESTARTS = 100  # of the Lanczos iteration; a sound mesh needs some ten
NEGATIVE = 1e-10  # squared frequency below zero over the largest of a single DOF that is no rounding any more
UNSTABLE = "the structure is unstable at rest"
CURE = "its speed or its static load is beyond divergence or buckling; lower it"


class StaticDivergence(ValueError):
    """The structure is unstable at rest."""


def modes(
    K: Any, M: Any, n: int, sigma: float | None = None, factor: Factor | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The n lowest modes, mass-normalised.

    K, M : (N, N) sparse or dense symmetric [N/m], [kg], M positive definite, K positive semidefinite
    sigma : shift [rad^2/s^2] below the wanted modes; by default 0, or a little below where K is singular
    factor : factorisation of K - sigma M that exists already
    Returns omega (n,) ascending [rad/s], 0 for rigid-body modes to rounding; phi (N, n) [1/sqrt(kg)], each with its
        first large entry positive
    Raises  ValueError where n is not between 1 and N, or the iteration does not converge; StaticDivergence where a
        squared frequency is negative beyond rounding
    """
    size = K.shape[0]
    if not 1 <= n <= size:
        raise ValueError(f"modes: {n} modes were asked of a system with {size} DOFs; ask for 1 to {size}")
    if size <= DENSE_BELOW or 2 * n >= size or not issparse(K):
        values, phi = eigh(_dense(K), _dense(M), subset_by_index=[0, n - 1])
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
                    OPinv=LinearOperator(K.shape, matvec=factor.solve, dtype=float),
                    v0=np.random.default_rng(0).standard_normal(size),
                    maxiter=RESTARTS,
                    tol=getattr(factor, "tolerance", 0.0),  # of solutions by iteration
                )
            except ArpackNoConvergence as trouble:
                raise ValueError(
                    f"the natural frequencies are not found in {RESTARTS} restarts, {len(trouble.eigenvalues)} of {n} "
                    "are: the part is too thin or its elements are badly shaped; mesh it with better shaped ones"
                ) from None
        order = np.argsort(values)
        values, phi = values[order], phi[:, order]
    return frequencies(values, K, M), phi * _signs(phi)


def frequencies(values: np.ndarray, K: Any, M: Any) -> np.ndarray:
    """Frequencies (n,) [rad/s] of eigenvalues omega^2 of K, M; 0 where they are zero to rounding.

    Raises  StaticDivergence where one is negative
    """
    stiffest = float(np.max(np.abs(K.diagonal()) / np.abs(M.diagonal())))
    if values.min() < -NEGATIVE * stiffest:
        raise StaticDivergence(f"{UNSTABLE}, omega^2 = {values.min():.3g} rad2/s2: {CURE}")
    return np.sqrt(np.clip(values, 0, None))


def _factorise_shifted(K: Any, M: Any, sigma: float | None) -> tuple[Factor, float]:
    """Factorisation of K - sigma M, with a small negative shift where K alone is singular."""
    if sigma is not None:
        return factorise(K - sigma * M if sigma else K, definite=sigma <= 0), sigma
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
