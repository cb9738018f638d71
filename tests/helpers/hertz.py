"""Sphere on a plane, or two spheres: Hertz against normal load, Mindlin against shear."""

from dataclasses import dataclass
from math import pi

from tribodyn.hbm.contact.stiffness import ElasticPair, require_positive


@dataclass(frozen=True)
class SphereContact:
    """Hertzian point contact.

    radius : relative radius of curvature, 1/R = 1/R1 + 1/R2 [m]
    pair : the elastic bodies
    Source  Johnson, Contact Mechanics, 1985: eqs 4.22-4.24 (normal), 7.41-7.44 (tangential)"""

    radius: float
    pair: ElasticPair

    def __post_init__(self) -> None:
        require_positive(radius=self.radius)
        self.pair.checked()

    def contact_radius(self, load: float) -> float:
        """Radius of the contact circle under a normal load [N], in m."""
        return (3 * load * self.radius / (4 * self.pair.modulus)) ** (1 / 3)

    def approach(self, load: float) -> float:
        """Approach of distant points [m]."""
        return self.contact_radius(load) ** 2 / self.radius

    def peak_pressure(self, load: float) -> float:
        """Largest pressure [Pa]."""
        return 1.5 * load / (pi * self.contact_radius(load) ** 2)

    def stiffness(self, load: float) -> tuple[float, float]:
        """Tangent stiffness (k_n, k_t) [N/m] at a normal load, without slip."""
        a = self.contact_radius(load)
        return 2 * self.pair.modulus * a, 8 * a / self._shear_compliance()

    def stick_radius(self, load: float, shear: float, friction: float) -> float:
        """Radius of the circle that still sticks under a shear force [N] first applied, in m."""
        require_shear_within(load, shear, friction)
        return self.contact_radius(load) * (1 - shear / (friction * load)) ** (1 / 3)

    def shear_displacement(self, load: float, shear: float, friction: float) -> float:
        """Tangential displacement of distant points under a shear force first applied [m]."""
        require_shear_within(load, shear, friction)
        full = 3 * friction * load * self._shear_compliance() / (16 * self.contact_radius(load))
        return full * (1 - (1 - shear / (friction * load)) ** (2 / 3))

    def _shear_compliance(self) -> float:
        """Sum of (2 - nu)/G over the bodies [1/Pa]."""
        return sum((2 - nu) * 2 * (1 + nu) / young for young, nu in self.pair.bodies)


def require_shear_within(load: float, shear: float, friction: float) -> None:
    """Raise ValueError unless 0 <= shear <= friction * load."""
    if not 0 <= shear <= friction * load:
        raise ValueError(
            f"shear force {shear:g} is outside 0 .. {friction * load:g}: beyond friction times load the contact slides"
        )
