"""Two elastic half-spaces in contact."""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple


class ElasticPair(NamedTuple):
    """Young's moduli E1, E2 [Pa] and Poisson's ratios nu1, nu2 [-]; a rigid body has E = inf.

    Normal and tangential problems are taken as uncoupled: exact for equal bodies, otherwise Goodman's approximation (a
    rigid disc bonded to a half-space of nu = 0.3 is 2.9 % stiffer against normal load than the frictionless one).
    """

    E1: float
    nu1: float
    E2: float
    nu2: float

    @property
    def modulus(self) -> float:
        """Plane contact modulus E* [Pa], 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2."""
        return 1 / sum((1 - nu**2) / young for young, nu in self.bodies)

    @property
    def bodies(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(E, nu) of each body."""
        return (self.E1, self.nu1), (self.E2, self.nu2)

    def checked(self) -> ElasticPair:
        """Self, or a ValueError that names the number that cannot be."""
        for name, value in zip(("E1", "E2"), (self.E1, self.E2), strict=True):
            if not value > 0:
                raise ValueError(f"{name} is {value:g} Pa: Young's modulus must be positive (inf for a rigid body)")
        for name, value in zip(("nu1", "nu2"), (self.nu1, self.nu2), strict=True):
            if not -1 < value <= 0.5:
                raise ValueError(f"{name} is {value:g}: Poisson's ratio must lie above -1 and not above 0.5")
        if not (isfinite(self.E1) or isfinite(self.E2)):
            raise ValueError("E1 and E2 are both infinite: one body must be elastic")
        return self


def require_positive(**lengths: float) -> None:
    """Raise ValueError for the first argument that is not a positive finite number."""
    for name, value in lengths.items():
        if not (value > 0 and isfinite(value)):
            raise ValueError(f"{name} is {value:g}: it must be a positive finite number (SI units)")
