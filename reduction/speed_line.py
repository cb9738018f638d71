"""A sector along a range of speeds: reduced at a few of them in the same coordinates, interpolated between these.

Mass and Coriolis matrix over the speed are the same at all speeds and spin softening goes with the square of it, so
that what is interpolated, in polynomials of the squared speed, is the stress of the contact as it settles alone.
Source  method of Rayleigh and Ritz; Lagrange
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.cyclic import Sector, at_index
from tribodyn.fem.modes import modes
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.cyclic import ReducedSector, WaveIndices, in_coordinates, reduce_sector, stuck_ritz, wave_of
from tribodyn.reduction.limits import LIMITS
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.reduction.model import Damping, ReducedModel


def reduce_alike(
    sectors: Sequence[Sector], n_modes: int | None, cutoff: float | None, attached: Sequence[str] = ()
) -> list[ReducedSector]:
    """Sectors of one mesh that differ in stiffness and Coriolis forces, as `reduce_sector`, in the same coordinates.

    Masters stay; all fixed-interface modes, and what the constraint modes differ by, share one basis of the rest
    """
    alone = [reduce_sector(sector, n_modes, cutoff, attached) for sector in sectors]
    first = alone[0]
    m, energy = len(first.info.master_dofs), np.diag(first.sector.system.stiffness)
    columns = [one.basis[:, m:] / np.sqrt(np.diag(one.sector.system.stiffness)[m:]) for one in alone]
    columns += [(one.basis[:, :m] - first.basis[:, :m]) / np.sqrt(energy[:m]) for one in alone[1:]]
    own = independent(np.concatenate(columns, axis=1), sectors[0].system.stiffness)
    basis = np.concatenate([first.basis[:, :m], own], axis=1)
    info = replace(first.info, n_modes=own.shape[1])
    return [in_coordinates(sector, sector.system.projected(basis), basis, info) for sector in sectors]


def independent(columns: np.ndarray, stiffness: Any) -> np.ndarray:
    """Shapes (n, k) of unit energy that span columns (n, m), but for the share `LIMITS.dependent` of unit energy."""
    energy, turn = sla.eigh(columns.conj().T @ (stiffness @ columns))
    kept = energy > LIMITS.dependent
    return np.asarray((columns @ turn[:, kept]) / np.sqrt(energy[kept]))


Systems = tuple[tuple[SecondOrderSystem, ...], np.ndarray, np.ndarray]
"""Systems of an index at all speeds of a line, contact map and way back."""


@dataclass(frozen=True, eq=False)
class SpeedLine:
    """A wave of an engine order whose frequency is that order times the speed: frequency [rad/s] -> its model.

    reduced : at `speeds` [Hz], above 0, as `reduce_alike` gives them; load : name of the one that goes with the square
        of the speed, which stands for `nominal` [Hz]; springs : (n_pair, n_component) contact springs [N/m]
    damping : makes that of the systems at `speeds`
    """

    reduced: tuple[ReducedSector, ...]
    speeds: tuple[float, ...]
    engine_order: int
    load: str
    nominal: float
    springs: np.ndarray
    made: dict[int, Systems] = field(default_factory=dict)
    damping: Damping | None = None

    def __call__(self, omega: float) -> ReducedModel:
        """The model at the speed that belongs to a frequency [rad/s]."""
        return wave_of(self.reduced[0], self.engine_order, AtSpeed(self, self.between, self.speed(omega)))

    def slope(self, omega: float) -> ReducedModel:
        """Matrices, loads and outputs of the model by the frequency [rad/s]."""
        return wave_of(self.reduced[0], self.engine_order, AtSpeed(self, self.by_frequency, self.speed(omega)))

    def damped(self, make: Damping) -> SpeedLine:
        """The same with another damping."""
        made = {index: _damped(systems, make) for index, systems in self.made.items()}
        return replace(self, made=made, damping=make)

    def speed(self, omega: float) -> float:
        """The speed [Hz] whose engine order has a frequency [rad/s]."""
        return omega / (2 * np.pi * abs(self.engine_order))

    def between(self, systems: Sequence[SecondOrderSystem], speed: float) -> SecondOrderSystem:
        """The system at a speed from those at `speeds`."""
        squares, one = np.square(self.speeds), systems[0]
        parts = [(speed**2 - np.delete(squares, i)) / (s - np.delete(squares, i)) for i, s in enumerate(squares)]
        return replace(
            one,
            **_summed([float(np.prod(part)) for part in parts], systems),
            gyroscopic=None if one.gyroscopic is None else speed / self.speeds[0] * one.gyroscopic,
            loads={**one.loads, self.load: (speed / self.nominal) ** 2 * one.loads[self.load]},
        )

    def by_frequency(self, systems: Sequence[SecondOrderSystem], speed: float) -> SecondOrderSystem:
        """What `between` gives, differentiated by the frequency [rad/s]."""
        squares, one, each = np.square(self.speeds), systems[0], self.speed(1.0)
        weights = []
        for i, s in enumerate(squares):
            apart = s - np.delete(squares, i)
            part = (speed**2 - np.delete(squares, i)) / apart
            weights.append(2 * speed * each * sum(np.prod(np.delete(part, j)) / apart[j] for j in range(len(apart))))
        return replace(
            one,
            mass=np.zeros_like(one.mass),
            **_summed(weights, systems),
            gyroscopic=None if one.gyroscopic is None else each / self.speeds[0] * one.gyroscopic,
            loads={name: 2 * speed * each / self.nominal**2 * v * (name == self.load) for name, v in one.loads.items()},
            outputs={name: np.zeros_like(v) for name, v in one.outputs.items()},
        )

    def at_index(self, index: int) -> Systems:
        """Systems at all speeds, contact map and way back of a harmonic index, in few coordinates."""
        if index not in self.made:
            each = [WaveIndices(one)(index) for one in self.reduced]
            _, B, T = each[0]
            systems = tuple(system for system, _, _ in each)
            if systems[0].n_dof > LIMITS.many_along:
                shapes = [stuck_ritz(s, B, self.springs, LIMITS.modes_along) for s in (systems[0], systems[-1])]
                V = independent(np.concatenate(shapes, axis=1), stuck_stiffness(systems[0].stiffness, B, self.springs))
                systems, B, T = tuple(s.projected(V) for s in systems), B @ V, T @ V
            self.made[index] = (systems, B, T) if self.damping is None else _damped((systems, B, T), self.damping)
        return self.made[index]

    def error(self, speed: float, there: ReducedSector, n_modes: int = 6) -> float:
        """Largest relative error of the lowest frequencies of the stuck wave that interpolation makes at a speed.

        there : the sector at this speed in the same coordinates
        """
        system, B = at_index(there.sector, self.engine_order)
        nodes = [at_index(one.sector, self.engine_order)[0] for one in self.reduced]
        omega, phi = modes(stuck_stiffness(system.stiffness, B, self.springs), system.mass, n_modes)
        missed = self.between(nodes, speed).stiffness - system.stiffness
        return float(np.abs(np.einsum("ij,ij->j", phi.conj(), missed @ phi) / (2 * omega**2)).max())


def _damped(made: Systems, make: Damping) -> Systems:
    systems, B, T = made
    return tuple(replace(one, damping=make(one, B)) for one in systems), B, T


def _summed(weights: Sequence[float], systems: Sequence[SecondOrderSystem]) -> dict[str, Any]:
    """Weighted sums of the matrices that change along a line."""
    names = ("stiffness",) if systems[0].damping is None else ("stiffness", "damping")
    return {
        name: np.sum([w * getattr(s, name) for w, s in zip(weights, systems, strict=True)], axis=0) for name in names
    }


@dataclass(frozen=True, eq=False)
class AtSpeed:
    """System, contact map and way back of each harmonic index at one speed [Hz]; of : what is made from all speeds."""

    line: SpeedLine
    of: Callable[[Sequence[SecondOrderSystem], float], SecondOrderSystem]
    speed: float
    made: dict[int, tuple[SecondOrderSystem, np.ndarray, np.ndarray]] = field(default_factory=dict)

    def __call__(self, index: int) -> tuple[SecondOrderSystem, np.ndarray, np.ndarray]:
        if index not in self.made:
            systems, B, T = self.line.at_index(index)
            self.made[index] = self.of(systems, self.speed), B, T
        return self.made[index]
