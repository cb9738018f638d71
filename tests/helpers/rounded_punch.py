"""Flat punch with rounded edges on a half-plane, normal and tangential, per unit length.

Everything follows from one fact: while the contact grows from half-width b to b + db, the bodies see the increment of
load as a flat punch of half-width b. So the tangent stiffness needs only b(P), and approach, pressure and shear are
sums of flat punches. Partial slip is the difference of two normal problems (Jaeger; Ciavarella).

A half-plane has no absolute stiffness: every displacement here is taken relative to the point at `depth` under the
middle of the contact, in both bodies. For two equal bodies of nu = 0.3 a depth of four half-widths gives a square flat
punch its three-dimensional stiffness; the product has `rectangle` where the length of the contact is known."""

from dataclasses import dataclass
from math import acos, isfinite, log, pi

import numpy as np
from scipy.integrate import quad
from scipy.special import xlogy

from tests.helpers.hertz import require_shear_within
from tribodyn.hbm.contact.stiffness import ElasticPair, arc_excess, half_contact, require_positive


@dataclass(frozen=True)
class RoundedPunch:
    """Flat punch with rounded edges, plane strain.

    half_width : half-width a of the flat [m], 0 for a cylinder (Hertz)
    edge_radius : radius R of the edges [m], 0 for a sharp punch
    pair : the elastic bodies
    Source  Ciavarella, Hills and Monno, Proc. IMechE C 212 (1998) 319-328; here 1/E* = sum (1 - nu^2)/E"""

    half_width: float
    edge_radius: float
    pair: ElasticPair

    def __post_init__(self) -> None:
        for name in ("half_width", "edge_radius"):
            value = getattr(self, name)
            if not (value >= 0 and isfinite(value)):
                raise ValueError(f"{name} is {value:g} m: it must be zero or a positive finite number")
        if self.half_width == 0 and self.edge_radius == 0:
            raise ValueError("half_width and edge_radius are both zero: the punch has no shape")
        self.pair.checked()

    def load(self, half_contact: float) -> float:
        """Load per length [N/m] that brings the contact to half-width b [m], for an edge radius above zero."""
        require_positive(edge_radius=self.edge_radius)
        psi = acos(self.half_width / half_contact)
        return self.pair.modulus * half_contact**2 / (4 * self.edge_radius) * arc_excess(psi)

    def half_contact(self, load: float) -> float:
        """Half-width b of the contact [m] under a load per length [N/m], as the product has it."""
        return half_contact(self.half_width, self.edge_radius, load, self.pair)

    def pressure(self, x: np.ndarray, load: float) -> np.ndarray:
        """Contact pressure [Pa] at positions x [m] from the middle under a load per length [N/m]; zero outside."""
        x = np.asarray(x, float)
        a, b = self.half_width, self.half_contact(load)
        inside = np.abs(x) < b
        position = np.where(inside, x, 0.0) / b
        if self.edge_radius == 0:
            return np.where(inside, load / (pi * b * np.sqrt(1 - position**2)), 0.0)
        p0, phi = np.arcsin(a / b), np.arcsin(position)
        edges = _edge_logarithm(phi, p0) + _edge_logarithm(-phi, p0)
        shape = (pi - 2 * p0) * np.cos(phi) + edges
        return np.where(inside, self.pair.modulus * b / (2 * pi * self.edge_radius) * shape, 0.0)

    def stick_half_width(self, load: float, shear: float, friction: float) -> float:
        """Half-width c of the zone that sticks [m]: the contact under the load P - Q/mu; 0 in full slip."""
        require_shear_within(load, shear, friction)
        remaining = load - shear / friction
        return self.half_contact(remaining) if remaining > 0 else 0.0

    def shear_traction(self, x: np.ndarray, load: float, shear: float, friction: float) -> np.ndarray:
        """Shear traction [Pa] under a shear force per length Q [N/m] first applied.

        q = mu [p(x, P) - p(x, P - Q/mu)]"""
        require_shear_within(load, shear, friction)
        remaining = load - shear / friction
        stuck = self.pressure(x, remaining) if remaining > 0 else 0.0
        return friction * (self.pressure(x, load) - stuck)

    def stiffness(self, load: float, depth: float) -> tuple[float, float]:
        """Tangent stiffness per length (k_n, k_t) [N/m^2] at a load per length [N/m], without slip.

        depth : reference depth in both bodies [m]"""
        b = self.half_contact(load)
        return 1 / self._compliance(b, depth, -1), 1 / self._compliance(b, depth, +1)

    def approach(self, load: float, depth: float) -> float:
        """Approach of the points at `depth` [m] under a load per length [N/m]."""
        return self._summed_compliance(load, depth, -1)

    def shear_displacement(self, load: float, shear: float, friction: float, depth: float) -> float:
        """Tangential displacement of the points at `depth` [m] under a shear force per length Q [N/m] first applied."""
        require_shear_within(load, shear, friction)
        remaining = load - shear / friction
        stuck = self._summed_compliance(remaining, depth, +1) if remaining > 0 else 0.0
        return friction * (self._summed_compliance(load, depth, +1) - stuck)

    def _compliance(self, half_contact: float, depth: float, sign: int) -> float:
        """Compliance times length [m/(N/m)] of a flat punch, sign -1 normal, +1 tangential (Johnson, 2.18, 2.22)."""
        require_positive(depth=depth)
        total = sum(
            (1 - nu**2) / (pi * young) * (2 * log(2 * depth / half_contact) + sign / (1 - nu))
            for young, nu in self.pair.bodies
        )
        if not (total > 0 and depth > half_contact):
            raise ValueError(
                f"depth {depth:g} m is too shallow for a contact of half-width {half_contact:g} m: take several of them"
            )
        return total

    def _summed_compliance(self, load: float, depth: float, sign: int) -> float:
        """Integral of the flat punch compliance over the growing load, with dP = (E*/R) b acos(a/b) db."""
        a, b = self.half_width, self.half_contact(load)
        if self.edge_radius == 0:
            return load * self._compliance(b, depth, sign)
        self._compliance(b, depth, sign)  # refuses a depth too shallow for the widest contact

        def rate(width: float) -> float:
            return self._compliance(width, depth, sign) * width * acos(a / width)

        return self.pair.modulus / self.edge_radius * quad(rate, a, b, epsabs=0, epsrel=1e-10)[0]


def _edge_logarithm(phi: np.ndarray, p0: float) -> np.ndarray:
    """sin(phi) ln|sin(phi + p0)| + sin(p0) ln|tan((phi + p0)/2)|, finite at the edge phi = -p0 of the flat."""
    total = phi + p0
    return xlogy(np.sin(phi) + np.sin(p0), np.abs(np.sin(total))) - xlogy(np.sin(p0), 1 + np.cos(total))
