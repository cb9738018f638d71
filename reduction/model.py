"""The reduced model: what the harmonic balance sees of a part."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.system import SecondOrderSystem

Damping = Callable[[SecondOrderSystem, np.ndarray], np.ndarray | None]
"""Makes the damping matrix (n, n) [N s/m] of a system whose contact map is (n_contact, n), None for none."""


@dataclass(frozen=True)
class ReducedModel:
    """A small system with its contact interface, and the way back to the full field.

    system : dense, n coordinates; contact and accessory DOFs first, then modal coordinates
    interface : in reduced coordinates, B is dense (n_pair * n_component, n)
    basis : (n_full, n) with q_full = basis @ q, or None where there is no full model (matrices from a file)
    info : facts for reports, such as the number of masters, modes, the truncation frequency and solver names
    per_harmonic : harmonic -> (system, B) where a harmonic sees another system than `system`
        (cyclic harmonic index, displacement prescribed in harmonic 0); complex Hermitian where cyclic
    harmonic_basis : harmonic -> (n_full, n) basis where the coordinates of a harmonic are its own
    """

    system: SecondOrderSystem
    interface: ContactInterface
    basis: np.ndarray | None = None
    info: Mapping[str, object] = field(default_factory=dict)
    per_harmonic: Callable[[int], tuple[SecondOrderSystem, np.ndarray]] | None = None
    harmonic_basis: Callable[[int], np.ndarray] | None = None

    def at_harmonic(self, h: int) -> tuple[SecondOrderSystem, np.ndarray]:
        """System and contact map (n_pair * n_component, n) that harmonic h sees."""
        if self.per_harmonic is not None:
            return self.per_harmonic(h)
        return self.system, np.asarray(self.interface.B)

    def reconstruct(self, q: np.ndarray, h: int = 1) -> np.ndarray:
        """Full displacement (n_full, ...) [m] of reduced coordinates q (n, ...) of harmonic h."""
        basis = self.basis if self.harmonic_basis is None else self.harmonic_basis(h)
        if basis is None:
            raise ValueError("this model came as matrices: it has no full field to reconstruct")
        return np.tensordot(basis, q, axes=1)

    def with_damping(self, make: Damping) -> ReducedModel:
        """The same model with another damping: `make` gives the matrix of every system that a harmonic sees.

        Harmonics that shared one system still do
        """
        made: dict[int, tuple[SecondOrderSystem, SecondOrderSystem]] = {}  # the key lives as long as its system

        def damped(system: SecondOrderSystem, B: np.ndarray) -> SecondOrderSystem:
            if id(system) not in made:
                made[id(system)] = system, replace(system, damping=make(system, B))
            return made[id(system)][1]

        first, seen = damped(self.system, np.asarray(self.interface.B)), self.per_harmonic
        if seen is None:
            return replace(self, system=first)

        def per_harmonic(h: int) -> tuple[SecondOrderSystem, np.ndarray]:
            system, B = seen(h)
            return damped(system, B), B

        return replace(self, system=first, per_harmonic=per_harmonic)
