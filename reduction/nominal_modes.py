"""Stiffness of a sector on a few shapes: what differs from blade to blade, at the cost of as many coordinates.

A sector whose stiffness K is a factor 1 + d away moves nearly in the modes that the wheel of sectors alike has there,
of all nodal diameters (nominal modes), and in the static shapes of its loads. With Phi a K-orthonormal basis of these,
d K is taken as d K Phi Phi^H K, which has the rank of Phi, is the same on all that Phi spans, and is d K itself where
Phi spans everything.
Source  nominal modes: Yang and Griffin 2001, A reduced-order model of mistuning using a subset of nominal system modes
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.cyclic_symmetry import seam_map, wave_system
from tribodyn.fem.modes import modes
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.reduction.sector_reduction import ReducedSector

PORT = "mistuning"


def port_name(k: int) -> str:
    """Name of the output that row k of the deviating stiffness makes of a sector."""
    return f"{PORT} {k}"


def nominal_shapes(
    reduced: ReducedSector, springs: np.ndarray, stiffness: np.ndarray, families: int, loads: Sequence[str],
    left_out: float,
) -> np.ndarray:  # fmt: skip
    """K-orthonormal shapes (n, r) of a sector in which the wheel of sectors alike moves, contacts stuck or nearly free.

    springs : (n_pair, n_component) of closed, stuck contacts [N/m]; stiffness : (n, n) the part K that deviates [N/m]
    families : modes of every nodal diameter; loads : those whose static shapes are added, of every nodal diameter
    left_out : strain energy of a shape beside the others, over the largest, below which it is one of them"""
    sector, columns = reduced.sector, []
    for index in range(sector.n_sectors // 2 + 1):
        system, B = wave_system(sector, index)
        forces = np.array([system.loads[name] for name in loads]).reshape(len(loads), -1).T
        for share in (1.0, LIMITS.nearly_free):
            K = np.asarray(stuck_stiffness(system.stiffness, np.asarray(B), share * springs))
            phi = modes(K, system.mass, min(families, len(K)))[1]
            static = sla.solve(K, forces, assume_a="her")
            displacement = seam_map(sector, index) @ np.concatenate([phi, static], axis=1)
            columns += [displacement.real, displacement.imag]
    return orthonormal(stiffness, np.concatenate(columns, axis=1), left_out)


def orthonormal(stiffness: np.ndarray, shapes: np.ndarray, left_out: float) -> np.ndarray:
    """A K-orthonormal basis (n, r) of shapes (n, m), without those that K does not resist or that others make."""
    size = np.linalg.norm(shapes, axis=0)
    shapes = shapes[:, size > 0] / size[size > 0]
    energy = np.einsum("ij,ij->j", shapes, stiffness @ shapes)
    resisted = energy > 0
    shapes = shapes[:, resisted] / np.sqrt(energy[resisted])
    share, turn = np.linalg.eigh(shapes.T @ stiffness @ shapes)
    independent = share > left_out * share[-1]
    basis: np.ndarray = (shapes @ turn[:, independent] / np.sqrt(share[independent]))[:, ::-1]
    return basis


def with_ports(reduced: ReducedSector, stiffness: np.ndarray, shapes: np.ndarray) -> ReducedSector:
    """The sector with the rows P = Phi^H K as further outputs: d P^H P is the deviation of its stiffness."""
    system = reduced.sector.system
    rows = {port_name(k): row for k, row in enumerate(shapes.T @ stiffness)}
    system = replace(system, outputs={**system.outputs, **rows})
    return replace(reduced, sector=replace(reduced.sector, system=system))
