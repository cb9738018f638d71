"""From the contact back to the part: coordinates and full displacement that belong to a solved contact."""

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.reduction.linear import stuck_dynamic_stiffness
from tribodyn.reduction.residual_flexibility import FlexibleModel


def coordinates(
    balance: HarmonicBalance, displacement: np.ndarray, force: np.ndarray, omega: float
) -> list[np.ndarray]:
    """Complex amplitudes (n,) of the model's coordinates [m], harmonic by harmonic.

    displacement, force : (n_contact, n_coeff) relative displacement [m] and contact force [N]; omega : [rad/s]
    Solves D_h q_h = F_h + B^H (k x - f), where the contact springs k, stuck and closed, are part of D_h so that a
    structure held by its contact alone is no exception"""
    balance = balance.standing(omega)
    basis, excitation = balance.basis, balance.excitation
    k = balance.reference_stiffness
    stretch = displacement if excitation.base is None else displacement + balance.loaded(excitation.base)
    g = basis.to_complex(k[:, None] * stretch - force)
    amplitudes = []
    for position, h in enumerate(basis.harmonics):
        system, B = balance.model.at_harmonic(h)
        load = (balance.load_factor if h else 1.0) * excitation.force(h, system.loads, system.n_dof)
        total = B.conj().T @ g[:, position] + load
        amplitudes.append(np.linalg.solve(stuck_dynamic_stiffness(system, B, k, 1j * h * omega), total))
    return amplitudes


def full_displacement(
    balance: HarmonicBalance, displacement: np.ndarray, force: np.ndarray, omega: float
) -> np.ndarray:
    """Displacement of every DOF of the full part (n_full, n_coeff) [m]; arguments as `coordinates`.

    Where stress is asked for with what the modes left out carry; of a cyclic part: of sector 0 in its own frame"""
    balance = balance.standing(omega)
    amplitudes = coordinates(balance, displacement, force, omega)
    harmonics = balance.basis.harmonics
    fields = [balance.model.reconstruct(q, h) for h, q in zip(harmonics, amplitudes, strict=True)]
    full = np.stack(fields, axis=-1).astype(complex)
    omitted = None if balance.stress is None else balance.stress.omitted
    if omitted is not None and (dynamic := np.flatnonzero(harmonics)).size:
        n, loads = len(full), omitted.system.loads
        loaded = [balance.load_factor * balance.excitation.force(harmonics[i], loads, n) for i in dynamic]
        rate = omega * np.array(harmonics)[dynamic]
        full[:, dynamic] += omitted.displacement(full[:, dynamic], np.stack(loaded, axis=-1), rate)
    part_displacement: np.ndarray = balance.basis.to_real(full)
    model = balance.model
    if isinstance(model, FlexibleModel):
        base = balance.excitation.base
        stretch = displacement if base is None else displacement + balance.loaded(base)
        part_displacement += model.residual.field(model.residual.stiffness[:, None] * stretch - force)
    return part_displacement
