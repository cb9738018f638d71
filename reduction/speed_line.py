"""A sector along a range of speeds: reduced at a few of them in the same coordinates, interpolated between these.

Mass and Coriolis matrix over the speed are the same at all speeds and spin softening goes with the square of it, so
that what is interpolated, in polynomials of the squared speed, is the stress of the contact as it settles alone.
Source  method of Rayleigh and Ritz; Lagrange"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, ClassVar, Self

import numpy as np
import scipy.linalg as sla
from scipy.sparse import csr_matrix

from tribodyn.fem.cyclic_symmetry import Sector, seam_map, wave_system
from tribodyn.fem.modes import StaticDivergence, modes
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.reduction.model import Damping, ReducedModel, ReductionBasis
from tribodyn.reduction.sector_reduction import (
    ReducedSector,
    in_coordinates,
    reduce_sector,
    stuck_ritz,
    wave_frequencies,
)
from tribodyn.reduction.wave_model import IndexSystem, WaveIndices, WaveModel, wave_model


def reduce_alike(sectors: Sequence[Sector], n_modes: int | None, cutoff: float | None) -> ReducedSector:
    """The first of sectors of one mesh that differ in stiffness, as `reduce_sector`, in coordinates of them all.

    Masters stay; all fixed-interface modes, static shapes, and what the constraint modes differ by share one basis"""
    reduced = [reduce_sector(sector, n_modes, cutoff) for sector in sectors]
    first, bases = reduced[0], [sector.origin.basis for sector in reduced]
    m, energy = len(first.origin.masters), np.diag(first.sector.system.stiffness)
    columns = [
        basis[:, m:] / np.sqrt(np.diag(sector.sector.system.stiffness)[m:])
        for basis, sector in zip(bases, reduced, strict=True)
    ]
    columns += [(basis[:, :m] - bases[0][:, :m]) / np.sqrt(energy[:m]) for basis in bases[1:]]
    internal = independent(np.concatenate(columns, axis=1), sectors[0].system.stiffness)
    basis = np.concatenate([bases[0][:, :m], internal], axis=1)
    origin: ReductionBasis = replace(first.origin, basis=basis, n_modes=internal.shape[1])
    return in_coordinates(sectors[0], sectors[0].system.projected(basis), origin)


def congruent(K: Any, T: np.ndarray) -> np.ndarray:
    """T^H K T (m, m) of a stiffness K (n, n), sparse or dense, in coordinates T (n, m)."""
    small = T.conj().T @ (K @ T)
    return np.asarray((small + small.conj().T) / 2)


def independent(columns: np.ndarray, stiffness: Any) -> np.ndarray:
    """Shapes (n, k) of unit energy that span columns (n, m), but for the share `LIMITS.dependent` of unit energy."""
    energy, turn = sla.eigh(columns.conj().T @ (stiffness @ columns))
    retained = energy > LIMITS.dependent
    return np.asarray((columns @ turn[:, retained]) / np.sqrt(energy[retained]))


Systems = tuple[tuple[SecondOrderSystem, ...], np.ndarray, np.ndarray]
"""Systems of an index at all speeds of a line, contact map and way back."""


@dataclass(frozen=True, eq=False)
class SpeedLine:
    """A wave of an engine order whose frequency is that order times the speed: frequency [rad/s] -> its model.

    reduced : at the first of `speeds` [Hz], above 0, in coordinates for all; stiffness : (n, n) there, at each
    load : name of the one that goes with the square of the speed, which stands for `nominal` [Hz]
    springs : (n_pair, n_component) contact springs [N/m]
    damping : makes that of the systems at `speeds`"""

    reduced: ReducedSector
    stiffness: tuple[np.ndarray, ...]
    speeds: tuple[float, ...]
    engine_order: int
    load: str
    nominal: float
    springs: np.ndarray
    cache: dict[int, Systems] = field(default_factory=dict)
    damping: Damping | None = None

    def __call__(self, omega: float) -> WaveModel:
        """The model at the speed that belongs to a frequency [rad/s]."""
        return wave_model(self.reduced, self.engine_order, AtSpeed(self, self.between, self.speed(omega)))

    def slope(self, omega: float) -> WaveModel:
        """Matrices, loads and outputs of the model by the frequency [rad/s]."""
        return wave_model(self.reduced, self.engine_order, AtSpeed(self, self.by_frequency, self.speed(omega)))

    def damped(self, make: Damping) -> SpeedLine:
        """The same with another damping."""
        cache = {index: _damped(systems, make) for index, systems in self.cache.items()}
        return replace(self, cache=cache, damping=make)

    def speed(self, omega: float) -> float:
        """The speed [Hz] whose engine order has a frequency [rad/s]."""
        return omega / (2 * np.pi * abs(self.engine_order))

    def between(self, systems: Sequence[SecondOrderSystem], speed: float) -> SecondOrderSystem:
        """The system at a speed from those at `speeds`."""
        squares, first = np.square(self.speeds), systems[0]
        parts = [(speed**2 - np.delete(squares, i)) / (s - np.delete(squares, i)) for i, s in enumerate(squares)]
        return replace(
            first,
            **_summed([float(np.prod(part)) for part in parts], systems),
            gyroscopic=None if first.gyroscopic is None else speed / self.speeds[0] * first.gyroscopic,
            loads={**first.loads, self.load: (speed / self.nominal) ** 2 * first.loads[self.load]},
        )

    def by_frequency(self, systems: Sequence[SecondOrderSystem], speed: float) -> SecondOrderSystem:
        """What `between` gives, differentiated by the frequency [rad/s]."""
        squares, first, each = np.square(self.speeds), systems[0], self.speed(1.0)
        weights = []
        for i, s in enumerate(squares):
            distances = s - np.delete(squares, i)
            part = (speed**2 - np.delete(squares, i)) / distances
            weights.append(
                2 * speed * each * sum(np.prod(np.delete(part, j)) / distances[j] for j in range(len(distances)))
            )
        return replace(
            first,
            mass=np.zeros_like(first.mass),
            **_summed(weights, systems),
            gyroscopic=None if first.gyroscopic is None else each / self.speeds[0] * first.gyroscopic,
            loads={
                name: 2 * speed * each / self.nominal**2 * v * (name == self.load) for name, v in first.loads.items()
            },
            outputs={name: np.zeros_like(v) for name, v in first.outputs.items()},
        )

    def at_index(self, index: int) -> Systems:
        """Systems at all speeds, contact map and way back of a harmonic index, in few coordinates."""
        if index not in self.cache:
            first, B, T = WaveIndices(self.reduced)(index)
            if first.n_dof > LIMITS.many_on_line:
                ends = first, replace(first, stiffness=congruent(self.stiffness[-1], T))
                shapes = [stuck_ritz(end, B, self.springs, LIMITS.modes_on_line) for end in ends]
                V = independent(np.concatenate(shapes, axis=1), stuck_stiffness(first.stiffness, B, self.springs))
                first, B, T = first.projected(V), B @ V, T @ V
            systems = first, *(replace(first, stiffness=congruent(K, T)) for K in self.stiffness[1:])
            self.cache[index] = (systems, B, T) if self.damping is None else _damped((systems, B, T), self.damping)
        return self.cache[index]

    def wave(self, index: int, families: int, stuck: bool) -> Callable[..., np.ndarray]:
        """Frequencies (families,) [Hz] of a harmonic index, contact open or stuck, by the speed [Hz]; of the opposite
        index where a second argument says so.

        By Rayleigh and Ritz in the modes at the first of `speeds` and in what the stiffness at the others and Coriolis
        forces change of these to first order, all by one factor
        Raises  StaticDivergence where the contact is open and rotation carries away what only it holds"""
        sector = self.reduced.sector
        first, B = wave_system(sector, index)
        T, springs = seam_map(sector, index), self.springs if stuck else 0 * self.springs
        systems = [
            replace(first, stiffness=stuck_stiffness(congruent(K, T), np.asarray(B), springs)) for K in self.stiffness
        ]
        K, M, G = systems[0].stiffness, first.mass, first.gyroscopic
        try:
            factor = sla.cho_factor(K)
        except sla.LinAlgError:
            raise StaticDivergence("rotation carries away what only the contact holds") from None
        solver: Any = SimpleNamespace(solve=lambda force: sla.cho_solve(factor, force, check_finite=False))
        n_modes = min(2 * families + LIMITS.reported_modes, len(K))
        _, phi = modes(csr_matrix(K), csr_matrix(M), n_modes, factor=solver)
        forces = [(system.stiffness - K) @ phi for system in systems[1:]] + ([] if G is None else [G @ phi])
        shapes = np.concatenate([phi, solver.solve(np.concatenate(forces, axis=1))], axis=1)
        size = np.sqrt(np.einsum("ij,ij->j", shapes.conj(), M @ shapes).real)
        V = independent(shapes[:, size > 0] / size[size > 0], M)
        small = [system.projected(V) for system in systems]

        def frequencies(speed: float, is_opposite: bool = False) -> np.ndarray:
            system = self.between(small, speed)
            if is_opposite and system.gyroscopic is not None:
                system = replace(system, gyroscopic=-system.gyroscopic)
            return wave_frequencies(system, families)

        return frequencies

    def error(self, speed: float, exact: np.ndarray, n_modes: int = 6) -> float:
        """Largest relative error of the lowest frequencies of the stuck wave that interpolation makes at a speed.

        exact : (n, n) stiffness at this speed"""

        def wave(stiffness: np.ndarray) -> tuple[SecondOrderSystem, np.ndarray]:
            sector = self.reduced.sector
            return wave_system(replace(sector, system=replace(sector.system, stiffness=stiffness)), self.engine_order)

        system, B = wave(exact)
        omega, phi = modes(stuck_stiffness(system.stiffness, B, self.springs), system.mass, n_modes)
        sectors = [replace(self.reduced.sector.system, stiffness=K) for K in self.stiffness]
        difference, _ = wave(self.between(sectors, speed).stiffness - exact)
        return float(np.abs(np.einsum("ij,ij->j", phi.conj(), difference.stiffness @ phi) / (2 * omega**2)).max())


@dataclass(frozen=True)
class SpeedLineModel(WaveModel):
    """The wave at one speed of a line, which knows the models of the others.

    line_error : largest relative error of the lowest stuck frequencies that interpolation causes"""

    line: SpeedLine = field(kw_only=True)
    line_error: float = field(kw_only=True)

    follows_frequency: ClassVar[bool] = True

    def at_frequency(self, omega: float) -> WaveModel:
        return self.line(omega)

    def matches(self, other: ReducedModel, harmonics: Sequence[int]) -> bool:
        """No: the systems of one speed do not tell."""
        return False

    def accuracy(self) -> dict[str, float]:
        """Of the stress at the speeds of the line, and between them."""
        return {**super().accuracy(), "line_error": self.line_error}

    def with_damping(self, make: Damping) -> Self:
        """The same with another damping at every speed."""
        damped = self.with_systems(lambda system, B: replace(system, damping=make(system, B)))
        return replace(self, system=damped.system, index_of=damped.index_of, line=self.line.damped(make))


def _damped(systems_of_index: Systems, make: Damping) -> Systems:
    systems, B, T = systems_of_index
    return tuple(replace(system, damping=make(system, B)) for system in systems), B, T


def _summed(weights: Sequence[float], systems: Sequence[SecondOrderSystem]) -> dict[str, Any]:
    """Weighted sums of the matrices that change along a line."""
    names = ("stiffness",) if systems[0].damping is None else ("stiffness", "damping")
    return {
        name: np.sum([w * getattr(s, name) for w, s in zip(weights, systems, strict=True)], axis=0) for name in names
    }


@dataclass(frozen=True, eq=False)
class AtSpeed:
    """System, contact map and way back of each harmonic index at one speed [Hz].

    of : computes the system at this speed from the systems at all speeds of the line, see `SpeedLine.between`"""

    line: SpeedLine
    of: Callable[[Sequence[SecondOrderSystem], float], SecondOrderSystem]
    speed: float
    cache: dict[int, IndexSystem] = field(default_factory=dict)

    def __call__(self, index: int) -> IndexSystem:
        if index not in self.cache:
            systems, B, T = self.line.at_index(index)
            self.cache[index] = self.of(systems, self.speed), B, T
        return self.cache[index]
