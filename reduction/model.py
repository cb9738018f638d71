"""The reduced model: what the harmonic balance sees of a part.

`ReducedModel` is one small system for all harmonics. Its variants answer the same questions otherwise:

| class                                      | what differs                                                |
|---|---|
| `reduction.prescribed.PrescribedModel`     | harmonic 0 sees a system with coordinates held              |
| `reduction.residual_flexibility.FlexibleModel` | its coordinates leave out part of the contact flexibility |
| `reduction.wave_model.WaveModel`           | each harmonic sees the system of a harmonic index of a wheel |
| `reduction.speed_line.SpeedLineModel`      | such a wave whose speed goes with the frequency             |"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.refusal import Refusal

Damping = Callable[[SecondOrderSystem, np.ndarray], np.ndarray | None]
"""Computes the damping matrix (n, n) [N s/m] of a system with its contact map (n_contact, n); None for none."""
SystemChange = Callable[[SecondOrderSystem, np.ndarray], SecondOrderSystem]
"""Replaces a system, given its contact map (n_contact, n)."""


@dataclass(frozen=True)
class Origin:
    """Where the coordinates of a model come from: here from files or another model, with no full field behind them."""

    @property
    def masters(self) -> np.ndarray:
        """(n_masters,) DOFs of the full system that are coordinates, ascending; they come first."""
        raise Refusal("this model does not know which DOFs its coordinates are: reduce the full matrices")

    def reconstruct(self, q: np.ndarray) -> np.ndarray:
        """Full displacement (n_full, ...) [m] of reduced coordinates q (n, ...)."""
        raise Refusal("this model came as matrices: it has no full field to reconstruct")

    def projected(self, basis: np.ndarray) -> Self:
        """The origin of coordinates p, q = basis @ p."""
        return self

    def n_full(self, n: int) -> int:
        """DOFs of the full system of n coordinates."""
        return n


@dataclass(frozen=True)
class ReductionBasis(Origin):
    """Coordinates that a reduction chose.

    basis : (n_full, n), q_full = basis @ q; master_dofs : (n_masters,) see `masters`
    n_modes : number of the other coordinates
    factorisation : name of the sparse solver
    first_omitted_frequency : of the fixed-interface modes, inf where all are retained [Hz]
    n_interface_modes, interface_omitted_frequency : modes of the boundary, 0 without, and the first omitted one [Hz]"""

    basis: np.ndarray
    master_dofs: np.ndarray
    n_modes: int
    factorisation: str
    first_omitted_frequency: float
    n_interface_modes: int = 0
    interface_omitted_frequency: float = np.inf

    @property
    def masters(self) -> np.ndarray:
        return self.master_dofs

    def reconstruct(self, q: np.ndarray) -> np.ndarray:
        parts = np.ascontiguousarray(q).view(float).reshape(len(q), -1)  # a complex copy of the basis costs more
        return np.asarray((self.basis @ parts).view(np.asarray(q).dtype).reshape(-1, *np.shape(q)[1:]))

    def projected(self, basis: np.ndarray) -> Self:
        return replace(self, basis=self.basis @ basis)

    def n_full(self, n: int) -> int:
        return len(self.basis)


@dataclass(frozen=True)
class ReducedModel:
    """A small system with its contact interface, and the way back to the full field; one system for all harmonics.

    system : dense, n coordinates; contact and accessory DOFs first, then modal coordinates
    interface : in reduced coordinates, B is dense (n_pair * n_component, n)
    origin : where the coordinates come from; joints : joint -> its pairs
    free_frequency : (n_mode,) lowest natural frequencies with contacts open [Hz]; none where they are not known"""

    system: SecondOrderSystem
    interface: ContactInterface
    origin: Origin = field(default_factory=Origin)
    joints: Mapping[str, slice] = field(default_factory=dict)
    free_frequency: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def n_full(self) -> int:
        """DOFs of the full system."""
        return self.origin.n_full(self.system.n_dof)

    has_one_system: ClassVar[bool] = True
    """Whether all harmonics see the same system."""

    has_motion_in_time: ClassVar[bool] = True
    """Whether `system` is the equation of motion in time."""

    is_wave: ClassVar[bool] = False
    """Whether it is one sector of a wheel under a travelling wave."""

    @property
    def sectors_in_time(self) -> int:
        """Copies that make the motion in time: those of a wave until it repeats itself, otherwise 1."""
        return 1

    follows_frequency: ClassVar[bool] = False
    """Whether its matrices depend on the excitation frequency; see `at_frequency`."""

    leaves_flexibility_out: ClassVar[bool] = False
    """Whether the coordinates leave out a part of the contact flexibility."""

    def at_harmonic(self, h: int) -> tuple[SecondOrderSystem, np.ndarray]:
        """System and contact map (n_pair * n_component, n) that harmonic h sees."""
        return self.system, np.asarray(self.interface.B)

    def at_frequency(self, omega: float) -> ReducedModel:
        """The model at an excitation frequency [rad/s]."""
        return self

    def shared_systems(self, harmonics: Sequence[int]) -> list[tuple[list[int], list[int]]]:
        """Positions of the harmonics that share a system, and of those that see its conjugate, system by system."""
        sharing: dict[int, tuple[list[int], list[int]]] = {}
        for position, h in enumerate(harmonics):
            sharing.setdefault(id(self.at_harmonic(h)[0]), ([], []))[0].append(position)
        return list(sharing.values())

    def matches(self, other: ReducedModel, harmonics: Sequence[int]) -> bool:
        """Whether another model has equal matrices and vectors, to the last bit, at some harmonics."""
        systems = ([part for h in harmonics for part in model.at_harmonic(h)] for model in (self, other))
        return type(self) is type(other) and all(map(_equal, *systems))

    def accuracy(self) -> dict[str, float]:
        """How exactly the model was made, by name: prestress_residual, prestress_rotation [rad], line_error."""
        return {}

    def require_masters(self, needed_by: str) -> None:
        """Raise Refusal where the coordinates leave out a part of the contact flexibility."""

    def reconstruct(self, q: np.ndarray, h: int = 1) -> np.ndarray:
        """Full displacement (n_full, ...) [m] of reduced coordinates q (n, ...) of harmonic h."""
        return self.origin.reconstruct(q)

    def projected(self, basis: np.ndarray) -> ReducedModel:
        """The model in coordinates p, q = basis @ p, basis (n, n_p) real; matrices are made symmetric to rounding."""
        interface = replace(self.interface, B=np.asarray(self.interface.B) @ basis)
        return replace(
            self, system=self.system.projected(basis), interface=interface, origin=self.origin.projected(basis)
        )

    def with_damping(self, make: Damping) -> Self:
        """The same model with another damping: `make` computes the matrix of every system that a harmonic sees."""
        return self.with_systems(lambda system, B: replace(system, damping=make(system, B)))

    def with_systems(self, change: SystemChange) -> Self:
        """The same model with every system that a harmonic sees replaced."""
        return replace(self, system=change(self.system, np.asarray(self.interface.B)))


def _equal(first: object, second: object) -> bool:
    """Whether two arrays, or two systems in all that they hold, are equal to the last bit."""
    if isinstance(first, SecondOrderSystem):
        return _equal(vars(first), vars(second))
    if isinstance(first, dict) and isinstance(second, dict):
        return list(first) == list(second) and all(map(_equal, first.values(), second.values()))
    return first is second or np.array_equal(first, second)  # type: ignore[arg-type]
