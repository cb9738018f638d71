"""Gmsh's own files, MSH 2.2 and 4.1, text or binary, with what else Gmsh has put in where all is saved."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.geometry.gmsh_session import session
from tribodyn.refusal import Refusal

_ORDER_19 = [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15]
_WEDGE_15 = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11]
_PYRAMID_13 = [0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12]
# Gmsh's number of a kind -> meshio's name, and where meshio's nodes stand in Gmsh's order
_KINDS: dict[int, tuple[str, list[int] | None]] = {
    2: ("triangle", None),
    3: ("quad", None),
    4: ("tetra", None),
    5: ("hexahedron", None),
    6: ("wedge", None),
    7: ("pyramid", None),
    9: ("triangle6", None),
    10: ("quad9", None),
    11: ("tetra10", [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]),
    12: ("hexahedron27", [*_ORDER_19, 22, 23, 21, 24, 20, 25, 26]),
    13: ("wedge18", [*_WEDGE_15, 15, 17, 16]),
    14: ("pyramid14", [*_PYRAMID_13, 13]),
    16: ("quad8", None),
    17: ("hexahedron20", _ORDER_19),
    18: ("wedge15", _WEDGE_15),
    19: ("pyramid13", _PYRAMID_13),
}
_KIND_OF_GROUP = ("point", "curve", "surface", "volume")


def content(path: str) -> dict[str, Any]:
    """Let Gmsh read one of its files; see `of_session`. Raises Refusal: it is none, or broken."""
    _check(Path(path))
    with session() as gmsh:
        gmsh.logger.start()
        try:
            gmsh.merge(path)
        except Exception as problem:
            raise Refusal(_cannot(path, str(problem))) from None
        for line in (line for line in gmsh.logger.get() if "duplicate" in line):  # of which it takes one in silence
            raise Refusal(_cannot(path, line))
        return of_session(gmsh)


def of_session(gmsh: Any) -> dict[str, Any]:
    """The mesh that a Gmsh session holds, as the fields of a RawMesh; volumes that no group has, where others are in
    one, are left out.

    A surface with elements that no group has is one itself, "face N" by its number in Gmsh or in the CAD model."""
    model = gmsh.model
    labels, coordinates, _ = model.mesh.getNodes()
    order = np.argsort(labels)
    labels, points = labels[order].astype(int), coordinates.reshape(-1, 3)[order]

    def rows(nodes: np.ndarray) -> np.ndarray:
        return np.searchsorted(labels, nodes.astype(int))

    def elements(entity: tuple[int, int]) -> list[tuple[str, np.ndarray, np.ndarray]]:
        blocks_of_entity = []
        for kind, numbers, nodes in zip(*model.mesh.getElements(*entity), strict=True):
            if kind not in _KINDS:
                raise Refusal(
                    f"elements {model.mesh.getElementProperties(kind)[0]} are of a kind that is not known: "
                    "write elements of first or second order"
                )
            name, order = _KINDS[kind]
            nodes = rows(nodes).reshape(len(numbers), -1)
            blocks_of_entity.append((name, nodes if order is None else nodes[:, order], numbers.astype(int)))
        return blocks_of_entity

    def corners(kind: str, nodes: np.ndarray, _: np.ndarray) -> np.ndarray:
        return nodes[:, : 3 if kind.startswith("triangle") else 4]

    groups = model.getPhysicalGroups()
    filled = [tag for _, tag in model.getEntities(3) if len(model.mesh.getElements(3, tag)[0])]
    grouped = {int(tag) for d, g in groups if d == 3 for tag in model.getEntitiesForPhysicalGroup(3, g)}
    used = [tag for tag in filled if tag in grouped or not grouped]
    unused = [f"{len(filled) - len(used)} volumes that belong to no group"] if len(used) < len(filled) else []
    cells, numbers_of, start = [], {}, 0
    for tag in used:
        blocks = elements((3, tag))
        cells += blocks
        count = sum(len(nodes) for _, nodes, _ in blocks)
        numbers_of[tag] = np.arange(start, start + count)
        start += count
    volumes: dict[str, np.ndarray] = {}
    faces: dict[str, list[np.ndarray]] = {}
    nodes_of: dict[str, np.ndarray] = {}
    for dimension, number in groups:
        name = model.getPhysicalName(dimension, number) or f"{_KIND_OF_GROUP[dimension]} {number}"
        entities = [int(tag) for tag in model.getEntitiesForPhysicalGroup(dimension, number)]
        if dimension == 3:
            members = [numbers_of[tag] for tag in entities if tag in numbers_of]
            if members:
                volumes[name] = np.sort(np.concatenate(members))
        elif dimension == 2:
            faces[name] = [corners(*block) for tag in entities for block in elements((2, tag))]
        else:
            nodes_of[name] = np.unique(rows(model.mesh.getNodesForPhysicalGroup(dimension, number)[0]))
    named = {int(tag) for d, g in groups if d == 2 for tag in model.getEntitiesForPhysicalGroup(2, g)}
    for tag in (tag for _, tag in model.getEntities(2) if tag not in named):
        if parts := [corners(*block) for block in elements((2, tag))]:
            faces[f"face {tag}"] = parts
    groups_of = {"volumes": volumes, "faces": faces, "nodes": nodes_of}
    return {"points": points, "labels": labels, "cells": cells, **groups_of, "unused": unused}


def _check(path: Path) -> None:
    """Refuse a file that Gmsh would take for a script, and one that stops inside a section: it reads on in silence.

    Gmsh takes what does not begin with the name of a section, to the letter, for a script in its language, and runs it.
    """
    text = path.read_bytes()
    if not re.match(rb"\$MeshFormat[ \t]*\r?\n", text):
        raise Refusal(_cannot(path, "it does not begin with $MeshFormat"))
    for section in re.findall(rb"(?m)^\$(?!End)([A-Za-z]{5,})\s*$", text):  # binary numbers may look like a shorter one
        if b"$End" + section not in text:
            raise Refusal(_cannot(path, f"it ends inside ${section.decode()}, so it is not complete"))


def _cannot(path: str | Path, cause: str) -> str:
    reason = " ".join(cause.split())
    return f"mesh file '{path}' cannot be read{f' ({reason})' if reason else ''}: write it as a Gmsh file, MSH 4.1"
