"""The stuck springs of a balance, which the contact forces are measured from."""

from typing import Any

import numpy as np
from scipy.sparse import issparse

from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.reduction.model import ReducedModel


def body_stiffness(model: ReducedModel, basis: HarmonicBasis) -> np.ndarray:
    """(n_pair, n_component) stiffness of the body against a contact displacement with all others held [N/m]."""
    system, b = model.at_harmonic(basis.harmonics[-1])
    return _against(system.stiffness, b).reshape(model.interface.n_pair, -1)


def _against(matrix: Any, b: Any) -> np.ndarray:
    """(n_contact,) what a matrix of the body (n, n) has against each row of the contact map b (n_contact, n)."""
    matrix, b = (np.asarray(m.toarray() if issparse(m) else m) for m in (matrix, b))
    length = (np.abs(b) ** 2).sum(axis=1) ** 2  # zero for a component that a pair has not
    against: np.ndarray = ((b @ matrix) * b.conj()).sum(axis=1).real / np.where(length > 0, length, 1.0)
    return against


def reference_springs(
    springs: np.ndarray, model: ReducedModel, basis: HarmonicBasis, omega_max: float, hard: float = 1e5,
    cut: float = 1e2, most_unknowns: int = 3000,
) -> np.ndarray:  # fmt: skip
    """Springs (n_pair, n_component) [N/m], those harder than `hard` times the body cut to `cut` times it.

    Where body and springs are both zero, as of a mass on a cubic spring, the reference is the inertia at omega_max. All
    that of few contacts only (`most` unknowns): where many stick, all would depart from a reference not their own"""
    if not 0 < springs.size * basis.n_coeff <= most_unknowns:
        return springs
    body = body_stiffness(model, basis)
    if not (springs + body).all():
        system, b = model.at_harmonic(basis.harmonics[-1])
        inertia = omega_max**2 * _against(system.mass, b).reshape(springs.shape)
        springs = np.where((springs == 0) & (body == 0), inertia, springs)
    return np.where((springs > hard * body) & (body > 0), cut * body, springs)
