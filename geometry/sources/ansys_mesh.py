"""The mesh of an ANSYS archive: nodes, elements and components, in blocks of fixed width or by commands.

Bricks with nodes that coincide are the tetrahedra, prisms and pyramids that they stand for."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from tribodyn.geometry.sources.directions import axis_rotation
from tribodyn.geometry.sources.raw_mesh import LabelledMesh
from tribodyn.refusal import Refusal
from tribodyn.text_file import finite


@dataclass
class ArchiveMesh:
    """Blocks and commands of an archive that make its mesh.

    i : the next line
    types : number of an element type -> ANSYS's element, such as 186; options : of it, by the number of the KEYOPT
    of_solids : volume group -> number of its material, of its local system
    node_axes : node -> its axes (3, 3), where they are turned"""

    path: Path
    lines: list[str]
    mesh: LabelledMesh
    i: int = 0
    types: dict[int, int] = field(default_factory=dict)
    options: dict[int, dict[int, str]] = field(default_factory=dict)
    of_solids: dict[str, tuple[int, int]] = field(default_factory=dict)
    node_axes: dict[int, np.ndarray] = field(default_factory=dict)

    def nblock(self, words: list[str]) -> None:
        """Nodes: a number, integers of the solid model, x, y, z and the angles of turned axes."""
        for row in self._rows("NBLOCK", words[4]):
            self._node(int(row[0]), [value for value in row if isinstance(value, float)])

    def n(self, words: list[str]) -> None:
        """A node by a command; the end of a block of nodes is one without a number."""
        if words[1].isdigit():
            self._node(int(words[1]), [finite(word) for word in words[2:8]])

    def _node(self, label: int, values: list[float]) -> None:
        x, y, z, *angles = (values + [0.0] * 6)[:6]
        self.mesh.point(label, [x, y, z])
        if any(angles):
            self.node_axes[label] = euler_axes(angles)

    def eblock(self, words: list[str]) -> None:
        """Elements: eleven numbers, the ninth how many nodes follow; what has no room goes on in the next line."""
        if words[2].upper() != "SOLID":
            self.mesh.skipped.refuse(f"EBLOCK, {words[2]}")
            return
        rows = (list(map(int, row)) for row in self._rows("EBLOCK"))
        for row in rows:
            while len(row) < 11 or len(row) < 11 + row[8]:
                row += next(rows, []) or self._end("EBLOCK")
            material, number, _, _, system, death, _, _, count, _, label, *nodes = row
            kind = self.types.get(number, number)
            if kind not in SOLID_TYPES:
                self._no_solid(number, kind)
                continue
            known = (2, 8, 17) if kind in LAYERED else (5, 6) if kind < min(LAYERED) else ()  # technology, output
            for key in (
                key for key, value in self.options.get(number, {}).items() if value != "0" and key not in known
            ):
                self.mesh.skipped.refuse(f"elements of type {kind} with option {key}")
            if death:
                self.mesh.skipped.refuse("EBLOCK, elements that are dead")
            shape, members = _solid(nodes[:count])
            if kind == 185:
                technology = self.options.get(number, {}).get(2, "0")
                self.mesh.formulations[label] = SOLID185.get(technology, "linear_incompatible")
            name = f"material {material}" + (f" in system {system}" if system else "")
            self.of_solids[name] = material, system
            self.mesh.solid(shape, label, members, name)

    def _no_solid(self, number: int, kind: int) -> None:
        """An element of another kind: named as of no effect here, or refused."""
        options = self.options.get(number, {})
        glued = any(options.get(key) in values for key, values in BONDED.items())
        if kind in HARMLESS_TYPES or (kind in CONTACT_TYPES and not glued):
            self.mesh.skipped.ignored[f"elements of type {kind}"] += 1
        else:
            unknown = "" if number in self.types else ", which no ET names"
            self.mesh.skipped.refuse(f"elements of type {kind}{', bonded' if glued else unknown}")

    def cmblock(self, words: list[str]) -> None:
        """A component: numbers of nodes or elements; a negative one ends a range."""
        columns, count = self._columns(), int(words[3])
        items: list[int] = []
        while len(items) < count:
            items += map(int, self._row("CMBLOCK", columns))
        members: list[int] = []
        for item in items:
            members += [item] if item > 0 else range(members[-1] + 1, -item + 1)
        (self.mesh.node_sets if words[2].upper().startswith("NODE") else self.mesh.volumes)[words[1]] = members

    def etblock(self, words: list[str]) -> None:
        """Element types: their number, ANSYS's element and its options."""
        for number, kind, *options in self._rows("ETBLOCK", words[1]):
            self.et(["", f"{number}", f"{kind}"])
            self.options[int(number)] = {key: f"{value}" for key, value in enumerate(options, 1) if value}

    def et(self, words: list[str]) -> None:
        """An element type: its number, ANSYS's element and options."""
        self.types[int(words[1])] = int(re.sub(r"\D", "", words[2]) or 0)
        self.options[int(words[1])] = {key: word for key, word in enumerate(words[3:9], 1) if word}

    def keyopt(self, words: list[str]) -> None:
        """An option of an element type."""
        self.options.setdefault(int(words[1]), {})[int(words[2])] = words[3]

    def _rows(self, block: str, count: str = "") -> Iterator[list[float]]:
        """The lines of a block as numbers; it ends with -1 or, of nodes, a command N.

        count : how many lines the block says it has, "" where it does not say"""
        columns, start = self._columns(), self.i
        while not self.lines[self.i : self.i + 1] or not self.lines[self.i].lstrip().startswith(("-1", "N,")):
            yield self._row(block, columns)
        if count.isdigit() and int(count) != self.i - start:
            raise Refusal(f"{block} of '{self.path}' has {self.i - start} lines of {count}: write the file again")
        self.i += 1

    def _row(self, block: str, columns: list[tuple[int, int, Callable[[str], float]]]) -> list[float]:
        """The numbers of the next line, integers and reals as its columns are; blanks are zeros."""
        if self.i == len(self.lines):
            self._end(block)
        line = self.lines[self.i].rstrip()
        self.i += 1
        try:
            if not line or len(line) > columns[-1][1]:
                raise ValueError("empty or too long")
            return [number(line[start:end].strip() or "0") for start, end, number in columns if start < len(line)]
        except ValueError:
            raise Refusal(
                f"'{self.path}' has a broken {block} at line {self.i}: '{line.strip()[:40]}': write it again"
            ) from None

    def _end(self, block: str) -> NoReturn:
        raise Refusal(f"'{self.path}' ends inside a block ({block}): the file is cut off")

    def _columns(self) -> list[tuple[int, int, Callable[[str], float]]]:
        """Start, end and kind of the columns of a block, from a line such as (1i7,2i9,6e21.13e3)."""
        line = "".join(self.lines[self.i : self.i + 1]).strip()
        fields = re.findall(r"(\d*)([a-zA-Z])(\d+)(?:\.\d+(?:[eE]\d+)?)?(?=[,)])", line)
        kinds: dict[str, Callable[[str], float]] = {"i": int, "a": int, "e": finite, "g": finite, "f": finite}
        columns: list[tuple[int, int, Callable[[str], float]]] = []
        for repeat, kind, width in fields:
            for _ in range(int(repeat or 1) if kind.lower() in kinds else 0):
                start = columns[-1][1] if columns else 0
                columns.append((start, start + int(width), kinds[kind.lower()]))
        if not columns or line.count(",") + 1 != len(fields):
            raise Refusal(f"'{self.path}' has a block with the format '{line}': expected one as (3i9,6e21.13e3)")
        self.i += 1
        return columns


# equal corners of a brick I..P -> (kind, its corners, its edge nodes) among the twenty nodes
_TETRA = ("tetra", [0, 1, 2, 4], [8, 9, 11, 16, 17, 18])
_WEDGE = ("wedge", [0, 1, 2, 4, 5, 6], [8, 9, 11, 12, 13, 15, 16, 17, 18])
_PYRAMID = ("pyramid", [0, 1, 2, 3, 4], [8, 9, 10, 11, 16, 17, 18, 19])
_BRICK = ("hexahedron", list(range(8)), list(range(8, 20)))
_SECOND = {"tetra": "tetra10", "wedge": "wedge15", "pyramid": "pyramid13", "hexahedron": "hexahedron20"}
SOLID_TYPES = {5, 45, 62, 64, 65, 69, 70, 72, 73, 87, 90, 92, 95, 96, 147, 148, 168, 185, 186, 187, 225, 226, 227}
SOLID_TYPES |= {278, 279, 285, 291}
SOLID185 = {"0": "linear_bbar", "1": "linear_reduced"}  # by its option 2; others are enhanced strains
HARMLESS_TYPES = {154: "they carry loads", 169: "contact", 170: "contact", 200: "they only mesh"}
CONTACT_TYPES = range(171, 179)
LAYERED = (185, 186)  # by their option 3
BONDED = {2: ("2",), 12: ("5", "6")}  # options of a contact that glues: constraint equations, bonded always or at first


def euler_axes(angles: list[float]) -> np.ndarray:
    """Axes (3, 3), rows, turned by angles [degrees] about z, about the new x, and about the y after both."""
    z, x, y = angles
    return np.asarray(axis_rotation(1, y) @ axis_rotation(0, x) @ axis_rotation(2, z))


def _solid(nodes: list[int]) -> tuple[str, list[int]]:
    """Kind and nodes of a solid, by which of its corners coincide."""
    if len(nodes) in (4, 10):
        kind, corners, edges = "tetra", [0, 1, 2, 3], list(range(4, 10))
    else:
        k, l, m, n, o, p = nodes[2:8]
        folded, pointed = k == l, m == n == o == p
        kind, corners, edges = (
            _TETRA if folded and pointed else _WEDGE if folded and o == p else _PYRAMID if pointed else _BRICK
        )
    if len(nodes) > max(edges) and all(nodes[e] for e in edges):
        return _SECOND[kind], [nodes[c] for c in [*corners, *edges]]
    return kind, [nodes[c] for c in corners]
