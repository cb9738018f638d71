"""Craig-Bampton of a sector: one small system from which the waves of every harmonic index follow.

One real reduction of the sector, with both shroud faces, both seams and the accessories as masters, serves all harmonic
indices: the phase constraints act on the small system. Where neighbours touch node to node and nothing touches inside
the sector, the contact then becomes a coordinate of its own, the relative displacement of neighbours (3.18), so that
its map is [I 0] for every index. With contacts inside the sector or of meshes that do not match, the masters stay the
coordinates, and the contact has a map of its own for every index (3.17).
Source  Tamatam 2021, eq. 3.12 to 3.22"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg as sla
from scipy.sparse import vstack

from tribodyn.fem.cyclic_symmetry import Sector, seam_map, wave_system
from tribodyn.fem.modes import modes, turning_frequencies
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.craig_bampton import craig_bampton
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.reduction.model import ReducedModel, ReductionBasis
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class ReducedSector:
    """sector : dense, in reduced coordinates; origin : these coordinates among the DOFs of the full sector;
    accuracy : as `ReducedModel.accuracy`."""

    sector: Sector
    origin: ReductionBasis
    accuracy: Mapping[str, float] = field(default_factory=dict)

    @property
    def model(self) -> ReducedModel:
        """The sector by itself, joined to nothing."""
        return ReducedModel(self.sector.system, self.sector.interface, self.origin, self.sector.joints)


def reduce_sector(sector: Sector, n_modes: int | None = None, cutoff: float | None = None) -> ReducedSector:
    """Reduce a full sector; n_modes or cutoff [Hz] as in `craig_bampton`.

    Raises  Refusal as `craig_bampton` does"""
    both_faces = replace(sector.interface, B=vstack([sector.interface.B, sector.left_map], format="csr"))
    seams = np.concatenate([sector.seam_right.ravel(), sector.seam_left.ravel()])
    model = craig_bampton(sector.system, both_faces, n_modes, cutoff, extra_masters=seams.tolist())
    assert isinstance(model.origin, ReductionBasis)
    return in_coordinates(sector, model.system, model.origin)


def in_coordinates(sector: Sector, system: SecondOrderSystem, origin: ReductionBasis) -> ReducedSector:
    """A full sector as the system it is in the coordinates of a reduction, its masters first."""
    small = replace(
        sector,
        system=system,
        interface=replace(sector.interface, B=np.asarray(sector.interface.B @ origin.basis)),
        left_map=np.asarray(sector.left_map @ origin.basis),
        seam_right=np.searchsorted(origin.masters, sector.seam_right),
        seam_left=np.searchsorted(origin.masters, sector.seam_left),
        prestress=None,
    )
    if sector.prestress is None:
        return ReducedSector(small, origin)
    static = sector.prestress
    return ReducedSector(small, origin, {"prestress_residual": static.residual, "prestress_rotation": static.rotation})


def nodal_diameters(
    sector: Sector, diameters: Sequence[int], n_modes: int, stiffness: np.ndarray | None = None
) -> np.ndarray:
    """Frequencies [Hz] of the wheel for each nodal diameter: the diagram of a bladed disk, full or reduced.

    diameters : harmonic indices; 0 to N/2 differ, and where Coriolis forces act those of waves that run against the
        rotation too, -1 to -N/2; stiffness : (n_pair, n_component) of closed, stuck contacts [N/m],
        None for open ones
    Returns (n_diameter, n_modes)"""
    frequencies = []
    for index in diameters:
        system, B = wave_system(sector, index)
        K = system.stiffness if stiffness is None else stuck_stiffness(system.stiffness, B, stiffness)
        frequencies.append(wave_frequencies(replace(system, stiffness=K), n_modes))
    return np.array(frequencies)


def wave_frequencies(system: SecondOrderSystem, n_modes: int) -> np.ndarray:
    """The n lowest frequencies (n,) [Hz] of the system of a wave, with its Coriolis forces if there are any."""
    K, M, G = system.stiffness, system.mass, system.gyroscopic
    return (modes(K, M, n_modes)[0] if G is None else turning_frequencies(K, M, G, n_modes)) / (2 * np.pi)


def distinct(sector: Sector) -> tuple[Sector, np.ndarray]:
    """The sector with each row of its contact once, where joints share nodes, and which of them each row was (n_c,)."""
    right, left_rows = np.asarray(sector.interface.B), np.asarray(sector.left_map)
    is_equal = (right @ right.T >= 1 - LIMITS.rounding) & (left_rows @ left_rows.T >= 1 - LIMITS.rounding)
    is_equal[np.arange(len(right)), np.arange(len(right))] = True
    first, of_row = np.unique(np.array([row.argmax() for row in is_equal], int), return_inverse=True)
    unique_rows = replace(sector, interface=replace(sector.interface, B=right[first]), left_map=left_rows[first])
    return unique_rows, of_row


def node_to_node(sector: Sector) -> bool:
    """Whether every contact, one at least, is one of the neighbours' nodes, each in one pair: for `relative_map`."""
    right, left_rows = np.asarray(sector.interface.B), np.asarray(sector.left_map)
    between = np.abs(left_rows).max(axis=1, initial=0.0) > 0
    return (
        bool(len(right) and between.all())
        and np.abs(right @ right.T - np.eye(len(right))).max(initial=0.0) <= LIMITS.rounding
    )


def relative_map(sector: Sector, index: int) -> tuple[np.ndarray, int]:
    """T (n, m) of a wave, q = T [x, y], and how many of these coordinates are contacts and accessories.

    x : (n_c,) relative displacement of neighbours; y : accessories, then the rest. With S the seam map, a = exp(i phi),
    B_r, B_l the halves of the contact behind S and N a basis of what moves no right face,
    q = S (B_r^H (x + a B_l N y) + N y), so that B_r z - a B_l z = x whatever y is
    Raises  Refusal where a right contact face is not made of masters, or shares nodes with a left one or a seam"""
    S = seam_map(sector, index)
    right, left_rows = sector.interface.B @ S, sector.left_map @ S
    faces = np.flatnonzero(np.abs(right).max(axis=0))
    if np.abs(right @ right.conj().T - np.eye(len(right))).max() > LIMITS.rounding or left_rows[:, faces].any():
        raise Refusal(
            "the right contact face of a cyclic part must be of master nodes that lie neither on its left contact face "
            "nor on a cyclic face"
        )
    vectors = (*sector.system.loads.values(), *sector.system.outputs.values())
    points = [np.flatnonzero(S.T @ v) for v in vectors if np.count_nonzero(v) <= LIMITS.point_load]
    accessories = np.setdiff1d(np.concatenate([*points, []]).astype(int), faces)
    internal = np.setdiff1d(np.arange(S.shape[1]), np.concatenate([faces, accessories]))
    remaining = np.concatenate([accessories, internal])
    within = sla.null_space(right[:, faces])  # tangential motion that a contact of fewer components leaves free
    N = np.zeros((S.shape[1], len(remaining) + within.shape[1]), dtype=right.dtype)
    N[remaining, np.arange(len(remaining))] = 1.0
    N[faces, len(remaining) :] = within
    follow = N + np.conj(sector.phase(index)) * right.conj().T @ (left_rows @ N)
    return S @ np.concatenate([right.conj().T, follow], axis=1), len(right) + len(accessories)


def stuck_ritz(system: SecondOrderSystem, B: np.ndarray, springs: np.ndarray, n_modes: int | None = None) -> np.ndarray:
    """Basis (n, m) of a dense system: modes with its contact stuck, and its static shapes under a unit force on every
    contact row, under every load and under every output.

    B : (n_contact, n) contact map; springs : (n_pair, n_component) [N/m]; n_modes : `LIMITS.ritz_modes` by default
    Statics are exact, and what is left out of the motion of the contact falls with the fourth power of the frequency
    over that of the first mode left out
    Raises  LinAlgError where the system can move with its contact stuck, or is unstable then
    Source  method of Rayleigh and Ritz; the shapes are those of `reduction.residual_flexibility`"""
    K = stuck_stiffness(system.stiffness, B, springs)
    K = (K + K.conj().T) / 2
    n, n_modes = len(K), LIMITS.ritz_modes if n_modes is None else n_modes
    factor = sla.cho_factor(K)
    nu, phi = sla.eigh(system.mass, K, subset_by_index=(max(n - n_modes, 0), n - 1))  # of unit energy
    forces = np.column_stack(
        [B.conj().T, *(v for v in system.loads.values()), *(np.conj(v) for v in system.outputs.values())]
    )
    shapes = sla.cho_solve(factor, forces)
    size = np.einsum("ij,ij->j", forces.conj(), shapes).real
    forces, shapes = (a[:, size > 0] / np.sqrt(size[size > 0]) for a in (forces, shapes))
    shapes = shapes - phi @ (phi.conj().T @ forces)
    energy, turn = sla.eigh(shapes.conj().T @ (K @ shapes))
    independent = energy > LIMITS.dependent
    return np.concatenate([phi / np.sqrt(nu), (shapes @ turn[:, independent]) / np.sqrt(energy[independent])], axis=1)
