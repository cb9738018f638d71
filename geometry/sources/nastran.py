"""Nastran bulk data: grid points, solids, properties, materials, sets, supports, forces, rigid elements.

Free, small and large fields. meshio reads neither sets nor what is fixed, and loses second-order solids.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from tribodyn.geometry.sources import deck
from tribodyn.geometry.sources.made import assembled
from tribodyn.geometry.sources.raw import RawMesh

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
    points: dict[int, list[float]] = {}
    solids: dict[str, list[tuple[int, int, list[int]]]] = {}
    sets = dict(_case_sets(text))
    properties: dict[int, int] = {}
    materials: dict[int, deck.DeckMaterial] = {}
    supports: list[tuple[int, int, float]] = []
    forces: list[tuple[int, int, float]] = []
    couplings: list[tuple[int, list[int], list[int]]] = []
    masses: list[tuple[int, float]] = []
    ignored: Counter[str] = Counter()
    for name, fields in _cards(text, path):
        if name == "GRID":
            if fields[1] not in ("", "0"):
                raise ValueError(f"GRID {fields[0]} of '{path}' is in system {fields[1]}: write the basic system")
            points[_int(fields[0], name)] = [_float(x, name) for x in fields[2:5]]
        elif name in SOLIDS:
            nodes = [_int(x, name) for x in fields[2:] if x]
            low, high, order = SOLIDS[name]
            if len(nodes) < CORNERS[name]:
                raise ValueError(
                    f"{name} {fields[0]} of '{path}' has {len(nodes)} nodes: the file is cut off or broken"
                )
            whole = len(nodes) >= len(order)
            kept = [nodes[i] for i in order] if whole else nodes[: CORNERS[name]]
            solids.setdefault(high if whole else low, []).append((_int(fields[0], name), _int(fields[1], name), kept))
        elif name == "PSOLID":
            properties[_int(fields[0], name)] = _int(fields[1], name)
        elif name == "MAT1":
            values = [_float(x, name) if x else None for x in fields[1:6]]
            young, shear, poisson, density, expansion = values
            if poisson is None and young and shear:
                poisson = young / (2 * shear) - 1
            number = _int(fields[0], name)
            materials[number] = deck.DeckMaterial(f"MAT1 {number}", young, poisson, density, expansion)
        elif name == "SET1":
            sets[_int(fields[0], name)] = _thru(fields[1:])
        elif name in ("SPC1", "SPC"):
            supports += _supports(name, fields)
        elif name == "FORCE":
            scale = _float(fields[3], name)
            forces += [(_int(fields[1], name), i, scale * _float(x, name)) for i, x in enumerate(fields[4:7])]
        elif name == "RBE2":
            couplings.append((_int(fields[1], name), [int(x) - 1 for x in fields[2]], _thru(fields[3:])))
        elif name == "CONM2":
            masses.append((_int(fields[1], name), _float(fields[3], name)))
        elif name not in SILENT:
            ignored[name] += 1
    if not solids:
        return RawMesh(np.empty((0, 3)), np.empty(0, dtype=int), ())
    blocks = [(kind, [e[0] for e in members], [e[2] for e in members]) for kind, members in solids.items()]
    volumes: dict[str, list[int]] = {}
    for members in solids.values():
        for label, property_, _ in members:
            volumes.setdefault(f"PSOLID {property_}", []).append(label)
    groups = {
        number: tuple(f"PSOLID {p}" for p, m in properties.items() if m == number and f"PSOLID {p}" in volumes)
        for number in materials
    }
    labels = {label for members in solids.values() for label, _, _ in members}
    node_sets: dict[str, list[int]] = {}
    for number, members_of in sets.items():
        if all(label in points for label in members_of):
            node_sets[f"SET {number}"] = members_of
        elif all(label in labels for label in members_of):
            volumes[f"SET {number}"] = members_of
        else:
            ignored[f"SET {number}, whose members are neither grid points nor solids"] += 1
    held: dict[tuple[int, float], list[int]] = {}
    for label, axis, value in supports:
        held.setdefault((axis, value), []).append(label)
    made: dict[tuple[int, ...], str] = {}
    support_list = []
    for (axis, value), members_of in held.items():
        key = tuple(sorted(members_of))
        place = made.setdefault(key, f"support {len(made) + 1}")
        node_sets[place] = list(key)
        support_list.append(deck.Support(place, axis, value))
    for label, _, _ in forces:
        node_sets[f"node {label}"] = [label]
    coupling_list = []
    for i, (label, axes, members_of) in enumerate(couplings, 1):
        node_sets[f"node {label}"], node_sets[f"RBE2 {i}"] = [label], members_of
        coupling_list.append(deck.Coupling(f"RBE2 {i}", "kinematic", f"node {label}", f"RBE2 {i}", tuple(axes)))
    for label, _ in masses:
        node_sets[f"node {label}"] = [label]
    found = deck.Deck(
        materials=tuple(replace(material, groups=groups[number]) for number, material in materials.items()),
        couplings=tuple(coupling_list),
        forces=tuple(deck.Force(f"node {label}", axis, value) for label, axis, value in forces if value),
        supports=tuple(support_list),
        masses=tuple(deck.PointMass(f"node {label}", value) for label, value in masses),
    )
    unused = [f"cards {', '.join(f'{n} ({c})' if c > 1 else n for n, c in ignored.items())}"] if ignored else []
    return assembled(path, points, blocks, volumes, node_sets, found, unused)


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
