"""Materials, constraints, loads and supports of a file of another FE program, as plain data.

Every place is the name of a group of the source: a node set, a surface or a reference point. Where a card names a bare
node number, the source gets a node set "node N". Values are in SI units: a file in millimetres is taken to count in N,
mm, t and s, as decks do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tribodyn.geometry.sources.directions import Directions


@dataclass(frozen=True)
class DeckMaterial:
    """young, poisson : isotropic, [Pa] and [-], or None; density [kg/m3], expansion [1/K] : None where not given;
    engineering : (E1, E2, E3, nu12, nu13, nu23, G12, G13, G23) of an orthotropic one, or None;
    stiffness : (6, 6) of an anisotropic one, stresses 11, 22, 33, 23, 13, 12, or None;
    tabulated : cards that give constants at several temperatures, of which those at the initial one are taken
    groups : volume groups made of it; directions : of these, those whose axes are not x, y, z -> its axes"""

    name: str
    young: float | None = None
    poisson: float | None = None
    density: float | None = None
    expansion: float | None = None
    engineering: tuple[float, ...] | None = None
    stiffness: tuple[tuple[float, ...], ...] | None = None
    tabulated: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    directions: Mapping[str, Directions] = field(default_factory=dict)


@dataclass(frozen=True)
class DeckTie:
    """Two faces glued, or that may touch, as the deck calls them.

    tolerance : of glued ones [m]; friction : of ones that may touch; None where the deck leaves it"""

    name: str
    slave: str
    master: str
    tolerance: float | None = None
    friction: float | None = None


@dataclass(frozen=True)
class Coupling:
    """A face carried by a point: kind "kinematic" (rigid) or "distributing" (mean motion, loads shared).

    point : name of the reference point; axes : those coupled, 0, 1, 2 displacements along x, y, z, 3, 4, 5 rotations"""

    name: str
    kind: str
    point: str
    face: str
    axes: tuple[int, ...] = (0, 1, 2, 3, 4, 5)


@dataclass(frozen=True)
class DeckEquation:
    """sum of coefficient * displacement = 0; each term is (group of one node, axis 0..5, coefficient)."""

    terms: tuple[tuple[str, int, float], ...]


@dataclass(frozen=True)
class DeckSpring:
    """A stiffness [N/m] against the elongation sum of factor * displacement; terms as of an equation.

    Rotations are counted with a length of 1 m; a spring of rotations alone has [N m]"""

    terms: tuple[tuple[str, int, float], ...]
    stiffness: float


@dataclass(frozen=True)
class Force:
    """A concentrated force [N] (axis 0..2) or moment [N m] (axis 3..5) on each node of a group."""

    group: str
    axis: int
    value: float


@dataclass(frozen=True)
class FacePressure:
    """A pressure [Pa] into a face."""

    face: str
    value: float


@dataclass(frozen=True)
class Support:
    """A displacement [m] (axis 0..2) or rotation [rad] (axis 3..5) that is given, 0 for held.

    system : along whose directions, None for x, y, z"""

    group: str
    axis: int
    value: float = 0.0
    system: Directions | None = None


@dataclass(frozen=True)
class PointMass:
    """A mass [kg] at a reference point or node set; inertia of a point about x, y, z [kg m2]."""

    group: str
    value: float
    inertia: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def times(self, mass: float, area: float = 1.0) -> PointMass:
        """The same in other units."""
        a, b, c = (mass * area * value for value in self.inertia)
        return PointMass(self.group, mass * self.value, (a, b, c))


def stiffness(upper: list[float], order: Sequence[int]) -> tuple[tuple[float, ...], ...]:
    """(6, 6) of an anisotropic material from the 21 values of its upper triangle, row by row.

    order : position in the file of each of our stresses 11, 22, 33, 23, 13, 12"""
    full = np.zeros((6, 6))
    full[np.triu_indices(6)] = upper
    full += np.triu(full, 1).T
    return tuple(map(tuple, full[np.ix_(order, order)].tolist()))


@dataclass(frozen=True)
class Deck:
    """Everything except the mesh; empty for a file with a mesh alone. contacts : pairs of faces that may touch"""

    materials: tuple[DeckMaterial, ...] = ()
    ties: tuple[DeckTie, ...] = ()
    contacts: tuple[DeckTie, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    equations: tuple[DeckEquation, ...] = ()
    springs: tuple[DeckSpring, ...] = ()
    forces: tuple[Force, ...] = ()
    pressures: tuple[FacePressure, ...] = ()
    supports: tuple[Support, ...] = ()
    masses: tuple[PointMass, ...] = ()


def in_si(deck: Deck, metre: float, newton: float) -> Deck:
    """A deck in SI units. metre, newton : its units of length and force; its time is in seconds, its mass follows."""
    area, mass = metre**2, newton / metre

    def scaled(value: float | None, factor: float) -> float | None:
        return None if value is None else factor * value

    def moduli(values: tuple[float, ...] | None) -> tuple[float, ...] | None:
        stress = newton / area
        return values and (*(stress * v for v in values[:3]), *values[3:6], *(stress * v for v in values[6:]))

    def lengths(terms: tuple[tuple[str, int, float], ...]) -> tuple[tuple[str, int, float], ...]:
        return tuple((group, axis, factor * (1.0 if axis < 3 else metre)) for group, axis, factor in terms)

    return replace(
        deck,
        materials=tuple(
            replace(
                item,
                young=scaled(item.young, newton / area),
                density=scaled(item.density, mass / metre**3),
                engineering=moduli(item.engineering),
                stiffness=item.stiffness and tuple(tuple(newton / area * v for v in row) for row in item.stiffness),
                directions={group: axes.scaled(metre) for group, axes in item.directions.items()},
            )
            for item in deck.materials
        ),
        ties=tuple(replace(item, tolerance=scaled(item.tolerance, metre)) for item in deck.ties),
        equations=tuple(replace(item, terms=lengths(item.terms)) for item in deck.equations),
        springs=tuple(
            replace(item, terms=lengths(item.terms), stiffness=item.stiffness * newton / metre) for item in deck.springs
        ),
        forces=tuple(
            replace(item, value=item.value * newton * (1.0 if item.axis < 3 else metre)) for item in deck.forces
        ),
        pressures=tuple(replace(item, value=item.value * newton / area) for item in deck.pressures),
        supports=tuple(
            replace(
                item,
                value=item.value * (metre if item.axis < 3 else 1.0),
                system=item.system and item.system.scaled(metre),
            )
            for item in deck.supports
        ),
        masses=tuple(item.times(mass, area) for item in deck.masses),
    )
