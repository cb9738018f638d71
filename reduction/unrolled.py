"""The sectors of a wheel until a wave repeats itself, as one real model: what a travelling wave is in time.

A wave of engine order EO repeats itself after n = N / gcd(N, EO) sectors. These close to a ring in which only the
indices 0, g, 2 g, ... live, g = gcd(N, EO). Its coordinates are the free modes of these indices, cosine and sine of the
complex ones, so that nothing of the size of the wheel is ever decomposed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.cyclic_symmetry import sector_name
from tribodyn.fem.interface import join
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.wave_model import WaveModel


def unrolled(model: WaveModel, highest: float) -> ReducedModel:
    """The sectors of a travelling wave until it repeats itself, in modal coordinates: unit mass, diagonal stiffness.

    model : of a wave, see `wave_model.travelling_wave`, damped or not
    highest : angular frequency [rad/s] up to which modes of the wheel without contact keep their inertia; of an index
        with many more modes than contacts, loads and outputs the others are replaced by as many shapes of the same
        compliance there
    Returns the model; contact rows sector by sector, loads and outputs "<name>@<sector>"
    """
    N, n = model.n_sectors, model.sectors_in_time
    step = N // n
    lam, ports, damping, gyroscopic, circulatory = [], [], [], [], []
    for index in range(0, N // 2 + 1, step):
        squares, rows, c, g, flow = _modes(*model.at_index(index), highest)
        pair = 0 < 2 * index < N
        lam.append(np.tile(squares, 1 + pair))
        turned = np.stack([rows * np.exp(-2j * np.pi * (index * k % N) / N) for k in range(n)])
        # of amplitudes (u + i v) / sqrt(2) of an index and of their conjugates of its mirror
        port_rows = np.sqrt(2) * np.concatenate([turned.real, -turned.imag], axis=-1) if pair else turned.real
        ports.append(port_rows / np.sqrt(n))
        damping.append(_real_matrix(c, pair))
        gyroscopic.append(_real_matrix(g, pair))
        circulatory.append(_real_matrix(flow, pair))
    squares, rows = np.concatenate(lam), np.concatenate(ports, axis=2)  # (n_mode,), (n, n_port, n_mode)
    system, _ = model.at_index(0)
    n_contact, loads, outputs = model.interface.B.shape[0], list(system.loads), list(system.outputs)
    at = n_contact + len(loads)
    named = {
        kind: {sector_name(name, k): rows[k, first + i] for k in range(n) for i, name in enumerate(names)}
        for kind, first, names in (("loads", n_contact, loads), ("outputs", at, outputs))
    }
    ring = SecondOrderSystem(
        np.eye(len(squares)),
        np.diag(squares),
        sla.block_diag(*damping) if system.damping is not None else None,
        named["loads"],
        named["outputs"],
        _together(gyroscopic),
        _together(circulatory),
    )
    interface = join([replace(model.interface, B=sector_rows[:n_contact]) for sector_rows in rows])
    return ReducedModel(ring, interface)


def _modes(
    system: SecondOrderSystem, B: np.ndarray, highest: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Squared frequencies (m,), ports (n_port, m), and (m, m) each damping, Coriolis forces and flow of an index."""
    lam, phi = sla.eigh(np.asarray(system.stiffness), np.asarray(system.mass))
    loads = [np.conj(load)[None] for load in system.loads.values()]
    outputs = [np.asarray(row)[None] for row in system.outputs.values()]
    rows = np.concatenate([np.asarray(B), *loads, *outputs]) @ phi
    moving = int(np.sum(lam < highest**2))
    if len(lam) - moving > len(rows):
        remainder = rows[:, moving:] / np.sqrt(lam[moving:])
        size, shapes = sla.eigh(remainder @ remainder.conj().T)
        retained = size > LIMITS.negligible * size[-1]
        still = LIMITS.static_frequency * highest
        rows = np.concatenate([rows[:, :moving], still * np.sqrt(size[retained]) * shapes[:, retained]], axis=1)
        lam = np.concatenate([lam[:moving], np.full(int(retained.sum()), still**2)])
        phi = phi[:, :moving]

    def modal(matrix: np.ndarray | None) -> np.ndarray:
        full = np.zeros((len(lam), len(lam)), rows.dtype)
        if matrix is not None:
            full[: phi.shape[1], : phi.shape[1]] = phi.conj().T @ np.asarray(matrix) @ phi
        return full

    return lam, rows, modal(system.damping), modal(system.gyroscopic), modal(system.circulatory)


def _together(blocks: list[np.ndarray]) -> np.ndarray | None:
    """Blocks of all indices as one matrix, None where all vanish."""
    return sla.block_diag(*blocks) if any(block.any() for block in blocks) else None


def _real_matrix(matrix: np.ndarray, pair: bool) -> np.ndarray:
    """A matrix on complex amplitudes u + i v as one on (u, v)."""
    if not pair:
        return matrix.real
    return np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])
