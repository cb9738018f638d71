"""Nastran bulk data: grid points, solids, properties, materials, sets, supports, forces, rigid elements.

Free, small and large fields. meshio reads neither sets nor what is fixed, and loses second-order solids.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from tribodyn.geometry.sources import deck
from tribodyn.geometry.sources.raw import LabelledMesh, RawMesh

# card -> (kind of first order, kind of second order, where meshio's nodes stand)
SOLIDS = {
    "CTETRA": ("tetra", "tetra10", list(range(10))),
    "CPYRAM": ("pyramid", "pyramid13", list(range(13))),
    "CPENTA": ("wedge", "wedge15", [*range(9), 12, 13, 14, 9, 10, 11]),
    "CHEXA": ("hexahedron", "hexahedron20", [*range(12), 16, 17, 18, 19, 12, 13, 14, 15]),
}
CORNERS = {"CTETRA": 4, "CPYRAM": 5, "CPENTA": 6, "CHEXA": 8}
SILENT = {"ENDDATA", "PARAM", "PSOLID", "BEGIN"}
_EXPONENT = re.compile(r"(?<=[\d.])([+-]\d+)$")


def read(path: Path) -> RawMesh:
    """Read bulk data. Raises ValueError: one sentence that names the card and the cure."""
    text = path.read_text(encoding="utf-8", errors="replace")
    mesh, sets = LabelledMesh(), dict(_case_sets(text))
    properties: dict[int, int] = {}
    materials: dict[int, deck.DeckMaterial] = {}
    forces: list[deck.Force] = []
    couplings: list[deck.Coupling] = []
    masses: list[deck.PointMass] = []
    for name, fields in _cards(text, path):
        if name == "GRID":
            if fields[1] not in ("", "0"):
                raise ValueError(f"GRID {fields[0]} of '{path}' is in system {fields[1]}: write the basic system")
            mesh.points[_int(fields[0], name)] = [_float(x, name) for x in fields[2:5]]
        elif name in SOLIDS:
            nodes = [_int(x, name) for x in fields[2:] if x]
            low, high, order = SOLIDS[name]
            if len(nodes) < CORNERS[name]:
                raise ValueError(
                    f"{name} {fields[0]} of '{path}' has {len(nodes)} nodes: the file is cut off or broken"
                )
            whole = len(nodes) >= len(order)
            kept = [nodes[i] for i in order] if whole else nodes[: CORNERS[name]]
            mesh.solid(high if whole else low, _int(fields[0], name), kept, f"PSOLID {_int(fields[1], name)}")
        elif name == "PSOLID":
            properties[_int(fields[0], name)] = _int(fields[1], name)
        elif name == "MAT1":
            young, shear, poisson, density, expansion = [_float(x, name) if x else None for x in fields[1:6]]
            if poisson is None and young and shear:
                poisson = young / (2 * shear) - 1
            number = _int(fields[0], name)
            materials[number] = deck.DeckMaterial(f"MAT1 {number}", young, poisson, density, expansion)
        elif name == "SET1":
            sets[_int(fields[0], name)] = _thru(fields[1:])
        elif name in ("SPC1", "SPC"):
            for label, axis, value in _supports(name, fields):
                mesh.held.setdefault((axis, value), []).append(label)
        elif name == "FORCE":
            place, scale = mesh.at(_int(fields[1], name)), _float(fields[3], name)
            values = [scale * _float(x, name) for x in fields[4:7]]
            forces += [deck.Force(place, axis, value) for axis, value in enumerate(values) if value]
        elif name == "RBE2":
            group = f"RBE2 {len(couplings) + 1}"
            mesh.node_sets[group] = _thru(fields[3:])
            axes = tuple(int(x) - 1 for x in fields[2])
            couplings.append(deck.Coupling(group, "kinematic", mesh.at(_int(fields[1], name)), group, axes))
        elif name == "CONM2":
            masses.append(deck.PointMass(mesh.at(_int(fields[1], name)), _float(fields[3], name)))
        elif name not in SILENT:
            mesh.ignored[name] += 1
    labels = {label for elements in mesh.solids.values() for label, _ in elements}
    for number, members in sets.items():
        if all(label in mesh.points for label in members):
            mesh.node_sets[f"SET {number}"] = members
        elif labels.issuperset(members):
            mesh.volumes[f"SET {number}"] = members
        else:
            mesh.ignored[f"SET {number}, whose members are neither grid points nor solids"] += 1
    made_of: dict[int, list[str]] = {}
    for number, material in properties.items():
        if f"PSOLID {number}" in mesh.volumes:
            made_of.setdefault(material, []).append(f"PSOLID {number}")
    found = deck.Deck(
        materials=tuple(replace(one, groups=tuple(made_of.get(number, ()))) for number, one in materials.items()),
        couplings=tuple(couplings),
        forces=tuple(forces),
        masses=tuple(masses),
    )
    return mesh.raw(path, "cards", found)


def _cards(text: str, path: Path) -> Iterator[tuple[str, list[str]]]:
    """Name and fields of each card of the bulk data, continuation lines joined."""
    lines = text.splitlines()
    start = next((i + 1 for i, line in enumerate(lines) if line.upper().split()[:2] == ["BEGIN", "BULK"]), 0)
    name, fields = "", []
    for line in lines[start:]:
        line = line.split("$")[0].rstrip()
        if not line.strip():
            continue
        head, more = _fields(line)
        if head in ("", "+", "*") or head[0] in "+*":
            fields += more
            continue
        if name:
            yield name, fields + [""] * 8
        name, fields = head.rstrip("*").upper(), more
    if name:
        yield name, fields + [""] * 8


def _fields(line: str) -> tuple[str, list[str]]:
    if "," in line:
        head, *more = [item.strip() for item in line.split(",")]
        return head, (more + [""] * 8)[:8]
    line = line.expandtabs(8)
    head = line[:8].strip()
    width, count = (16, 4) if "*" in head else (8, 8)
    return head, [line[8 + i * width : 8 + (i + 1) * width].strip() for i in range(count)]


def _case_sets(text: str) -> Iterator[tuple[int, list[int]]]:
    """SET n = 1, 5 THRU 9 of the case control, with lines that a comma continues."""
    control = re.split(r"(?im)^\s*BEGIN\s+BULK", text)[0] if re.search(r"(?im)^\s*BEGIN\s+BULK", text) else ""
    for number, items in re.findall(r"(?im)^\s*SET\s+(\d+)\s*=\s*((?:[^\n]*,[ \t]*\n)*[^\n]*)", control):
        words = items.replace(",", " ").split()
        if all(word.isdigit() or word.upper() == "THRU" for word in words):
            yield int(number), _thru(words)


def _thru(words: list[str]) -> list[int]:
    found: list[int] = []
    words = [word for word in words if word]
    i = 0
    while i < len(words):
        if words[i].upper() == "THRU":
            found += range(found[-1] + 1, _int(words[i + 1], "a list with THRU") + 1)
            i += 1
        else:
            found.append(_int(words[i], "a list"))
        i += 1
    return found


def _supports(name: str, fields: list[str]) -> Iterator[tuple[int, int, float]]:
    if name == "SPC1":
        for label in _thru(fields[2:]):
            yield from ((label, int(axis) - 1, 0.0) for axis in fields[1] if axis in "123")
        return
    for point, axes, value in (fields[1:4], fields[4:7]):
        if point:
            yield from ((_int(point, name), int(axis) - 1, _float(value, name)) for axis in axes if axis in "123")


def _int(text: str, card: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"{card} expects a whole number, got '{text}': correct the card") from None


def _float(text: str, card: str) -> float:
    """A number as Nastran writes it, such as 1.-3."""
    try:
        return float(_EXPONENT.sub(r"e\1", text.upper().replace("D", "E")) or 0.0)
    except ValueError:
        raise ValueError(f"{card} expects a number, got '{text}': correct the card") from None
