"""Materials of an Abaqus or CalculiX deck, the directions of bodies made of them, springs and point masses."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from tribodyn.geometry.sources import abaqus, deck
from tribodyn.geometry.sources.abaqus_places import DeckPlaces
from tribodyn.geometry.sources.directions import Directions, ElementAxes, System, axis_rotation, orthogonal
from tribodyn.geometry.sources.keywords import Card
from tribodyn.refusal import Refusal


@dataclass
class MaterialCards(DeckPlaces):
    """Cards of materials, sections, masses and springs.

    materials : name in capitals -> material; material : name of the one whose cards follow
    warm : (n_point,) initial temperature of each point, NaN where none is given"""

    materials: dict[str, deck.DeckMaterial] = field(default_factory=dict)
    material: str = ""
    frictions: dict[str, float] = field(default_factory=dict)  # of surface interactions
    interaction: str = ""
    warm: np.ndarray = field(default_factory=lambda: np.empty(0))  # initial temperature of each point

    def __post_init__(self) -> None:
        super().__post_init__()
        self.warm = np.full(len(self.raw.points), np.nan)

    def _material(self, card: Card) -> None:
        self.material = card.option("NAME").upper()
        if self.material in self.materials:
            raise Refusal(f"{card.where} defines the material '{card.option('NAME')}' again: give each its own name")
        self.materials[self.material] = deck.DeckMaterial(card.option("NAME"))

    def _elastic(self, card: Card) -> None:
        kind = card.option("TYPE").upper() or "ISO"
        if kind.startswith("ISO") and (values := self._row(card, 2, 1)):
            self._give(card, young=values[0], poisson=values[1])
        elif kind.startswith("ENGINEERING") and (values := self._row(card, 9, 2)):
            self._give(card, engineering=tuple(values))
        elif kind.startswith("ORTHO") and (values := self._row(card, 9, 2)) and _regular(values):
            self._give(card, engineering=engineering_constants(values))
        elif kind.startswith("ANISO") and (values := self._row(card, 21, 3)):
            self._give(card, stiffness=anisotropic(values))
        elif kind.startswith(("ISO", "ENGINEERING", "ORTHO", "ANISO")):
            self._refused(card, kind)

    def _row(self, card: Card, count: int, lines: int) -> list[float]:
        """So many constants, each row on so many lines with its temperature behind it; none where they are not there.

        Several rows are taken at the initial temperature, and refused where that is not one for all"""
        rows = [[card.number(text) for line in card.data[i : i + lines] for text in line]
                for i in range(0, len(card.data), lines)]  # fmt: skip
        if not rows or len(rows[0]) < count:
            return []
        warm, at = self.warm[self.solid], [row[count] for row in rows if len(row) > count]
        if len(rows) == 1:
            return rows[0][:count]
        if len(at) < len(rows) or not (np.diff(at) > 0).all() or np.ptp(warm) != 0:
            self._refused(card, "at several temperatures")
            return rows[0][:count]
        self._give(card, tabulated=(*self.materials[self.material].tabulated, f"*{card.name}"))
        return [float(np.interp(warm[0], at, column)) for column in list(zip(*rows, strict=False))[:count]]

    def _density(self, card: Card) -> None:
        if values := self._row(card, 1, 1):
            self._give(card, density=values[0])

    def _expansion(self, card: Card) -> None:
        if values := self._row(card, 1, 1):
            self._give(card, expansion=values[0])

    def _give(self, card: Card, **values: object) -> None:
        if self.material not in self.materials:
            raise Refusal(f"{card.where} stands before any *MATERIAL: move it below its material")
        item = self.materials[self.material]
        if any(getattr(item, name) not in (None, (), value) for name, value in values.items() if name != "tabulated"):
            raise Refusal(f"{card.where} gives another value of material '{item.name}' than before: take one out")
        self.materials[self.material] = replace(item, **values)  # type: ignore[arg-type]

    def _surface_interaction(self, card: Card) -> None:
        self.interaction = card.option("NAME").upper()

    _change_friction = _surface_interaction  # has no name: what a step changes is not taken

    def _friction(self, card: Card) -> None:
        """The coefficient of an interaction where it is one for all; other kinds of friction are not taken."""
        other = {"ANISOTROPIC", "EXPONENTIALDECAY", "DEPENDENCIES", "USER", "ROUGH"} & card.options.keys()
        if self.interaction and len(card.data) == 1 and not other:
            self.frictions[self.interaction] = card.number(card.data[0][0])

    def _initial_conditions(self, card: Card) -> None:
        if card.option("TYPE").upper() == "TEMPERATURE":
            self.skipped.ignored["*INITIAL CONDITIONS, TEMPERATURE"] += 1
            for line in (line for line in card.data if len(line) > 1):
                with suppress(Refusal):  # of nodes that the deck has not: no table is taken at a temperature then
                    self.warm[self._rows(line[0], card)] = card.number(line[1])

    def _with_groups(self) -> Iterator[deck.DeckMaterial]:
        groups: dict[str, dict[str, Directions | None]] = {}
        for instance, scope in {**self.assembly.instances, "": self.assembly.top}.items():
            for card in scope.sections:
                elset, material = card.option("ELSET"), card.option("MATERIAL")
                if "COMPOSITE" in card.options:
                    continue
                if material.upper() not in self.materials:
                    raise Refusal(
                        f"*SOLID SECTION of '{elset}' names the material '{material}', which the deck has not: "
                        "correct the name or add the material"
                    )
                group_name = f"{instance}.{elset}" if instance else elset
                name = next((name for name in self.raw.volumes if name.upper() == group_name.upper()), None)
                if name:
                    groups.setdefault(material.upper(), {})[name] = self._directions(card, scope, instance)
        for key, item in self.materials.items():
            mine = groups.get(key, {})
            yield replace(item, groups=tuple(mine), directions={name: axes for name, axes in mine.items() if axes})

    def _directions(self, section: Card, scope: abaqus.Scope, instance: str) -> Directions | None:
        """Axes of the material of a section, None for x, y, z."""
        name = section.option("ORIENTATION")
        if not name:
            return None
        scope = scope if name.upper() in scope.orientations else self.assembly.top
        card = scope.orientations.get(name.upper())
        if card is None:
            raise Refusal(f"{section.where} names the orientation '{name}', which the deck has not: add it")
        if card.option("DEFINITION").upper() not in ("", "COORDINATES") or not card.data:
            return None
        turn, shift = self.assembly.moves.get(instance, (np.eye(3), np.zeros(3)))
        local = np.eye(3)
        if len(card.data) > 1 and card.data[1][0]:
            axis, angle = card.floats(card.data[1], 2)
            if axis not in (1.0, 2.0, 3.0):
                raise Refusal(f"{card.where} turns about axis {axis:g}: give 1, 2 or 3")
            local = axis_rotation(int(axis) - 1, angle)
        table = scope.distributions.get(card.data[0][0].upper())
        if table is not None:
            return self._listed(table, instance, turn, local)
        points = np.array(card.floats(card.data[0], 9)).reshape(3, 3)
        kind = card.option("SYSTEM").upper() or "RECTANGULAR"
        if kind in ("RECTANGULAR", "Z RECTANGULAR"):
            rows = orthogonal(points[0] - points[2], points[1] - points[2])
            if kind[0] == "Z":  # the first is z, the second x
                rows = np.roll(rows, -1, axis=0)
            system = System("rectangular", np.zeros(3), rows, local)
        elif kind in ("CYLINDRICAL", "SPHERICAL"):
            pole = points[1] - points[0]
            other_axis = np.eye(3)[np.abs(pole).argmin()]
            system = replace(System.of_points(kind.lower(), points[0], points[1], points[0] + other_axis), turn=local)
        else:
            return None
        return system.transformed(turn, shift)

    def _listed(self, card: Card, instance: str, turn: np.ndarray, local: np.ndarray) -> ElementAxes:
        """Axes element by element; elements that no line names have the axes of the first line."""
        centres = np.vstack([self.raw.points[block.nodes].mean(axis=1) for block in self.raw.cells])
        mine = [number for (where, _), number in self.number.items() if where == instance]  # labels are those of a part
        axes: list[np.ndarray] = []
        axes_of = np.zeros(len(centres), dtype=int)
        for line in card.data:
            points = np.array(card.floats(line[1:], 6)).reshape(2, 3)
            if line[0]:
                try:
                    named = self.assembly.elements(line[0], instance)
                except KeyError:
                    raise Refusal(f"{card.where} names the elements '{line[0]}', which the deck has not") from None
                axes_of[[self.number[key] for key in named if key in self.number]] = len(axes)
            axes.append(local @ orthogonal(*points) @ turn.T)
        return ElementAxes(centres[mine], np.array(axes)[axes_of[mine]])

    # masses and springs

    def _springs(self) -> Iterator[deck.DeckSpring]:
        for card, kind, rows in self._members("SPRING"):
            axes = [card.axis(text) for line in card.data[:-1] for text in line if text]
            if len(axes) != {"SPRING1": 1, "SPRING2": 2}.get(kind, 0) or any(card.data[-1][1:]):
                self._refused(card, f"of {kind} with other numbers than its directions and a stiffness")
                continue
            terms = [(r, axis, s) for r, axis, s in zip(rows, axes, (1.0, -1.0), strict=False)]
            if kind == "SPRINGA":
                direction = np.subtract(*self.raw.points[rows[::-1]])
                if not direction.any():
                    raise Refusal(f"{card.where} has a SPRINGA between nodes at one place: take a SPRING2")
                factors = direction / np.linalg.norm(direction)
                terms = [(r, k, s * f) for r, s in zip(rows, (-1, 1), strict=True) for k, f in enumerate(factors)]
            terms_of_nodes = tuple((*self._dof(r, axis), float(factor)) for r, axis, factor in terms if factor)
            yield deck.DeckSpring(terms_of_nodes, card.number(card.data[-1][0]))

    def _masses(self) -> Iterator[deck.PointMass]:
        for card, _, rows in self._members("MASS"):
            yield deck.PointMass(self._node(rows[0]), card.number(card.data[0][0]))

    def _members(self, name: str) -> Iterator[tuple[Card, str, list[int]]]:
        """Card, type and points of each element that a card of a name is for; one that has no card is refused."""
        scopes = {**self.assembly.instances, "": self.assembly.top}
        elements = {(where, label): kind for where, of in scopes.items() for label, (kind, _) in of.elements.items()}
        lone = {key: kind for key, kind in elements.items() if kind.startswith(name)}
        for instance, card in ((instance, card) for instance, scope in scopes.items() for card in scope.lumped):
            if not card.data:
                raise Refusal(f"{card.where} has no mass or stiffness: write it below")
            for where, label in self.assembly.elements(card.option("ELSET"), instance) if card.name == name else ():
                kind, nodes = self.assembly.scope(where).elements[label]
                lone.pop((where, label), None)
                if kind.startswith(name):
                    yield card, kind, [self.row[where, node] for node in nodes]
                else:
                    self._refused(card, f"of elements of type {kind}")
        for kind in sorted(set(lone.values())):
            self.skipped.refuse(f"elements of type {kind} without *{name}")


def engineering_constants(D: list[float]) -> tuple[float, ...]:
    """(E1, E2, E3, nu12, nu13, nu23, G12, G13, G23) from D1111, D1122, D2222, D1133, D2233, D3333, D1212, D1313, ..."""
    S = np.linalg.inv(_normal_block(D))
    E = 1 / np.diag(S)
    return (*E.tolist(), float(-S[0, 1] * E[0]), float(-S[0, 2] * E[0]), float(-S[1, 2] * E[1]), *D[6:9])


def anisotropic(D: list[float]) -> tuple[tuple[float, ...], ...]:
    """The stiffness in our order of 21 values: columns of its upper triangle, stresses 11, 22, 33, 12, 13, 23."""
    by_rows = [D[j * (j + 1) // 2 + i] for i in range(6) for j in range(i, 6)]
    return deck.stiffness(by_rows, (0, 1, 2, 5, 4, 3))


def _normal_block(D: list[float]) -> np.ndarray:
    return np.array([[D[0], D[1], D[3]], [D[1], D[2], D[4]], [D[3], D[4], D[5]]])


def _regular(D: list[float]) -> bool:
    """Whether a stiffness can be inverted; the stiffness of a fluid cannot."""
    return bool(np.linalg.eigvalsh(_normal_block(D))[0] > 0)
