"""A deck of another FE program as part of a structure: its bodies, materials, constraints, supports and loads.

What cannot be carried over and would change the structure is refused. What changes nothing, such as a support of a
point that nothing moves, is named among what is not used."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.fem.assembly import Assembly, Body, group_name
from tribodyn.fem.constraints import AXES, Clamp, ClampAlong, Constraint
from tribodyn.fem.couplings import DistributedCoupling, Equation, RigidCoupling, Tie
from tribodyn.fem.load_vectors import Load, Moment, NodalForce, Pressure, Sum
from tribodyn.fem.material import AnyMaterial
from tribodyn.fem.part import Part, build
from tribodyn.fem.springs import ElongationSpring, Mass
from tribodyn.geometry import subdivision
from tribodyn.geometry.sources import added_nodes, deck, face_rules, foreign_file
from tribodyn.geometry.sources.directions import Directions
from tribodyn.refusal import Refusal
from tribodyn.workflows.run.deck_bodies import elements_of, material, notes_of, source, with_elements
from tribodyn.workflows.scene.structure_tables import EVERYTHING, DeckTable as Table

UNITS = {metres: name for name, (metres, _) in foreign_file.UNITS.items()}
ALL_AXES = (0, 1, 2, 3, 4, 5)


@dataclass
class CarriedDeck:
    """What a deck brings into a scene. points : name -> (3,) of its reference points [m]; load : all its loads
    notes : sentences on its conversion, and on its unused content
    tabulated : material -> its cards of several temperatures, of which the initial one is taken"""

    bodies: list[Body]
    points: dict[str, np.ndarray] = field(default_factory=dict)
    clamps: list[Clamp] = field(default_factory=list)
    constraints: list[Constraint] = field(default_factory=list)
    springs: list[ElongationSpring] = field(default_factory=list)
    masses: list[Mass] = field(default_factory=list)
    load: Sum = field(default_factory=lambda: Sum(()))
    notes: list[str] = field(default_factory=list)
    tabulated: dict[str, tuple[str, ...]] = field(default_factory=dict)


def load_name(deck_name: str) -> str:
    """Name of the load that a deck brings."""
    return f"decks.{deck_name}"


def structure(name: str, table: Table, materials: Mapping[str, AnyMaterial], folder: Path) -> CarriedDeck:
    """What the deck of a table brings.

    materials : of the scene; they replace materials of the deck with the same name; folder : of the scene
    Raises  Refusal, one sentence: the deck cannot be read, lacks a material, or has what cannot be carried over"""
    path = folder / table.file
    if table.unit not in UNITS:
        raise Refusal(f"decks.{name}.unit: expected one of {', '.join(foreign_file.UNITS)}")
    try:
        return _DeckConversion(name, table, materials, source(path, UNITS[table.unit])).convert()
    except Refusal as trouble:
        clause = str(trouble)
        raise Refusal(clause if clause.startswith("decks.") else f"decks.{name}: {clause}") from None


class _DeckConversion:
    """Converts one deck into parts of a structure."""

    def __init__(self, name: str, table: Table, materials: Mapping[str, AnyMaterial], source: foreign_file.Source):
        forms = {body: elements_of(source, table, body) for body in source.bodies}
        if not all(forms.values()) and "equations" in table.use:
            bodies = {
                name: replace(body, added=() if forms[name] else body.added) for name, body in source.bodies.items()
            }
            source = added_nodes.with_added_nodes(replace(source, bodies=bodies))
        self.name, self.table, self.source, self.deck = name, table, source, source.deck
        self.materials = materials
        self.faces: dict[str, list[str]] = {}  # group of the deck -> its names in the assembly
        self.sets: dict[str, list[str]] = {}
        self.body_of: dict[str, str] = {}  # of such a name
        self._refuse()
        self.content = CarriedDeck([self._body(body) for body in source.bodies])
        self.notes = self.content.notes
        self.axes_of: dict[str, set[int]] = {}  # point -> its axes that an equation moves
        self.carried: set[str] = set()  # points that a coupling ties to a face

    def convert(self) -> CarriedDeck:
        """Convert all that the table uses; note the rest."""
        use = self.table.use
        for kind in EVERYTHING:
            entries = getattr(self.deck, kind)
            if kind in use:
                getattr(self, f"_{kind}")(entries)
            elif entries:
                self.notes.append(f"{self._count_of(kind, entries)} that use leaves out")
        self._points()
        self.content.clamps += [Clamp(group) for group in self.table.fixed]
        self.content.clamps += [Clamp(group, axes) for group, axes in self.table.fixed_axes.items()]
        ignored = [f"{self.source.refused[name]}, by ignore" for name in self.table.ignore]
        unused = [f"not used: {clause}" for clause in (*self.source.unused, *self.notes, *ignored)]
        notes = (*notes_of(self.source, self.table), *unused)
        self.content.tabulated = {
            entry.name: entry.tabulated
            for entry in self.source.deck.materials
            if entry.tabulated and entry.name not in self.materials
        }
        self.content.notes = [f"decks.{self.name}: {sentence}" for sentence in notes]
        return self.content

    def _refuse(self) -> None:
        """Raise Refusal where the deck has what is not carried over, unless the scene ignores it."""
        refused, ignore = dict(self.source.refused), self.table.ignore
        if "supports" not in self.table.use:
            refused.pop(foreign_file.DISPLACED, None)
        if unknown := [name for name in ignore if name not in refused]:
            listed = ", ".join(refused) or "nothing"
            raise Refusal(f"ignore: '{unknown[0]}' is not refused, {listed} is: correct the name")
        if remaining := [name for name in refused if name not in ignore]:
            listed = ", ".join(refused[name] for name in remaining)
            names = ", ".join(f'"{name}"' for name in remaining)
            raise Refusal(
                f"the deck has {listed}, not carried over though stiffness, mass, support or load may change: give it "
                f"in the scene, and leave it out by decks.{self.name}.ignore = [{names}]"
            )

    def _body(self, name: str) -> Body:
        solid = self.source.bodies[name]
        rules = {}
        for face, rule in self.table.faces.items():
            if rule.body not in self.source.bodies:
                names = ", ".join(self.source.bodies)
                raise Refusal(f"faces.{face}: the deck has no body '{rule.body}'; it has {names}")
            if rule.body == name:
                rules[face] = rule.rule
        mesh, node_sets = face_rules.add_faces(solid.mesh, solid.node_sets, rules)
        mesh, node_sets = subdivision.subdivide(mesh, node_sets, self.table.halved)
        form = elements_of(self.source, self.table, name)
        mesh, node_sets = with_elements(mesh, node_sets, form, name)
        body_material = material(self.deck, name, mesh, self.table, self.materials, form, self.name)
        for group in {*node_sets, *(mesh.boundaries or {})}:
            names_of = self.faces if group in (mesh.boundaries or {}) else self.sets
            place = group_name(name, group, node_sets)
            names_of.setdefault(group, []).append(place)
            self.body_of[place] = name
        return Body(name, mesh, node_sets, body_material)

    # constraints

    def _ties(self, ties: Sequence[deck.DeckTie]) -> None:
        for tie in ties:
            label = f"tie '{tie.name}' of deck {self.name}"
            slaves, masters = (self._faces(place, label) for place in (tie.slave, tie.master))
            if len(masters) > 1:
                raise Refusal(f"{label}: its master lies on {', '.join(masters)}; {self._instead('ties', 'ties')}")
            self.content.constraints += [Tie(label, slave, masters[0], tie.tolerance) for slave in slaves]

    def _couplings(self, couplings: Sequence[deck.Coupling]) -> None:
        for coupling in couplings:
            label = f"coupling '{coupling.name}' of deck {self.name}"
            if coupling.point not in self.source.points:
                raise Refusal(
                    f"{label}: its reference node belongs to the mesh; give it one of its own, or "
                    f"{self._instead('couplings', 'couplings')}"
                )
            if not set(coupling.axes) >= {0, 1, 2}:
                raise Refusal(f"{label} couples some directions alone; {self._instead('couplings', 'couplings')}")
            kind = RigidCoupling if coupling.kind == "kinematic" else DistributedCoupling
            places = self._groups(coupling.face, label)
            if len(places) > 1 and kind is DistributedCoupling:
                listed = ", ".join(places)
                raise Refusal(f"{label}: its face lies on {listed}; {self._instead('couplings', 'couplings')}")
            self.carried.add(coupling.point)
            self.content.constraints += [kind(coupling.point, place) for place in places]

    def _equations(self, equations: Sequence[deck.DeckEquation]) -> None:
        for number, equation in enumerate(equations, 1):
            label = f"equation {number} of deck {self.name}"
            self.content.constraints.append(Equation(label, self._terms(equation.terms, label)))

    def _springs(self, springs: Sequence[deck.DeckSpring]) -> None:
        for number, spring in enumerate(springs, 1):
            terms = self._terms(spring.terms, f"spring {number} of deck {self.name}")
            self.content.springs.append(ElongationSpring(terms, spring.stiffness))

    def _terms(self, terms: Sequence[tuple[str, int, float]], label: str) -> tuple[tuple[str, int, float], ...]:
        """Terms of an equation or a spring over the nodes of the assembly."""
        place_terms = []
        for group, axis, factor in terms:
            if group in self.source.points:
                self.axes_of.setdefault(group, set()).add(axis)
                place_terms.append((group if axis < 3 else f"{group}.turn", axis % 3, factor))
            elif axis < 3:
                place_terms.append((self._groups(group, label)[0], axis, factor))
            else:
                raise Refusal(f"{label} turns a node of a solid, which has no rotation; correct the deck")
        return tuple(place_terms)

    def _masses(self, masses: Sequence[deck.PointMass]) -> None:
        for mass in masses:
            point = mass.group in self.source.points
            places = [mass.group] if point else self._groups(mass.group, "a mass")
            inertia = mass.inertia if point else (0.0, 0.0, 0.0)  # a node of a solid has no rotation
            self._needs_coupling(mass.group, "mass")
            self.content.masses += [Mass(place, mass.value / len(places), inertia) for place in places]

    def _supports(self, supports: Sequence[deck.Support]) -> None:
        displaced = [support for support in supports if support.value]
        if displaced:
            self.notes.append(
                f"{self._count_of('supports', displaced)} with a displacement: give it as [prescribed.NAME]"
            )
        axes_of_group: dict[str, set[int]] = {}
        directed: list[tuple[str, int, Directions]] = []
        for support in supports:
            if not support.value and support.system is None:
                axes_of_group.setdefault(support.group, set()).add(support.axis)
            elif not support.value and support.system is not None:
                directed.append((support.group, support.axis, support.system))
        for group, axis, system in directed:
            point = group in self.source.points
            if point and (group in self.carried or group in self.axes_of):
                places = [group if axis < 3 else f"{group}.turn"]
            else:
                places = self._groups(group, "a support") if axis < 3 and not point else []
            self.content.constraints += [ClampAlong(place, system, (axis % 3,)) for place in places]
        for group, axes in axes_of_group.items():
            if group in self.source.points:
                if group not in self.carried and group not in self.axes_of:
                    self.notes.append(f"the support of point '{group}', which carries nothing")
                    continue
                self.content.clamps += _point_clamps(group, axes)
            else:
                letters = "".join(AXES[axis] for axis in sorted(axes) if axis < 3)
                places = self._groups(group, "a support") if letters else []
                self.content.clamps += [Clamp(place, letters) for place in places]

    # loads

    def _forces(self, forces: Sequence[deck.Force]) -> None:
        parts: list[tuple[Load, float]] = []
        for force in forces:
            direction = np.eye(3)[force.axis % 3]
            if force.group in self.source.points:
                self._needs_coupling(force.group, "force")
                kind = NodalForce if force.axis < 3 else Moment
                parts.append((kind(force.group, direction), force.value))
            elif force.axis >= 3:
                raise Refusal(f"a moment acts on '{force.group}', which has no rotation; couple it to a point")
            else:
                for place in self._groups(force.group, "a force"):
                    count = self.source.counts[force.group][self.body_of[place]]
                    parts.append((NodalForce(place, direction, "nodes"), count * force.value))
        self._load(parts)

    def _pressures(self, pressures: Sequence[deck.FacePressure]) -> None:
        self._load([(Pressure(place), p.value) for p in pressures for place in self._faces(p.face, "a pressure")])

    def _load(self, parts: Sequence[tuple[Load, float]]) -> None:
        self.content.load = Sum((*self.content.load.parts, *parts))

    # places

    def _points(self) -> None:
        """Reference points that something carries; what of them nothing moves is held."""
        for point in [*self.carried, *(p for p in self.axes_of if p not in self.carried)]:
            self.content.points[point] = self.source.points[point]
            if point not in self.carried:
                self.content.clamps += _point_clamps(point, set(ALL_AXES) - self.axes_of[point])
        idle = [point for point in self.source.points if point not in self.content.points]
        if idle:
            self.notes.append(f"points {', '.join(idle)}, which carry nothing")

    def _needs_coupling(self, group: str, label: str) -> None:
        if group in self.source.points and group not in self.carried and group not in self.axes_of:
            raise Refusal(f"a {label} acts on point '{group}', which is coupled to nothing; couple it to a face")

    def _faces(self, place: str, label: str) -> list[str]:
        if place in self.faces:
            return self.faces[place]
        kind = "is a set of nodes that make no face" if place in self.sets else "lies on no body"
        raise Refusal(f"{label}: '{place}' {kind}; give a surface of element faces")

    def _groups(self, place: str, label: str) -> list[str]:
        groups = self.faces.get(place, []) + self.sets.get(place, [])
        if not groups:
            raise Refusal(f"{label}: '{place}' lies on no body; correct the deck")
        return groups

    def _instead(self, kind: str, table: str) -> str:
        return f"give it as [{table}.NAME] of the scene and leave {kind} out of decks.{self.name}.use"

    def _count_of(self, kind: str, entries: Sequence[Any]) -> str:
        return f"1 of its {kind}" if len(entries) == 1 else f"{len(entries)} {kind}"


def _point_clamps(point: str, axes: set[int]) -> list[Clamp]:
    """Clamps of a reference point along axes 0..5."""
    shifts, turns = ("".join(AXES[axis % 3] for axis in sorted(axes) if axis // 3 == k) for k in (0, 1))
    return [Clamp(name, letters) for name, letters in ((point, shifts), (f"{point}.turn", turns)) if letters]


def part(name: str, table: Table, materials: Mapping[str, AnyMaterial], folder: Path) -> Part:
    """All that a deck says as one part: bodies, what joins and holds them, its loads.

    Raises  Refusal as `structure` does"""
    content = structure(name, table, materials, folder)
    assembly = Assembly(content.bodies, {point: list(place) for point, place in content.points.items()})
    material_of = {body.name: body.material for body in assembly.bodies}
    return build(
        assembly, assembly.node_sets, material_of, content.clamps, [], {load_name(name): content.load}, {},
        springs=content.springs, constraints=content.constraints, masses=content.masses,
    )  # fmt: skip
