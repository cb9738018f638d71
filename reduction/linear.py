"""Linear reference states: free (no contact) and stuck (closed contact springs)."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, diags_array, issparse

from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.modes import modes
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.model import ReducedModel


def linear_modes(
    model: ReducedModel, stiffness: np.ndarray | None = None, n: int = 10
) -> tuple[np.ndarray, np.ndarray]:
    """The n lowest modes of a reduced model, free or with contact springs.

    stiffness : (n_pair, n_component) [N/m], None for the free state
    Returns frequency (n,) [Hz], mass-normalised shapes (n_dof, n)
    """
    return system_modes(model.system, model.interface, stiffness, n)


def system_modes(
    system: SecondOrderSystem, interface: ContactInterface, stiffness: np.ndarray | None = None, n: int = 10
) -> tuple[np.ndarray, np.ndarray]:
    """The same of any system, full or reduced, with its interface: frequency (n,) [Hz], shapes (n_dof, n)."""
    K = system.stiffness if stiffness is None else stuck_stiffness(system.stiffness, interface.B, stiffness)
    omega, shapes = modes(K, system.mass, n)
    return omega / (2 * np.pi), shapes


def stuck_stiffness(K: Any, B: Any, stiffness: np.ndarray) -> Any:
    """K + B^H k B (n, n) [N/m], sparse or dense like K; stiffness k : (n_pair, n_component) [N/m]."""
    if issparse(K):
        B = csr_matrix(B)
        return csr_matrix(K + B.conj().T @ diags_array(np.ravel(stiffness)) @ B)
    return K + B.conj().T @ (np.ravel(stiffness)[:, None] * B)
