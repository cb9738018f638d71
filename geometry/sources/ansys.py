"""ANSYS archives (.cdb): NBLOCK, EBLOCK, components, materials, supports and forces.

Bricks with nodes that coincide are the tetrahedra, prisms and pyramids that they stand for.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from tribodyn.geometry.sources import deck
from tribodyn.geometry.sources.raw import LabelledMesh, RawMesh

# equal corners of a brick I..P -> (kind, its corners, its edge nodes) among the twenty nodes
_TETRA = ("tetra", [0, 1, 2, 4], [8, 9, 11, 16, 17, 18])
_WEDGE = ("wedge", [0, 1, 2, 4, 5, 6], [8, 9, 11, 12, 13, 15, 16, 17, 18])
_PYRAMID = ("pyramid", [0, 1, 2, 3, 4], [8, 9, 10, 11, 16, 17, 18, 19])
_BRICK = ("hexahedron", list(range(8)), list(range(8, 20)))
_SECOND = {"tetra": "tetra10", "wedge": "wedge15", "pyramid": "pyramid13", "hexahedron": "hexahedron20"}
_MATERIAL = {"EX": "young", "NUXY": "poisson", "PRXY": "poisson", "DENS": "density", "ALPX": "expansion"}
_AXES = {"UX": 0, "UY": 1, "UZ": 2, "FX": 0, "FY": 1, "FZ": 2}
SOLID_TYPES = {5, 45, 62, 64, 65, 69, 70, 72, 73, 87, 90, 92, 95, 96, 147, 148, 168, 185, 186, 187, 225, 226, 227}
SOLID_TYPES |= {278, 279, 285, 291}
SILENT = {
    "FINISH", "NUMOFF", "DOF", "KEYOPT", "KEYOP", "MPTEMP", "EXTOPT", "ETBLOCK", "-1", "N", "MPDATA", "MP", "SHPP",
}  # fmt: skip


def read(path: Path) -> RawMesh:
    """Read an archive. Raises ValueError: one sentence that names the block and the cure."""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    mesh = LabelledMesh()
    constants: dict[int, dict[str, float]] = {}
    types: dict[int, int] = {}
    forces: list[deck.Force] = []
    i = 0
    while i < len(lines):
        words = [word.strip() for word in lines[i].split(",")]
        name = words[0].upper()
        i += 1
        if name == "NBLOCK":
            i = _nblock(lines, i, mesh.points, path)
        elif name == "EBLOCK" and len(words) > 2 and words[2].upper() == "SOLID":
            i = _eblock(lines, i, mesh, types, path)
        elif name == "CMBLOCK":
            i, members = _cmblock(lines, i, int(words[3].split()[0]), path)
            (mesh.node_sets if words[2].upper().startswith("NODE") else mesh.volumes)[words[1]] = members
        elif name == "ET" and len(words) > 2:
            types[int(words[1])] = int(re.sub(r"\D", "", words[2]) or 0)
        elif name == "MPDATA" and len(words) > 6 and words[3] in _MATERIAL:
            constants.setdefault(int(words[4]), {})[_MATERIAL[words[3]]] = float(words[6])
        elif name == "MP" and len(words) > 3 and words[1].upper() in _MATERIAL:
            constants.setdefault(int(words[2]), {})[_MATERIAL[words[1].upper()]] = float(words[3])
        elif name == "D" and len(words) > 2 and words[1].isdigit() and words[2] in _AXES:
            value = float(words[3]) if len(words) > 3 and words[3] else 0.0
            mesh.held.setdefault((_AXES[words[2]], value), []).append(int(words[1]))
        elif name == "F" and len(words) > 3 and words[1].isdigit() and words[2] in _AXES:
            forces.append(deck.Force(mesh.at(int(words[1])), _AXES[words[2]], float(words[3])))
        elif name and name not in SILENT and not name.startswith(("!", "(", "_", "/", "*")):
            mesh.ignored[name] += 1
    materials = tuple(
        replace(
            deck.DeckMaterial(f"material {number}", groups=tuple({f"material {number}"} & set(mesh.volumes))),
            **given,  # type: ignore[arg-type]
        )
        for number, given in constants.items()
    )
    return mesh.raw(path, "commands", deck.Deck(materials=materials, forces=tuple(forces)))


def _widths(line: str, path: Path) -> tuple[int, int, int]:
    """Width of an integer, integers on a line, width of a number, from a line such as (3i9,6e21.13e3)."""
    found = re.match(r"\((\d+)[iI](\d+)(?:,\s*\d+[eE](\d+))?", line.strip())
    if found is None:
        raise ValueError(f"'{path}' has a block with the format '{line.strip()}': expected one such as (3i9,6e21.13e3)")
    return int(found[2]), int(found[1]), int(found[3] or 0)


def _nblock(lines: list[str], i: int, points: dict[int, list[float]], path: Path) -> int:
    width, count, wide = _widths(lines[i], path)
    i += 1
    while i < len(lines) and not lines[i].lstrip().startswith(("N,", "-1")):
        line = lines[i]
        try:
            values = [line[width * count + k * wide : width * count + (k + 1) * wide] for k in range(3)]
            points[int(line[:width])] = [float(value or 0) if value.strip() else 0.0 for value in values]
        except ValueError:
            raise ValueError(
                f"'{path}' has a broken node at line {i + 1}: '{line.strip()[:40]}': write it again"
            ) from None
        i += 1
    if i == len(lines):
        raise ValueError(f"'{path}' ends inside its nodes (NBLOCK): the file is cut off")
    return i + 1


def _eblock(lines: list[str], i: int, mesh: LabelledMesh, types: dict[int, int], path: Path) -> int:
    width, _, _ = _widths(lines[i], path)
    i += 1

    def numbers(line: str) -> list[int]:
        line = line.rstrip()
        try:
            return [int(line[k : k + width]) for k in range(0, len(line), width)]
        except ValueError:
            raise ValueError(f"'{path}' has a broken element at line {i + 1}: the file is cut off") from None

    while i < len(lines) and lines[i].strip() != "-1":
        head = numbers(lines[i])
        i += 1
        if len(head) < 11:
            raise ValueError(f"'{path}' has a broken element at line {i}: the file is cut off")
        nodes, count = head[11:], head[8]
        while len(nodes) < count and i < len(lines):
            nodes += numbers(lines[i])
            i += 1
        if types.get(head[1]) not in SOLID_TYPES and head[1] in types:
            mesh.ignored[f"elements of type {types[head[1]]}, which are no solids"] += 1
            continue
        kind, members = _solid(nodes[:count])
        mesh.solid(kind, head[10], members, f"material {head[0]}")
    if i == len(lines):
        raise ValueError(f"'{path}' ends inside its elements (EBLOCK): the file is cut off")
    return i + 1


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


def _cmblock(lines: list[str], i: int, count: int, path: Path) -> tuple[int, list[int]]:
    """Members of a component; a negative number ends a range."""
    width, _, _ = _widths(lines[i], path)
    i += 1
    items: list[int] = []
    while len(items) < count:
        if i == len(lines):
            raise ValueError(f"'{path}' ends inside a component (CMBLOCK): the file is cut off")
        line = lines[i].rstrip()
        items += [int(line[k : k + width]) for k in range(0, len(line), width)]
        i += 1
    members: list[int] = []
    for item in items:
        members += [item] if item > 0 else range(members[-1] + 1, -item + 1)
    return i, members
