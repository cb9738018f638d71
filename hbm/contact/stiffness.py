"""Contact stiffness of elastic bodies: the total k_n and k_t of a rectangular punch on an elastic half-space.

It is the compliance of half-spaces. A finite element model that resolves the bodies under the patch already holds most
of it: a contact stiffness from here then counts it twice, as the thesis does (Tamatam 2021, 2.4.1).

Three-dimensional counterpart of Ciavarella, Hills and Monno, in the place of Allara, J. Sound Vib. 320 (2009) 527-544,
which extends the plane formulation and which we have not reproduced line by line. Here

1. the tangent stiffness of any frictionless contact is that of the rigid flat punch with the present contact area
   (Barber, Proc. R. Soc. A 459 (2003) 53-66), and without slip the same holds for shear: rounding enters only through
   the area;
2. the contact grows onto the round edges by the plane law under the mean line load across each side;
3. the rigid flat rectangle is solved with constant tractions on rectangles graded to its edges (Love, Phil. Trans. R.
   Soc. A 228 (1929) 377-420), one quarter by symmetry, extrapolated from two meshes. The square punch comes out within
   0.02 % of k_n = pi E* 0.36679 s, the electric capacity of a square plate of side s.

No reference depth enters: displacements vanish far from the patch. An extruded plane solution has to choose one."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import acos, cos, isfinite, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
import scipy

from tribodyn.refusal import Refusal

N_STRIPS = 5
"""Strips over half of the shorter side on the coarse mesh; the fine mesh has twice as many."""
LONGEST = 1e9
"""Largest ratio of the sides; a finer mesh changes k_n and k_t by less than 3e-4 up to there."""
Influence = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Double primitive, in x and y, of the displacement under a unit point force."""


class ElasticPair(NamedTuple):
    """Young's moduli E1, E2 [Pa] and Poisson's ratios nu1, nu2 [-]; a rigid body has E = inf.

    Normal and tangential problems are taken as uncoupled: exact for equal bodies, otherwise Goodman's approximation (a
    rigid disc bonded to a half-space of nu = 0.3 is 2.9 % stiffer against normal load than the frictionless one)."""

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
                raise Refusal(f"{name} is {value:g} Pa: Young's modulus must be positive (inf for a rigid body)")
        for name, value in zip(("nu1", "nu2"), (self.nu1, self.nu2), strict=True):
            if not -1 < value <= 0.5:
                raise Refusal(f"{name} is {value:g}: Poisson's ratio must lie above -1 and not above 0.5")
        if not (isfinite(self.E1) or isfinite(self.E2)):
            raise Refusal("E1 and E2 are both infinite: one body must be elastic")
        return self


def require_positive(**lengths: float) -> None:
    """Raise ValueError for the first argument that is not a positive finite number."""
    for name, value in lengths.items():
        if not (value > 0 and isfinite(value)):
            raise Refusal(f"{name} is {value:g}: it must be a positive finite number (SI units)")


@cache
def rectangular_punch(
    a: float, b: float, E1: float, nu1: float, E2: float, nu2: float, edge_radius: float = 0.0,
    load: float | None = None,
) -> tuple[float, float]:  # fmt: skip
    """Total tangent stiffness (k_n, k_t) [N/m] of a rectangular patch, without slip.

    a : full side along the direction of shear [m]
    b : full side across it [m]; swap a and b for the other direction of shear
    E1, nu1, E2, nu2 : Young's moduli [Pa] and Poisson's ratios of the bodies, E = inf for a rigid one
    edge_radius : radius of the four edges [m], 0 for sharp ones
    load : normal load [N], needed where the edges are round because the contact grows onto them
    Raises  ValueError: an argument that cannot be, sides beyond LONGEST, or round edges without a load
    Source  see the module; normal and shear problems uncoupled, see ElasticPair"""
    require_positive(a=a, b=b)
    if max(a, b) > LONGEST * min(a, b):
        raise Refusal(
            f"the sides {a:g} and {b:g} m of a punch differ by more than {LONGEST:g} times: check their units, or "
            "give the contact stiffness in numbers"
        )
    pair = ElasticPair(E1, nu1, E2, nu2).checked()
    if not (edge_radius >= 0 and isfinite(edge_radius)):
        raise Refusal(f"edge_radius is {edge_radius:g} m: it must be zero or a positive finite number")
    if edge_radius > 0:
        if load is None:
            raise Refusal("edge_radius is given without load: the contact grows onto round edges, so give load")
        require_positive(load=load)
        a, b = contact_sides(a, b, load, edge_radius, pair)
    return flat_rectangle(a, b, pair)


def contact_sides(a: float, b: float, load: float, edge_radius: float, pair: ElasticPair) -> tuple[float, float]:
    """Full sides [m] of the contact of a punch of flat sides a, b with round edges, each under load over the other.

    Against a three-dimensional unilateral solution the tangent stiffness of the grown area is 1 to 2 % high where the
    contact has grown by a tenth of its side, 3 % high where by a third."""
    sides = (a, b)
    for _ in range(100):
        previous = sides
        sides = (
            2 * half_contact(a / 2, edge_radius, load / previous[1], pair),
            2 * half_contact(b / 2, edge_radius, load / previous[0], pair),
        )
        if np.allclose(sides, previous, rtol=1e-10, atol=0):
            break
    return sides


def half_contact(flat: float, edge_radius: float, load: float, pair: ElasticPair) -> float:
    """Half-width b of the contact [m] of a punch with rounded edges in plane strain under a load per length [N/m].

    flat : half-width a of the flat [m], 0 for a cylinder (Hertz); edge_radius : R [m], 0 for a sharp punch
    2 P R / (E* a^2) = (pi - 2 p0) / (2 sin^2 p0) - cot p0 with sin p0 = a/b, solved for psi = pi/2 - p0
    Source  Ciavarella, Hills and Monno, Proc. IMechE C 212 (1998) 319-328; here 1/E* = sum (1 - nu^2)/E"""
    require_positive(load=load)
    if edge_radius == 0:
        return flat
    if flat == 0:
        return sqrt(4 * load * edge_radius / (pi * pair.modulus))
    ratio = 4 * load * edge_radius / (pair.modulus * flat**2)
    grown = sqrt(1 + 4 * ratio)  # the contact is never wider than that many a

    def excess(psi: float) -> float:
        return arc_excess(psi) / (ratio * cos(psi) ** 2) - 1

    low = min((0.1 * ratio) ** (1 / 3), 0.5)
    while excess(low) > 0:
        low /= 2
    return flat / cos(scipy.optimize.brentq(excess, low, acos(1 / (2 * grown)), xtol=1e-300, rtol=1e-14))


def arc_excess(psi: float) -> float:
    """2 psi - sin 2 psi, without cancellation where psi is small."""
    if psi > 0.05:
        return 2 * psi - sin(2 * psi)
    square = (2 * psi) ** 2
    return (2 * psi) ** 3 / 6 * (1 - square / 20 * (1 - square / 42 * (1 - square / 72)))


def flat_rectangle(a: float, b: float, pair: ElasticPair) -> tuple[float, float]:
    """Stiffness (k_n, k_t) [N/m] of a rigid flat sharp punch of full sides a (along shear) and b [m]."""

    def normal(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return _inverse_distance(x, y) / (pi * pair.modulus)

    def tangential(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        # Cerruti: u_x = (1 + nu)/(pi E) [(1 - nu)/r + nu x^2/r^3]; the double primitive of x^2/r^3 is y ln(x + r)
        isotropic = sum((1 - nu**2) / (pi * young) for young, nu in pair.bodies)
        directed = sum((1 + nu) * nu / (pi * young) for young, nu in pair.bodies)
        return isotropic * _inverse_distance(x, y) + directed * y * _log_of_sum(x, y)

    return _extrapolated(a, b, normal), _extrapolated(a, b, tangential)


def _inverse_distance(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Double primitive of 1/r."""
    return x * _log_of_sum(y, x) + y * _log_of_sum(x, y)


def _log_of_sum(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """ln(x + r), as ln(y^2 / (r - x)) where x < 0, which on a long strip cancels to nothing otherwise."""
    long = np.log(np.hypot(x, y) + np.abs(x))
    return np.where(x < 0, 2 * np.log(np.abs(y)) - long, long)


def _extrapolated(a: float, b: float, influence: Influence) -> float:
    """Stiffness free of the leading mesh error, which falls with the square of the number of strips."""
    n_x, n_y = (min(round(N_STRIPS * sqrt(side / min(a, b))), 4 * N_STRIPS) for side in (a, b))
    coarse, fine = (_stiffness(a / 2, b / 2, k * n_x, k * n_y, influence) for k in (1, 2))
    return fine + (fine - coarse) / 3


def _stiffness(a: float, b: float, n_x: int, n_y: int, influence: Influence) -> float:
    """Force [N] that moves the rectangle of half-sides a, b by one metre, n_x by n_y strips over its quarter."""
    x_edge, y_edge = (side * np.sin(np.pi / 2 * np.arange(m + 1) / m) for side, m in ((a, n_x), (b, n_y)))
    x, y = ((e[1:] + e[:-1]) / 2 for e in (x_edge, y_edge))
    displacement = np.zeros((n_x, n_y, n_x, n_y))
    for mirror_x in (1, -1):
        for mirror_y in (1, -1):
            at = influence(
                (mirror_x * x[:, None] - x_edge)[:, None, :, None], (mirror_y * y[:, None] - y_edge)[None, :, None, :]
            )
            displacement += at[..., :-1, :-1] - at[..., 1:, :-1] - at[..., :-1, 1:] + at[..., 1:, 1:]
    traction = np.linalg.solve(displacement.reshape(n_x * n_y, -1), np.ones(n_x * n_y))
    return 4 * float(traction @ np.outer(np.diff(x_edge), np.diff(y_edge)).ravel())
