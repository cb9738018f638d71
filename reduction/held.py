"""Motions of a reduced model that are held: linear constraints on its coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import null_space

from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.linear import linear_modes
from tribodyn.reduction.model import ReducedModel


def hold(model: ReducedModel, rows: np.ndarray) -> ReducedModel:
    """The model without the motions that break rows @ q_full = 0.

    rows : (k, n_full), such as Part.held; none leaves the model as it is
    Returns the model in coordinates p, q = N p with N an orthonormal basis of what is allowed; they are no longer the
        displacements of single DOFs, but the contact map, loads, outputs and the way back know that
    Raises  ValueError for a model without a full field, or one whose harmonics see different systems
    """
    if len(rows) == 0:
        return model
    if model.basis is None or model.per_harmonic is not None:
        raise ValueError("motions can be held only in a model that was reduced from one mesh for all harmonics")
    held = rows @ model.basis
    N = null_space(held / np.linalg.norm(held, axis=1, keepdims=True))
    held_model = model.projected(N)
    frequency, _ = linear_modes(held_model, n=min(LIMITS.reported_modes, N.shape[1]))
    return replace(held_model, info=replace(held_model.info, free_frequency=frequency))
