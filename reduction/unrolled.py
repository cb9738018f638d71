"""Build a real model of several sectors from the complex model of one sector under a travelling wave.

Time integration needs the real model. A wave of engine order EO repeats itself after n = N / gcd(N, EO) sectors, so
that n sectors closed to a ring are enough. Only the harmonic indices (nodal diameters) 0, g, 2 g, ... occur in this
ring, g = gcd(N, EO). Its coordinates are the modes of these indices without contact: a complex mode gives a cosine
and a sine. Each index is decomposed by itself, so that no matrix of the size of the wheel is ever decomposed."""

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
    """Build the ring of sectors after which a travelling wave repeats itself: unit mass, diagonal stiffness.

    model : of the wave, see `wave_model.travelling_wave`, damped or not
    highest : angular frequency [rad/s]. Modes of the wheel without contact below it are retained. The modes above it
        are replaced by shapes with the same static compliance at the ports (contacts, loads and outputs), one per
        port at most, where this makes the model smaller
    Returns the model; contact rows sector by sector, loads and outputs "<name>@<sector>"
    """
    N, n = model.n_sectors, model.sectors_in_time
    step = N // n
    lam, ports, damping, gyroscopic, circulatory = [], [], [], [], []
    for index in range(0, N // 2 + 1, step):
        omega2, shapes, damping_block, gyroscopic_block, circulatory_block = _modes(*model.at_index(index), highest)
        is_pair = 0 < 2 * index < N
        lam.append(np.tile(omega2, 1 + is_pair))
        sector_shapes = np.stack([shapes * np.exp(-2j * np.pi * (index * k % N) / N) for k in range(n)])
        # real coordinates u, v: amplitude (u + i v) / sqrt(2) at this index, its conjugate at N - index
        cosine, sine = sector_shapes.real, -sector_shapes.imag
        real_shapes = np.sqrt(2) * np.concatenate([cosine, sine], axis=-1) if is_pair else cosine
        ports.append(real_shapes / np.sqrt(n))
        damping.append(_real_matrix(damping_block, is_pair))
        gyroscopic.append(_real_matrix(gyroscopic_block, is_pair))
        circulatory.append(_real_matrix(circulatory_block, is_pair))
    omega2, shapes = np.concatenate(lam), np.concatenate(ports, axis=2)  # (n_mode,), (n, n_port, n_mode)
    system, _ = model.at_index(0)
    n_contact, loads, outputs = model.interface.B.shape[0], list(system.loads), list(system.outputs)
    first_output = n_contact + len(loads)
    port_vectors = {
        kind: {sector_name(name, k): shapes[k, first + i] for k in range(n) for i, name in enumerate(names)}
        for kind, first, names in (("loads", n_contact, loads), ("outputs", first_output, outputs))
    }
    ring = SecondOrderSystem(
        np.eye(len(omega2)),
        np.diag(omega2),
        sla.block_diag(*damping) if system.damping is not None else None,
        port_vectors["loads"],
        port_vectors["outputs"],
        _block_diagonal(gyroscopic),
        _block_diagonal(circulatory),
    )
    interface = join([replace(model.interface, B=sector_rows[:n_contact]) for sector_rows in shapes])
    return ReducedModel(ring, interface)


def _modes(
    system: SecondOrderSystem, B: np.ndarray, highest: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Modes of one harmonic index without contact, those above `highest` replaced as in `unrolled`.

    B : (n_contact, n) contact map
    Returns squared frequencies (m,) [rad2/s2], mode shapes at the ports (n_port, m), and the modal matrices (m, m) of
        damping, Coriolis and circulatory forces, which are zero for the shapes that replace modes"""
    lam, phi = sla.eigh(np.asarray(system.stiffness), np.asarray(system.mass))
    loads = [np.conj(load)[None] for load in system.loads.values()]
    outputs = [np.asarray(row)[None] for row in system.outputs.values()]
    port_shapes = np.concatenate([np.asarray(B), *loads, *outputs]) @ phi
    n_retained = int(np.sum(lam < highest**2))
    if len(lam) - n_retained > len(port_shapes):
        residual_shapes = port_shapes[:, n_retained:] / np.sqrt(lam[n_retained:])
        compliances, shapes = sla.eigh(residual_shapes @ residual_shapes.conj().T)
        significant = compliances > LIMITS.negligible * compliances[-1]
        replaced_frequency = LIMITS.static_frequency * highest
        static_shapes = replaced_frequency * np.sqrt(compliances[significant]) * shapes[:, significant]
        port_shapes = np.concatenate([port_shapes[:, :n_retained], static_shapes], axis=1)
        lam = np.concatenate([lam[:n_retained], np.full(int(significant.sum()), replaced_frequency**2)])
        phi = phi[:, :n_retained]

    def modal(matrix: np.ndarray | None) -> np.ndarray:
        full = np.zeros((len(lam), len(lam)), port_shapes.dtype)
        if matrix is not None:
            full[: phi.shape[1], : phi.shape[1]] = phi.conj().T @ np.asarray(matrix) @ phi
        return full

    return lam, port_shapes, modal(system.damping), modal(system.gyroscopic), modal(system.circulatory)


def _block_diagonal(blocks: list[np.ndarray]) -> np.ndarray | None:
    """Block-diagonal matrix of the blocks of all indices; None if all are zero."""
    return sla.block_diag(*blocks) if any(block.any() for block in blocks) else None


def _real_matrix(matrix: np.ndarray, is_pair: bool) -> np.ndarray:
    """The matrix on complex amplitudes u + i v as a real matrix on (u, v); a single real index stays as it is."""
    if not is_pair:
        return matrix.real
    return np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])
