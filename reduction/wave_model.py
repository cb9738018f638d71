"""Models of a wheel: travelling waves by harmonic index, or all sectors at once; see `sector_reduction`."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import gcd
from typing import ClassVar, Self

import numpy as np

from tribodyn.fem import cyclic_symmetry
from tribodyn.fem.cyclic_symmetry import seam_map, wave_system
from tribodyn.fem.modes import StaticDivergence, modes
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.model import ReducedModel, SystemChange
from tribodyn.reduction.sector_reduction import ReducedSector, distinct, node_to_node, relative_map, stuck_ritz

IndexSystem = tuple[SecondOrderSystem, np.ndarray, np.ndarray]
"""Small system, contact map and way back T (q = T z) of a harmonic index."""
WaveIndex = Callable[[int], IndexSystem]
"""Computes those of an index from 0 to N - 1."""
IndexChange = Callable[[int, SecondOrderSystem, np.ndarray], SecondOrderSystem]
"""Replaces the system of an index, given its contact map (n_contact, n)."""


@dataclass(frozen=True)
class Crossing:
    """An engine order that meets a family of modes of a nodal diameter, at a speed and the frequency there [Hz]."""

    engine_order: int
    diameter: int
    family: int
    speed: float
    frequency: float


Crossings = Mapping[str, Sequence[Crossing]]
"""By the state of the contact."""


def diameter_of(engine_order: int, n_sectors: int) -> int:
    """The nodal diameter that an engine order excites on a wheel of identical sectors."""
    return abs(harmonic_index(engine_order, n_sectors))


def harmonic_index(engine_order: int, n_sectors: int) -> int:
    """The index, from above -N/2 to N/2, of the wave of an engine order above 0 with the rotation."""
    index = engine_order % n_sectors
    return index if 2 * index <= n_sectors else index - n_sectors


@dataclass(frozen=True)
class WaveModel(ReducedModel):
    """One sector under a travelling wave: harmonic h sees the index h EO modulo N.

    `system` and `interface` are those of harmonic 1; matrices are complex Hermitian, real for the indices 0 and N/2
    reduced : the sector; index_of : small system, contact map and way back of every harmonic index"""

    reduced: ReducedSector = field(kw_only=True)
    engine_order: int = field(kw_only=True)
    index_of: WaveIndex = field(kw_only=True)

    @property
    def n_sectors(self) -> int:
        """Sectors of the wheel."""
        return self.reduced.sector.n_sectors

    has_one_system: ClassVar[bool] = False
    has_motion_in_time: ClassVar[bool] = False
    is_wave: ClassVar[bool] = True

    @property
    def sectors_in_time(self) -> int:
        """Sectors after which the wave repeats itself."""
        return self.n_sectors // gcd(self.n_sectors, self.engine_order)

    def at_index(self, index: int) -> tuple[SecondOrderSystem, np.ndarray]:
        """System and contact map of any wave of the wheel; those of index -j are the conjugates of those of j."""
        return self.index_of(index % self.n_sectors)[:2]

    def at_harmonic(self, h: int) -> tuple[SecondOrderSystem, np.ndarray]:
        return self.at_index(h * self.engine_order)

    def shared_systems(self, harmonics: Sequence[int]) -> list[tuple[list[int], list[int]]]:
        """Positions of the harmonics that share an index, and of those that have the opposite one."""
        sharing: dict[int, tuple[list[int], list[int]]] = {}
        first: dict[int, int] = {}
        for position, h in enumerate(harmonics):
            index = h * self.engine_order % self.n_sectors
            key = min(index, self.n_sectors - index)
            sharing.setdefault(key, ([], []))[first.setdefault(key, index) != index].append(position)
        return list(sharing.values())

    def matches(self, other: ReducedModel, harmonics: Sequence[int]) -> bool:
        """Whether another wave has equal matrices and the same indices."""
        return (
            isinstance(other, WaveModel)
            and (self.engine_order, self.n_sectors) == (other.engine_order, other.n_sectors)
            and super().matches(other, harmonics)
        )

    def accuracy(self) -> dict[str, float]:
        """Of the stress of a wheel that turns."""
        return dict(self.reduced.accuracy)

    def reconstruct(self, q: np.ndarray, h: int = 1) -> np.ndarray:
        sector = self.index_of(h * self.engine_order % self.n_sectors)[2] @ q
        basis = self.reduced.origin.basis
        return basis @ sector.real + 1j * (basis @ sector.imag)

    def with_systems(self, change: SystemChange) -> Self:
        return self.with_index_systems(lambda _, system, B: change(system, B))

    def with_index_systems(self, change: IndexChange) -> Self:
        """The same with a change that depends on the index."""
        index_of = ChangedIndices(self.index_of, change)
        system, _, _ = index_of(self.engine_order % self.n_sectors)
        return replace(self, system=system, index_of=index_of)


def as_wave(model: ReducedModel) -> WaveModel:
    """The model itself, which must be a travelling wave."""
    if not isinstance(model, WaveModel):
        raise TypeError(f"a travelling wave of a wheel is needed, not a {type(model).__name__}")
    return model


def wave_model(reduced: ReducedSector, engine_order: int, index_of: WaveIndex) -> WaveModel:
    """The model of a wave from the small system, contact map and way back of every harmonic index."""
    system, B, _ = index_of(engine_order % reduced.sector.n_sectors)
    return WaveModel(
        system,
        replace(reduced.sector.interface, B=B),
        reduced.origin,
        reduced.sector.joints,
        reduced=reduced,
        engine_order=engine_order,
        index_of=index_of,
    )


def travelling_wave(reduced: ReducedSector, engine_order: int, springs: np.ndarray | None = None) -> WaveModel:
    """The model of one sector under a wave of this engine order.

    springs : (n_pair, n_component) contact springs [N/m]. If given, more than `LIMITS.many_coordinates` coordinates are
        replaced by those of `stuck_ritz`
    Its coordinates, but for those of `stuck_ritz`, are the relative displacements, then accessories, then the rest"""
    model = wave_model(reduced, engine_order, WaveIndices(reduced, springs))
    system = model.system
    try:
        omega, _ = modes(system.stiffness, system.mass, min(LIMITS.reported_modes, system.n_dof))
    except StaticDivergence:  # rotation carries away what only the contact holds
        return model
    return replace(model, free_frequency=omega / (2 * np.pi))


def wheel_model(
    reduced: ReducedSector, stiffness: Sequence[float] | None = None, elastic: np.ndarray | None = None
) -> ReducedModel:
    """All sectors at once, real and with contacts between all neighbours; stiffness, elastic as in `assemble_wheel`.

    Loads and outputs are named "<name>@<sector>". Sector n moves by
    reduced.origin.basis @ (fem.cyclic_symmetry.sector_maps(reduced.sector)[n] @ q) in its own frame"""
    system, interface = cyclic_symmetry.assemble_wheel(reduced.sector, stiffness, elastic)
    return ReducedModel(system, interface, joints=reduced.sector.joints)


class WaveIndices:
    """Small system, contact map and way back T (q = T z) of each harmonic index, each made once."""

    def __init__(self, reduced: ReducedSector, springs: np.ndarray | None = None):
        self._sector = reduced.sector
        self._springs = springs
        self._cache: dict[int, IndexSystem] = {}

    def __call__(self, index: int) -> IndexSystem:
        if index not in self._cache:
            self._cache[index] = self._small(*self._unreduced(index))
        return self._cache[index]

    def _unreduced(self, index: int) -> IndexSystem:
        """The same with all coordinates of the sector."""
        once, of_row = distinct(self._sector)
        if not node_to_node(once):
            return *wave_system(self._sector, index), seam_map(self._sector, index).toarray()
        T = relative_map(once, index)[0]
        system = self._sector.system.projected(T)
        return system, np.eye(len(once.left_map), system.n_dof)[of_row], T

    def _small(self, system: SecondOrderSystem, B: np.ndarray, T: np.ndarray) -> IndexSystem:
        """The same in fewer coordinates where there are many."""
        if self._springs is None or system.n_dof <= LIMITS.many_coordinates:
            return system, B, T
        try:
            V = stuck_ritz(system, B, self._springs)
        except np.linalg.LinAlgError:  # it can move with its contacts stuck, which the compliance reports
            return system, B, T
        return system.projected(V), B @ V, T @ V


@dataclass(frozen=True, eq=False)
class ChangedIndices:
    """Those of another `index_of` with each system replaced, each computed once."""

    index_of: WaveIndex
    change: IndexChange
    cache: dict[int, IndexSystem] = field(default_factory=dict)

    def __call__(self, index: int) -> IndexSystem:
        if index not in self.cache:
            system, B, T = self.index_of(index)
            self.cache[index] = self.change(index, system, B), B, T
        return self.cache[index]
