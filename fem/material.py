"""Isotropic linear elastic material."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Material:
    """E : Young's modulus [Pa]; nu : Poisson's ratio, between -1 and 0.5; rho : density [kg/m3]."""

    E: float
    nu: float
    rho: float

    def __post_init__(self) -> None:
        if not self.E > 0:
            raise ValueError(f"material: E = {self.E} Pa is not positive; give Young's modulus in pascal")
        if not -1 < self.nu < 0.5:
            raise ValueError(f"material: nu = {self.nu} is outside -1 < nu < 0.5; metals have about 0.3")
        if not self.rho > 0:
            raise ValueError(f"material: rho = {self.rho} kg/m3 is not positive; steel has 7860")

    @property
    def lame(self) -> tuple[float, float]:
        """Lame's constants lambda, mu [Pa]."""
        return (
            self.E * self.nu / ((1 + self.nu) * (1 - 2 * self.nu)),
            self.E / (2 * (1 + self.nu)),
        )
