"""Linear reference states: free (no contact) and stuck (closed contact springs)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from tribodyn.fem.modes import modes
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.model import ReducedModel

if TYPE_CHECKING:
    from tribodyn.fem.part import Part


def linear_modes(
    model: ReducedModel | Part, stiffness: np.ndarray | None = None, n: int = 10
) -> tuple[np.ndarray, np.ndarray]:
    """The n lowest modes of a reduced model or of a part, free or with contact springs.

    stiffness : (n_pair, n_component) [N/m], None for the free state
    Returns frequency (n,) [Hz], mass-normalised shapes (n_dof, n)"""
    K = model.system.stiffness
    K = K if stiffness is None else stuck_stiffness(K, model.interface.B, stiffness)
    omega, shapes = modes(K, model.system.mass, n)
    return omega / (2 * np.pi), shapes


def stuck_stiffness(K: Any, B: Any, stiffness: np.ndarray) -> Any:
    """K + B^H k B (n, n) [N/m], sparse or dense like K; stiffness k : (n_pair, n_component) [N/m]."""
    if not isinstance(K, np.ndarray):
        B = csr_matrix(B)
        return K + csr_matrix(B.conj().T @ diags_array(np.ravel(stiffness)) @ B)
    return K + B.conj().T @ (np.ravel(stiffness)[:, None] * B)


def stuck_dynamic_stiffness(system: SecondOrderSystem, B: np.ndarray, springs: np.ndarray, s: complex) -> np.ndarray:
    """K + F + B^H k B + s (C + G) + s^2 M (n, n) of a dense system; springs k : (n_contact,) [N/m]; s : i omega h."""
    dynamic = stuck_stiffness(system.stiffness, B, springs) + s**2 * system.mass
    if system.velocity_matrix is not None:
        dynamic = dynamic + s * system.velocity_matrix
    return np.asarray(dynamic if system.circulatory is None else dynamic + system.circulatory)
