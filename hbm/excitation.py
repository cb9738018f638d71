"""Excitation: which named loads act in which harmonic, and how the other body moves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class Excitation:
    """Periodic loads on a system, as complex amplitudes F_h of F(t) = Re sum_h F_h exp(i h w t).

    loads : (harmonic, name of a load of the system) -> complex amplitude [N]; harmonic 0 is the static load
    base : (n_pair * n_component, n_coeff) prescribed motion of body 2 at the contact [m], or None for a fixed ground"""

    loads: Mapping[tuple[int, str], complex] = field(default_factory=dict)
    base: np.ndarray | None = None

    @classmethod
    def of(
        cls, static: Mapping[str, float] | None = None, harmonic: Mapping[int, Mapping[str, complex]] | None = None
    ) -> Excitation:
        """Excitation from static loads [N] by name and harmonic amplitudes [N] by harmonic and name."""
        loads: dict[tuple[int, str], complex] = {(0, name): value for name, value in (static or {}).items()}
        for h, named in (harmonic or {}).items():
            loads.update({(h, name): value for name, value in named.items()})
        return cls(loads)

    def check(self, basis: HarmonicBasis, names: Mapping[str, object]) -> None:
        """Raise Refusal where a load is unknown or no finite number, or its harmonic is not kept."""
        if self.base is not None and not np.all(np.isfinite(self.base)):
            raise Refusal("the prescribed motion of body 2 must be finite")
        for (h, name), value in self.loads.items():
            if not np.isfinite(value):
                raise Refusal(f"load '{name}' is {value}: give a finite number")
            if name not in names:
                raise Refusal(f"no load '{name}' in the model: it has {', '.join(sorted(names)) or 'none'}")
            if value != 0 and h not in basis.harmonics:
                raise Refusal(f"load '{name}' acts in harmonic {h}, which is not kept: keep it in {basis.harmonics}")

    def force(self, h: int, vectors: Mapping[str, np.ndarray], n: int) -> np.ndarray:
        """Amplitude (n,) of the loads of a harmonic [N]; vectors : unit loads (n,) by name, others are left out."""
        force = np.zeros(n, complex)
        for (order, name), value in self.loads.items():
            if order == h and name in vectors:
                force += value * vectors[name]
        return force
