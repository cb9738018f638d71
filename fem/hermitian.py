"""Natural modes of a Hermitian pencil, such as a sector under cyclic constraints."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import block_array, csr_matrix, issparse
from scipy.sparse.linalg import LinearOperator, eigsh
from threadpoolctl import threadpool_limits

from tribodyn.fem.factor import factorise
from tribodyn.fem.modes import DENSE_BELOW, frequencies, modes


def hermitian_modes(K: Any, M: Any, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The n lowest modes of K phi = omega^2 M phi.

    K, M : (N, N) sparse or dense, real symmetric or complex Hermitian [N/m], [kg]; both positive definite where sparse
    Returns omega (n,) ascending [rad/s]; phi (N, n) [1/sqrt(kg)], mass-normalised, their phase arbitrary where complex
    Raises  ValueError where n is not between 1 and N, or a large sparse K is singular

    A large sparse K = R + iS is factorised as the real [[R, -S], [S, R]], so that one factorisation serves all parts
    """
    size = K.shape[0]
    if not (issparse(K) and np.iscomplexobj(K)) or size <= DENSE_BELOW or 2 * n >= size:
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
