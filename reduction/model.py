"""The reduced model: what the harmonic balance sees of a part."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.refusal import Refusal

if TYPE_CHECKING:
    from tribodyn.reduction.residual_flexibility import ResidualFlexibility

Damping = Callable[[SecondOrderSystem, np.ndarray], np.ndarray | None]
"""Makes the damping matrix (n, n) [N s/m] of a system whose contact map is (n_contact, n), None for none."""


class Along(Protocol):
    """Models of a wheel whose speed goes with the frequency [rad/s]."""

    def __call__(self, omega: float) -> ReducedModel:
        """The model at a frequency, and at its speed."""

    def slope(self, omega: float) -> ReducedModel:
        """Its matrices, loads and outputs by the frequency."""

    def damped(self, make: Damping) -> Along:
        """The same with another damping."""


@dataclass(frozen=True)
class ModelInfo:
    """What is known of a reduced model besides its matrices; None is what does not apply to it.

    masters : (n_masters,) DOFs of the full system that stay coordinates, ascending; n_modes : other coordinates
    n_full : DOFs of the full system; factorisation : name of its solver; source : of matrices that came as they are
    first_omitted_frequency : of the fixed-interface modes, inf where all are kept [Hz]
    free_frequency : (n,) of the model with contacts open [Hz]
    n_interface_modes, interface_omitted_frequency : modes of the boundary, and the first one left out [Hz]
    n_sectors, engine_order : of a wheel
    prestress_residual, prestress_rotation : of a wheel that turns, see fem.prestress.Prestress
    line_error : along speeds, largest relative error of the lowest stuck frequencies that interpolation makes
    joints : joint -> its pairs; reaction : what prescribed coordinates need, see `prescribed.prescribe`
    """

    masters: np.ndarray | None = None
    n_full: int | None = None
    n_masters: int | None = None
    n_modes: int | None = None
    factorisation: str | None = None
    source: str | None = None
    first_omitted_frequency: float | None = None
    free_frequency: np.ndarray | None = None
    n_interface_modes: int | None = None
    interface_omitted_frequency: float | None = None
    n_sectors: int | None = None
    engine_order: int | None = None
    prestress_residual: float | None = None
    prestress_rotation: float | None = None
    line_error: float | None = None
    joints: Mapping[str, slice] = field(default_factory=dict)
    reaction: StaticReaction | None = None

    @property
    def master_dofs(self) -> np.ndarray:
        """DOFs of the full system that stay coordinates; raises ValueError for a model that knows none."""
        if self.masters is None:
            raise Refusal("this model does not know which DOFs its coordinates are: reduce the full matrices")
        return self.masters


@dataclass(frozen=True)
class ReducedModel:
    """A small system with its contact interface, and the way back to the full field.

    system : dense, n coordinates; contact and accessory DOFs first, then modal coordinates
    interface : in reduced coordinates, B is dense (n_pair * n_component, n)
    basis : (n_full, n) with q_full = basis @ q, or None where there is no full model (matrices from a file)
    info : what is known besides, such as the masters, the truncation frequency and the solver
    per_harmonic : harmonic -> (system, B) where a harmonic sees another system than `system`
        (cyclic harmonic index, displacement prescribed in harmonic 0); complex Hermitian where cyclic
    harmonic_basis : q (n, ...), harmonic -> basis @ q where the coordinates of a harmonic are its own
    per_index : of a travelling wave, index -> (system, B) of any wave of the wheel, real for 0 and N/2; matrices of
        index -j are the conjugates of those of j
    along : of a wheel whose speed goes with the frequency
    residual : static contact flexibility that the coordinates leave out, None where they hold every contact DOF
    """

    system: SecondOrderSystem
    interface: ContactInterface
    basis: np.ndarray | None = None
    info: ModelInfo = field(default_factory=ModelInfo)
    per_harmonic: Callable[[int], tuple[SecondOrderSystem, np.ndarray]] | None = None
    harmonic_basis: Callable[[np.ndarray, int], np.ndarray] | None = None
    per_index: Callable[[int], tuple[SecondOrderSystem, np.ndarray]] | None = None
    residual: ResidualFlexibility | None = None
    along: Along | None = None

    def at_harmonic(self, h: int) -> tuple[SecondOrderSystem, np.ndarray]:
        """System and contact map (n_pair * n_component, n) that harmonic h sees."""
        if self.per_harmonic is not None:
            return self.per_harmonic(h)
        return self.system, np.asarray(self.interface.B)

    def require_masters(self, needed_by: str) -> None:
        """Raise ValueError where the coordinates leave out a part of the contact's flexibility."""
        if self.residual is not None:
            raise Refusal(
                f"{needed_by} needs a model that keeps every contact DOF, which this one with its "
                f'{len(self.interface.B)} does not: set reduction.method = "craig_bampton", on a smaller contact'
            )

    def reconstruct(self, q: np.ndarray, h: int = 1) -> np.ndarray:
        """Full displacement (n_full, ...) [m] of reduced coordinates q (n, ...) of harmonic h."""
        if self.harmonic_basis is not None:
            return self.harmonic_basis(q, h)
        if self.basis is None:
            raise Refusal("this model came as matrices: it has no full field to reconstruct")
        return np.tensordot(self.basis, q, axes=1)

    def projected(self, basis: np.ndarray) -> ReducedModel:
        """The model in coordinates p, q = basis @ p, basis (n, n_p) real; matrices are made symmetric to rounding."""
        interface = replace(self.interface, B=np.asarray(self.interface.B) @ basis)
        full = None if self.basis is None else self.basis @ basis
        return replace(self, system=self.system.projected(basis), interface=interface, basis=full)

    def with_damping(self, make: Damping) -> ReducedModel:
        """The same model with another damping: `make` gives the matrix of every system that a harmonic sees."""
        damped = self.with_systems(lambda system, B: replace(system, damping=make(system, B)))
        return damped if self.along is None else replace(damped, along=self.along.damped(make))

    def with_systems(self, make: Callable[[SecondOrderSystem, np.ndarray], SecondOrderSystem]) -> ReducedModel:
        """The same model with another system in place of each that a harmonic sees, made of it and its contact map.

        Harmonics that shared one system still do
        """
        made: dict[int, tuple[SecondOrderSystem, SecondOrderSystem]] = {}  # the key lives as long as its system

        def changed(system: SecondOrderSystem, B: np.ndarray) -> SecondOrderSystem:
            if id(system) not in made:
                made[id(system)] = system, make(system, B)
            return made[id(system)][1]

        first, seen, any_wave = changed(self.system, np.asarray(self.interface.B)), self.per_harmonic, self.per_index
        if seen is None:
            return replace(self, system=first)

        def per_harmonic(h: int) -> tuple[SecondOrderSystem, np.ndarray]:
            system, B = seen(h)
            return changed(system, B), B

        if any_wave is None:
            return replace(self, system=first, per_harmonic=per_harmonic)

        def per_index(index: int) -> tuple[SecondOrderSystem, np.ndarray]:
            system, B = any_wave(index)
            return changed(system, B), B

        return replace(self, system=first, per_harmonic=per_harmonic, per_index=per_index)


@dataclass(frozen=True)
class StaticReaction:
    """The static force that keeps prescribed coordinates where they are.

    name : of the load whose static amplitude is the height
    dofs : (k,) coordinates of the reduced model, each displaced by the height
    psi : (n, k) static shapes of unit displacements of each; stiffness : (k, k) psi^T K psi [N/m]
    support : (k,) springs in the model that act about the prescribed position [N/m]
    """

    name: str
    dofs: np.ndarray
    psi: np.ndarray
    stiffness: np.ndarray
    support: np.ndarray
    model: ReducedModel

    def force(self, height: float, contact_force: np.ndarray, loads: Mapping[str, float] | None = None) -> np.ndarray:
        """Force on each prescribed coordinate (k,) [N], along its displacement.

        height : [m]; contact_force : (n_pair, n_component) static part of the contact force [N]
        loads : other static loads by name [N]
        Source  Tamatam 2021, eq. 5.4a after eq. 5.4b is solved for X_u
        """
        load = -np.asarray(self.model.interface.B).T @ np.ravel(contact_force)
        for name, value in (loads or {}).items():
            load = load + value * self.model.system.loads[name]
        return (self.stiffness.sum(axis=1) - self.support) * height - self.psi.T @ load
