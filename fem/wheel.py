"""The whole wheel, sector by sector: the check on cyclic symmetry, and the way to sectors that differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, issparse, kron, vstack

from tribodyn.fem.cyclic import Sector, seam_parts
from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.system import SecondOrderSystem


def of_sector(name: str, n: int) -> str:
    """Name of a load or output of sector n in the wheel."""
    return f"{name}@{n}"


def sector_maps(sector: Sector) -> list[csr_matrix]:
    """P_n (n, n_wheel), one per sector: q_n = P_n q; q holds what each sector owns, in its frame, sector by sector."""
    own, following = seam_parts(sector)
    place = np.eye(sector.n_sectors)
    return [
        csr_matrix(kron(place[k : k + 1], own) + kron(np.roll(place, -1, axis=0)[k : k + 1], following))
        for k in range(sector.n_sectors)
    ]


def assemble(sector: Sector, stiffness: Sequence[float] | None = None) -> tuple[SecondOrderSystem, ContactInterface]:
    """All sectors of the wheel in one real system, with the contacts between all neighbours.

    stiffness : (N,) factor on the stiffness of each sector, 1 for all by default: stiffness mistuning
    Returns the system, dense where the sector's is, loads and outputs named "<name>@<sector>"; the interface: pairs of
        sector 0 against sector N - 1, then of sector 1 against 0, and so on, in the turned frames of each
    Raises  ValueError where there is not one positive factor per sector
    """
    n_sectors, system, half = sector.n_sectors, sector.system, sector.interface
    factors = np.ones(n_sectors) if stiffness is None else np.asarray(stiffness, dtype=float)
    if factors.shape != (n_sectors,) or not (factors > 0).all():
        raise ValueError(f"mistuning needs {n_sectors} positive stiffness factors, one per sector, not {factors.size}")
    maps = sector_maps(sector)

    def summed(matrix: Any, weights: np.ndarray) -> Any:
        total = sum(w * (P.T @ (matrix @ P)) for w, P in zip(weights, maps, strict=True))
        return csr_matrix(total) if issparse(total) else np.asarray(total)

    ones = np.ones(n_sectors)
    wheel = SecondOrderSystem(
        summed(system.mass, ones),
        summed(system.stiffness, factors),
        None if system.damping is None else summed(system.damping, ones),
        {of_sector(name, k): P.T @ load for name, load in system.loads.items() for k, P in enumerate(maps)},
        {of_sector(name, k): P.T @ row for name, row in system.outputs.items() for k, P in enumerate(maps)},
        None if system.gyroscopic is None else summed(system.gyroscopic, ones),
        None if system.circulatory is None else summed(system.circulatory, ones),
    )
    B = [half.B @ P - sector.left @ maps[k - 1] for k, P in enumerate(maps)]
    turns = [np.linalg.matrix_power(sector.turn, k) for k in range(n_sectors)]
    interface = replace(
        half,
        points=np.concatenate([half.points @ R.T for R in turns]),
        frames=np.concatenate([half.frames @ R.T for R in turns]),
        area=np.tile(half.area, n_sectors),
        gap=np.tile(half.gap, n_sectors),
        B=vstack(B, format="csr") if issparse(half.B) else np.concatenate(B),
        faces=np.concatenate([half.faces + k * half.n_pair for k in range(n_sectors)]),
    )
    return wheel, interface
