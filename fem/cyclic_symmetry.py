"""One sector of a cyclic part: which faces meet after a turn by one pitch, and what a travelling wave makes of it.

Every sector is described in its own turned frame. Sector n stands n pitches in the positive sense about the axis; its
left is the side of sector n + 1. In a wave of index j each sector repeats its right neighbour later,
q_n = q_0 exp(-i 2 pi j n / N), so that right faces touch the left ones of a sector that is ahead by one phase.
Source  Tamatam 2021, section 3.2.3, whose equation numbers stand as comments; Petrov 2004"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, issparse, kron, vstack

from tribodyn.fem.constraints import find_group
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.interface import ContactInterface, join, unit
from tribodyn.fem.matching import partners
from tribodyn.fem.part import Part
from tribodyn.fem.prestress import Prestress
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.geometry.placement import rotation
from tribodyn.refusal import Refusal

AXIS = (1.0, 0.0, 0.0)


@dataclass(frozen=True)
class Sector:
    """A sector cut out of its wheel, full or reduced: nothing is joined yet.

    system : n coordinates, real
    interface : its contacts; B (n_c, n) is what this sector moves, of a contact with the neighbour the right face
    left_map : (n_c, n) the half of the left face: relative displacement = B q_n - left_map q_(n-1); zero rows for a
        contact inside the sector or with the ground
    seam_right, seam_left : (k, 3) coordinates of matched nodes where sectors are joined, x, y, z; k = 0 for none
    turn : (3, 3) rotation by one pitch, from a sector to the one on its left
    n_sectors : sectors of the wheel; joints : joint -> its pairs
    prestress : of the full sector of a wheel that turns"""

    system: SecondOrderSystem
    interface: ContactInterface
    left_map: Any
    seam_right: np.ndarray
    seam_left: np.ndarray
    turn: np.ndarray
    n_sectors: int
    joints: Mapping[str, slice] = field(default_factory=dict)
    prestress: Prestress | None = None

    def phase(self, index: int) -> complex:
        """exp(-i 2 pi j / N), real to the last bit where it is."""
        return phase(index, self.n_sectors)


def phase(index: int, n_sectors: int) -> complex:
    """exp(-i 2 pi index / n_sectors) as a float where it is 1 or -1."""
    index = index % n_sectors
    if 2 * index % n_sectors == 0:
        return -1.0 if index else 1.0
    return complex(np.exp(-2j * np.pi * index / n_sectors))


def with_neighbours(
    contacts: Sequence[ContactFaces], n_sectors: int, axis: Sequence[float] = AXIS
) -> list[ContactFaces]:
    """Contacts of a sector, face on its right, with the opposite faces of its neighbours on the left, which each meets
    after a turn by one pitch about the axis; raises Refusal as `cut_sector` does."""
    if n_sectors < 2:
        raise Refusal(f"a wheel of {n_sectors} sectors has no neighbours; give at least 2")
    missing = [contact.face for contact in contacts if contact.opposite is None]
    if missing:
        raise Refusal(f"contact '{missing[0]}' of a cyclic part needs the opposite face, which lies on the next sector")
    turn = rotation(unit(axis, "the axis of rotation"), 2 * np.pi / n_sectors)
    return [replace(contact, turn=turn) for contact in contacts]


def cut_sector(
    part: Part,
    contacts: Sequence[ContactFaces],
    n_sectors: int,
    seam: tuple[str, str] | None = None,
    axis: Sequence[float] = AXIS,
) -> Sector:
    """The sector that a part is.

    contacts : those that the part was built with; the ones of `turned` meet the neighbour, the others stay inside
    seam : names of the right and the left face where sectors are one piece, None where only contacts couple them
    axis : of the wheel, through the origin
    Raises  Refusal where faces do not match after the turn, a seam is held on one side only, or a contact has no
        opposite face"""
    if n_sectors < 2:
        raise Refusal(f"a wheel of {n_sectors} sectors has no neighbours; give at least 2")
    turn = rotation(unit(axis, "the axis of rotation"), 2 * np.pi / n_sectors)
    left_map = part.rows(_left_halves(part, contacts))
    none = np.empty((0, 3), dtype=int)
    seams = (none, none) if seam is None else _seams(part, seam, turn)
    return Sector(part.system, part.interface, left_map, *seams, turn, n_sectors, part.joints)


def _left_halves(part: Part, contacts: Sequence[ContactFaces]) -> csr_matrix:
    """The halves of the left faces (n_c, n_dof) over all DOFs of the mesh; zero for contacts inside the sector."""
    n_component, n_dof = len(part.interface.components), 3 * len(part.points)
    halves = [csr_matrix((0, n_dof))]
    for contact, pairs in zip(contacts, part.pairs.values(), strict=True):
        inside = csr_matrix(((pairs.stop - pairs.start) * n_component, n_dof))
        halves.append(inside if contact.turn is None else contact.halves(part.mesh)[1])
    return csr_matrix(vstack(halves))


def _seams(part: Part, seam: tuple[str, str], turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Free DOFs (k, 3) of the right seam and of its partners on the left."""
    right_nodes, left_nodes = (find_group(part.node_sets, name) for name in seam)
    label = f"the cyclic faces '{seam[0]}' and '{seam[1]}'"
    if len(right_nodes) != len(left_nodes):
        raise Refusal(f"{label} have {len(right_nodes)} and {len(left_nodes)} nodes; mesh both with the same grid")
    left_nodes = left_nodes[partners(part.points[right_nodes] @ turn.T, part.points[left_nodes], label)]
    place = np.full(3 * len(part.points), -1)
    place[part.free] = np.arange(len(part.free))
    dofs = [place[nodes[:, None] * 3 + np.arange(3)] for nodes in (right_nodes, left_nodes)]
    free = [(d >= 0) for d in dofs]
    is_uniform = free[0].all(axis=1) | ~free[0].any(axis=1)
    if not is_uniform.all() or (free[0] != free[1]).any():
        raise Refusal(f"{label} are held unequally; clamp nodes on both of them, in all axes")
    if np.intersect1d(dofs[0][free[0]], dofs[1][free[1]]).size:
        raise Refusal(f"{label} share nodes; a sector cannot reach the axis of the wheel")
    is_free = free[0][:, 0]
    return dofs[0][is_free], dofs[1][is_free]


def seam_parts(sector: Sector) -> tuple[csr_matrix, csr_matrix]:
    """Maps (n, m) of q_n = base z_n + next z_(n+1); sector n + 1 owns the seam that both share."""
    n, shape = sector.system.n_dof, (len(sector.seam_left), 3, 3)
    independent = np.setdiff1d(np.arange(n), sector.seam_left)
    place = np.full(n, -1)
    place[independent] = np.arange(len(independent))
    base = csr_matrix((np.ones(len(independent)), (independent, place[independent])), shape=(n, len(independent)))
    rows = np.broadcast_to(sector.seam_left[:, :, None], shape).ravel()
    columns = place[np.broadcast_to(sector.seam_right[:, None, :], shape)].ravel()
    turn = np.broadcast_to(sector.turn, shape).ravel()
    return base, csr_matrix((turn, (rows, columns)), shape=base.shape)


def seam_map(sector: Sector, index: int) -> csr_matrix:
    """T (n, m) of a wave: the left seam follows the right one, u_left = exp(-i phi) R u_right, q = T z."""
    base, next_sector = seam_parts(sector)
    return base + sector.phase(index) * next_sector  # 3.12, 3.15


def wave_system(sector: Sector, index: int) -> tuple[SecondOrderSystem, Any]:
    """The system and the contact map (n_c, m) that a wave of this index sees; Hermitian, real for 0 and N/2."""
    T = seam_map(sector, index)
    ahead = np.conj(sector.phase(index))
    return sector.system.projected(T), (sector.interface.B - ahead * sector.left_map) @ T  # 3.17


def sector_name(name: str, n: int) -> str:
    """Name of a load or output of sector n in the wheel."""
    return f"{name}@{n}"


def sector_maps(sector: Sector) -> list[csr_matrix]:
    """P_n (n, n_wheel), one per sector: q_n = P_n q; q holds what each sector owns, in its frame, sector by sector."""
    base, next_sector = seam_parts(sector)
    place = np.eye(sector.n_sectors)
    return [
        csr_matrix(kron(place[k : k + 1], base) + kron(np.roll(place, -1, axis=0)[k : k + 1], next_sector))
        for k in range(sector.n_sectors)
    ]


def assemble_wheel(
    sector: Sector, stiffness: Sequence[float] | None = None, elastic: Any = None
) -> tuple[SecondOrderSystem, ContactInterface]:
    """All sectors of the wheel in one real system, with the contacts between all neighbours.

    stiffness : (N,) factor on the stiffness of each sector, 1 for all by default: stiffness mistuning
    elastic : (n, n) the part of the sector's stiffness that the factors act on, all of it by default [N/m]
    Returns the system, dense where the sector's is, loads and outputs named "<name>@<sector>"; the interface: pairs of
        sector 0 against sector N - 1, then of sector 1 against 0, and so on, in the turned frames of each
    Raises  Refusal where there is not one positive factor per sector"""
    n_sectors, system, half = sector.n_sectors, sector.system, sector.interface
    factors = np.ones(n_sectors) if stiffness is None else np.asarray(stiffness, dtype=float)
    if factors.shape != (n_sectors,) or not (factors > 0).all():
        raise Refusal(f"mistuning needs {n_sectors} positive stiffness factors, one per sector, not {factors.size}")
    maps = sector_maps(sector)

    def summed(matrix: Any, weights: np.ndarray) -> Any:
        total = sum(w * (P.T @ (matrix @ P)) for w, P in zip(weights, maps, strict=True))
        return csr_matrix(total) if issparse(total) else np.asarray(total)

    ones = np.ones(n_sectors)
    deviation = None if elastic is None else summed(elastic, factors - 1)
    wheel = SecondOrderSystem(
        summed(system.mass, ones),
        summed(system.stiffness, factors) if elastic is None else summed(system.stiffness, ones) + deviation,
        None if system.damping is None else summed(system.damping, ones),
        {sector_name(name, k): P.T @ load for name, load in system.loads.items() for k, P in enumerate(maps)},
        {sector_name(name, k): P.T @ row for name, row in system.outputs.items() for k, P in enumerate(maps)},
        None if system.gyroscopic is None else summed(system.gyroscopic, ones),
        None if system.circulatory is None else summed(system.circulatory, ones),
    )
    contacts = []
    for k, P in enumerate(maps):
        back, B = np.linalg.matrix_power(sector.turn, k).T, half.B @ P - sector.left_map @ maps[k - 1]
        contacts.append(replace(half, points=half.points @ back, frames=half.frames @ back, B=B))
    return wheel, join(contacts)
