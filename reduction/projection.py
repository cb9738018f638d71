"""A reduced model in fewer coordinates of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.model import ReducedModel

STALE = ("free_frequency_error", "stuck_frequency", "stuck_frequency_error")


def projected(model: ReducedModel, basis: np.ndarray) -> ReducedModel:
    """The model in coordinates p, q = basis @ p, with basis (n, n_p) real; matrices are made symmetric to rounding.

    Its facts about frequencies of the model before are left out, but for the free ones
    """
    s = model.system
    system = SecondOrderSystem(
        _congruent(basis, s.mass),
        _congruent(basis, s.stiffness),
        None if s.damping is None else _congruent(basis, s.damping),
        {name: basis.T @ load for name, load in s.loads.items()},
        {name: basis.T @ row for name, row in s.outputs.items()},
    )
    interface = replace(model.interface, B=np.asarray(model.interface.B) @ basis)
    full = None if model.basis is None else model.basis @ basis
    facts = {name: fact for name, fact in model.info.items() if name not in STALE}
    return replace(model, system=system, interface=interface, basis=full, info=facts)


def _congruent(basis: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    product = basis.T @ matrix @ basis
    return (product + product.T) / 2
