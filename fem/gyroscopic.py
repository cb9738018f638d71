"""Natural frequencies of a turning structure: M q'' + G q' + K q = 0 with an anti-Hermitian Coriolis matrix G."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.hermitian import hermitian_modes

KEPT = 300  # modes without Coriolis forces that span those with them; a system with fewer coordinates keeps them all


def turning_frequencies(K: Any, M: Any, G: Any, n: int) -> np.ndarray:
    """The n lowest frequencies omega > 0 (n,) [rad/s] of motions q exp(i omega t).

    K, M : (N, N) sparse or dense, Hermitian, as for `hermitian_modes`; G : (N, N) anti-Hermitian [N s/m]
    Of a wave of index j these are the motions that run with the rotation where j > 0; those against it belong to -j.
    The pencil is linearised as A y = omega B y, A = diag(K, M), B = [[-H, M], [M, 0]], H = iG, y = (q, omega q)
    Raises  ValueError where n is too large, StaticDivergence as `hermitian_modes` does
    Source  Meirovitch, Computational Methods in Structural Dynamics, 1980, chapter 5
    """
    lowest, phi = hermitian_modes(K, M, min(K.shape[0], max(KEPT, 2 * n)))
    m = len(lowest)
    H = 1j * (phi.conj().T @ (G @ phi))
    H = (H + H.conj().T) / 2
    # rigid motions: a shift too small to be seen keeps A definite
    square = np.maximum(lowest, 1e-7 * lowest[-1]) ** 2
    A = np.concatenate([square, np.ones(m)])
    B = np.block([[-H, np.eye(m)], [np.eye(m), np.zeros((m, m))]]) / np.sqrt(np.outer(A, A))
    slowness = sla.eigvalsh(B)
    omega = np.sort(1.0 / slowness[slowness > 0])
    return np.asarray(omega[:n])
