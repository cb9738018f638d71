"""What a file of another FE program holds beside its mesh, as plain data.

Every place is the name of a group of the source: a node set, a surface or a reference point. Where a card names a bare
node number, the source gets a node set "node N". Values are in SI units: a file in millimetres is taken to count in N,
mm, t and s, as decks do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class DeckMaterial:
    """young, poisson : isotropic, [Pa] and [-], or None; density [kg/m3], expansion [1/K] : None where not given;
    engineering : (E1, E2, E3, nu12, nu13, nu23, G12, G13, G23) of an orthotropic one, or None;
    groups : volume groups made of it
    """

    name: str
    young: float | None = None
    poisson: float | None = None
    density: float | None = None
    expansion: float | None = None
    engineering: tuple[float, ...] | None = None
    groups: tuple[str, ...] = ()


@dataclass(frozen=True)
class Tie:
    """Two faces glued; slave and master as the deck calls them. tolerance [m], None where the deck leaves it."""

    name: str
    slave: str
    master: str
    tolerance: float | None = None


@dataclass(frozen=True)
class Coupling:
    """A face carried by a point: kind "kinematic" (rigid) or "distributing" (mean motion, loads shared).

    point : name of the reference point; axes : those coupled, 0, 1, 2 displacements along x, y, z, 3, 4, 5 rotations
    """

    name: str
    kind: str
    point: str
    face: str
    axes: tuple[int, ...] = (0, 1, 2, 3, 4, 5)


@dataclass(frozen=True)
class Equation:
    """sum of coefficient * displacement = 0; each term is (group of one node, axis 0..5, coefficient)."""

    terms: tuple[tuple[str, int, float], ...]


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
    """A displacement [m] (axis 0..2) or rotation [rad] (axis 3..5) that is given, 0 for held."""

    group: str
    axis: int
    value: float = 0.0


@dataclass(frozen=True)
class PointMass:
    """A mass [kg] at a reference point or node set."""

    group: str
    value: float


@dataclass(frozen=True)
class Deck:
    """All of it; empty for files that hold a mesh alone."""

    materials: tuple[DeckMaterial, ...] = ()
    ties: tuple[Tie, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    equations: tuple[Equation, ...] = ()
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

    return replace(
        deck,
        materials=tuple(
            replace(
                one,
                young=scaled(one.young, newton / area),
                density=scaled(one.density, mass / metre**3),
                engineering=moduli(one.engineering),
            )
            for one in deck.materials
        ),
        ties=tuple(replace(one, tolerance=scaled(one.tolerance, metre)) for one in deck.ties),
        forces=tuple(replace(one, value=one.value * newton * (1.0 if one.axis < 3 else metre)) for one in deck.forces),
        pressures=tuple(replace(one, value=one.value * newton / area) for one in deck.pressures),
        supports=tuple(replace(one, value=one.value * (metre if one.axis < 3 else 1.0)) for one in deck.supports),
        masses=tuple(replace(one, value=one.value * mass) for one in deck.masses),
    )
