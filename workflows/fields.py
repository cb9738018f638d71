"""Full displacement of the part and hysteresis loops of the contact, from the rows of a wear history."""

from __future__ import annotations

import numpy as np

from fem.part import Part
from hbm import aft
from hbm.balance import HarmonicBalance
from hbm.wear_history import WearRow
from workflows.result import Fields, Loops


def displacement_fields(balance: HarmonicBalance, part: Part, rows: list[WearRow], numbers: np.ndarray) -> Fields:
    """Displacement of every node at chosen rows of a wear history.

    balance : the unworn problem under the load that the rows come from; numbers : (n_field,) rows to take
    """
    found = [part.field(balance.model.reconstruct(coordinates(balance, rows[i]))) for i in numbers]
    return Fields(np.asarray(numbers), np.stack(found))


def coordinates(balance: HarmonicBalance, row: WearRow) -> np.ndarray:
    """Coordinates of the reduced model (n, n_coeff) [m], from the contact displacement and force of a row.

    Solves D_h q_h = F_h + B^T (k x - f), where the contact springs k, stuck and closed, are part of D_h so that a
    structure held by its contact alone is no exception.
    """
    basis, excitation = balance.basis, balance.excitation
    k = balance.parameters.stiffness.ravel()
    g = basis.to_complex(k[:, None] * row.displacement - row.force)
    if excitation.base is not None:
        g = g + basis.to_complex(k[:, None] * excitation.base)
    amplitudes = []
    for position, h in enumerate(basis.harmonics):
        system, B = balance.model.at_harmonic(h)
        s = 1j * h * row.omega
        dynamic = system.stiffness + B.conj().T @ (k[:, None] * B) + s**2 * system.mass
        if system.damping is not None:
            dynamic = dynamic + s * system.damping
        force = B.conj().T @ g[:, position]
        for (order, name), value in excitation.loads.items():
            if order == h:
                force = force + value * (balance.load_factor if h else 1.0) * system.loads[name]
        amplitudes.append(np.linalg.solve(dynamic, force))
    return basis.to_real(np.stack(amplitudes, axis=-1))


def hysteresis_loops(balance: HarmonicBalance, rows: list[WearRow], numbers: np.ndarray) -> Loops:
    """Displacement and force of every pair over the cycle at chosen rows of a wear history."""
    shape = (balance.parameters.n_pair, -1, balance.basis.n_coeff)
    displacement, force = [], []
    for i in numbers:
        parameters = balance.with_gap(balance.parameters.gap + rows[i].depth).parameters
        x, f = aft.history(balance.law, rows[i].displacement.reshape(shape), parameters, balance.basis, balance.memory)
        displacement.append(x)
        force.append(f)
    return Loops(np.asarray(numbers), np.stack(displacement), np.stack(force))
