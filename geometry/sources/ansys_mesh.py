"""The mesh of an ANSYS archive: nodes, elements and components, in blocks of fixed width or by commands.

Bricks with nodes that coincide are the tetrahedra, prisms and pyramids that they stand for.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tribodyn.geometry.sources.directions import axis_rotation
from tribodyn.geometry.sources.raw_mesh import LabelledMesh
from tribodyn.refusal import Refusal


@dataclass
class ArchiveMesh:
    """Blocks and commands of an archive that make its mesh.

    i : the next line; types, options : of elements, by the number of their kind
    of_solids : volume group -> its material and local system; node_axes : node -> its axes
    """

    path: Path
    lines: list[str]
    mesh: LabelledMesh
    i: int = 0
    types: dict[int, int] = field(default_factory=dict)
    options: dict[int, dict[int, str]] = field(default_factory=dict)
    of_solids: dict[str, tuple[int, int]] = field(default_factory=dict)
    node_axes: dict[int, np.ndarray] = field(default_factory=dict)

    def nblock(self, words: list[str]) -> None:
        """Nodes, and where they are turned their angles."""
        width, count, wide = self._widths()
        while self.i < len(self.lines) and not self.lines[self.i].lstrip().startswith(("N,", "-1")):
            line = self.lines[self.i]
            try:
                starts = range(width * count, len(line.rstrip()), wide)
                self._node(int(line[:width]), [float(line[k : k + wide].strip() or 0) for k in starts])
            except ValueError:
                raise Refusal(
                    f"'{self.path}' has a broken node at line {self.i + 1}: '{line.strip()[:40]}': write it again"
                ) from None
            self.i += 1
        if self.i == len(self.lines):
            raise Refusal(f"'{self.path}' ends inside its nodes (NBLOCK): the file is cut off")
        self.i += 1

    def n(self, words: list[str]) -> None:
        """A node by a command of its own."""
        if words[1].isdigit():
            self._node(int(words[1]), [float(word or 0) for word in words[2:8]])

    def _node(self, label: int, values: list[float]) -> None:
        x, y, z, *angles = (values + [0.0] * 6)[:6]
        self.mesh.points[label] = [x, y, z]
        if any(angles):
            self.node_axes[label] = euler_axes(angles)

    def eblock(self, words: list[str]) -> None:
        """Elements."""
        if words[2].upper() != "SOLID":
            self.mesh.skipped.refuse(f"EBLOCK, {words[2]}")
            return
        width, _, _ = self._widths()
        while self.i < len(self.lines) and self.lines[self.i].strip() != "-1":
            head = self._numbers(width)
            if len(head) < 11:
                raise Refusal(f"'{self.path}' has a broken element at line {self.i}: the file is cut off")
            nodes, count = head[11:], head[8]
            while len(nodes) < count and self.i < len(self.lines):
                nodes += self._numbers(width)
            kind = self.types.get(head[1], head[1])
            if head[1] in self.types and kind not in SOLID_TYPES:
                self._no_solid(head[1], kind)
                continue
            if kind in LAYERED and self.options.get(head[1], {}).get(3) == "1":
                self.mesh.skipped.refuse(f"layered elements of type {kind}")
            shape, members = _solid(nodes[:count])
            name = f"material {head[0]}" + (f" in system {head[4]}" if head[4] else "")
            self.of_solids[name] = head[0], head[4]
            self.mesh.solid(shape, head[10], members, name)
        if self.i == len(self.lines):
            raise Refusal(f"'{self.path}' ends inside its elements (EBLOCK): the file is cut off")
        self.i += 1

    def _no_solid(self, number: int, kind: int) -> None:
        """An element that is none of a solid: of no effect here, or refused."""
        options = self.options.get(number, {})
        glued = any(options.get(key) in values for key, values in BONDED.items())
        if kind in HARMLESS_TYPES or (kind in CONTACT_TYPES and not glued):
            self.mesh.skipped.ignored[f"elements of type {kind}"] += 1
        else:
            self.mesh.skipped.refuse(f"elements of type {kind}{', bonded' if glued else ''}")

    def cmblock(self, words: list[str]) -> None:
        """A component; a negative number ends a range."""
        width, _, _ = self._widths()
        items: list[int] = []
        while len(items) < int(words[3].split()[0]):
            if self.i == len(self.lines):
                raise Refusal(f"'{self.path}' ends inside a component (CMBLOCK): the file is cut off")
            items += self._numbers(width)
        members: list[int] = []
        for item in items:
            members += [item] if item > 0 else range(members[-1] + 1, -item + 1)
        (self.mesh.node_sets if words[2].upper().startswith("NODE") else self.mesh.volumes)[words[1]] = members

    def _widths(self) -> tuple[int, int, int]:
        """Width of an integer, integers on a line, width of a number, from a line such as (3i9,6e21.13e3)."""
        line = self.lines[self.i].strip() if self.i < len(self.lines) else ""
        layout = re.match(r"\((\d+)[iI](\d+)(?:,\s*\d+[eE](\d+))?", line)
        if layout is None:
            raise Refusal(f"'{self.path}' has a block with the format '{line}': expected one as (3i9,6e21.13e3)")
        self.i += 1
        return int(layout[2]), int(layout[1]), int(layout[3] or 0)

    def _numbers(self, width: int) -> list[int]:
        """Whole numbers of the next line."""
        line = self.lines[self.i].rstrip()
        self.i += 1
        try:
            return [int(line[k : k + width]) for k in range(0, len(line), width)]
        except ValueError:
            raise Refusal(f"'{self.path}' has a broken element at line {self.i}: the file is cut off") from None

    def et(self, words: list[str]) -> None:
        """Kind of elements of a number."""
        self.types[int(words[1])] = int(re.sub(r"\D", "", words[2]) or 0)
        self.options[int(words[1])] = {key: word for key, word in enumerate(words[3:9], 1) if word}

    def keyopt(self, words: list[str]) -> None:
        """An option of such a kind."""
        self.options.setdefault(int(words[1]), {})[int(words[2])] = words[3]


# equal corners of a brick I..P -> (kind, its corners, its edge nodes) among the twenty nodes
_TETRA = ("tetra", [0, 1, 2, 4], [8, 9, 11, 16, 17, 18])
_WEDGE = ("wedge", [0, 1, 2, 4, 5, 6], [8, 9, 11, 12, 13, 15, 16, 17, 18])
_PYRAMID = ("pyramid", [0, 1, 2, 3, 4], [8, 9, 10, 11, 16, 17, 18, 19])
_BRICK = ("hexahedron", list(range(8)), list(range(8, 20)))
_SECOND = {"tetra": "tetra10", "wedge": "wedge15", "pyramid": "pyramid13", "hexahedron": "hexahedron20"}
SOLID_TYPES = {5, 45, 62, 64, 65, 69, 70, 72, 73, 87, 90, 92, 95, 96, 147, 148, 168, 185, 186, 187, 225, 226, 227}
SOLID_TYPES |= {278, 279, 285, 291}
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
