"""A reduced model in fewer coordinates of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.model import ReducedModel


def projected(model: ReducedModel, basis: np.ndarray) -> ReducedModel:
    """The model in coordinates p, q = basis @ p, with basis (n, n_p) real; matrices are made symmetric to rounding.

    What its info says of frequencies of the model before is left out, but for the free ones
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
    info = replace(model.info, free_frequency_error=None, stuck_frequency=None, stuck_frequency_error=None)
    return replace(model, system=system, interface=interface, basis=full, info=info)


def _congruent(basis: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    product = basis.T @ matrix @ basis
    return (product + product.T) / 2
