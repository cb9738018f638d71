"""Mesh files that meshio reads: VTK and MED."""

from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.extras import package
from tribodyn.geometry.sources.raw_mesh import SURFACES, VOLUMES
from tribodyn.refusal import Refusal


def content(path: str) -> dict[str, Any]:
    """The fields of the RawMesh of a file; meshio knows its format by the ending. Raises Refusal: it cannot be read."""
    meshio = package("meshio")  # 85 modules, of which few scenes need one
    topological_dimension = package("meshio._mesh").topological_dimension

    topological_dimension.update({kind: 3 for kind in VOLUMES})  # meshio 5.3.5 forgets wedge15 and pyramid13
    try:
        if path.endswith(".med"):
            from tribodyn.hdf5_file import opened_hdf5

            with opened_hdf5(Path(path)):  # refuses one that names other files
                pass
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            file = meshio.read(path)
    except Refusal:
        raise
    except (Exception, SystemExit) as problem:  # the readers raise what they meet, and where none fits meshio exits
        message = "" if isinstance(problem, SystemExit) else " ".join(str(problem).split())
        reason = f" ({message})" if message else ""
        raise Refusal(f"mesh file '{path}' cannot be read{reason}: write it as a Gmsh file, MSH 4.1") from None
    names: dict[int, list[str]] = getattr(file, "cell_tags", None) or {}
    cells: list[tuple[str, np.ndarray, np.ndarray]] = []
    faces: dict[str, list[np.ndarray]] = {}
    unused: list[str] = []
    start = 0
    numbers: dict[str, list[np.ndarray]] = {}
    for i, block in enumerate(file.cells):
        nodes = np.asarray(block.data, dtype=int)
        solid = block.type in VOLUMES
        if solid:
            cells.append((block.type, nodes, np.arange(start + 1, start + 1 + len(nodes))))
        elif block.type not in SURFACES:
            unused.append(f"{len(nodes)} elements of kind {block.type}")
            continue
        for key, arrays in file.cell_data.items():
            values = np.asarray(arrays[i])
            if values.ndim != 1 or not np.issubdtype(values.dtype, np.integer):
                continue
            if len(np.unique(values)) > 100:  # a number of each element, not a group
                continue
            for value in np.unique(values).tolist():
                members = np.flatnonzero(values == value)
                for name in names.get(value, []) if key == "cell_tags" else [f"{key} {value}"]:
                    if solid:
                        numbers.setdefault(name, []).append(members + start)
                    else:
                        faces.setdefault(name, []).append(nodes[members][:, : SURFACES[block.type]])
        start += len(nodes) if solid else 0
    volumes = {name: np.unique(np.concatenate(parts)) for name, parts in numbers.items()}
    of_nodes: dict[str, np.ndarray] = {}
    point_names: dict[int, list[str]] = getattr(file, "point_tags", None) or {}
    tags = file.point_data.get("point_tags")
    if tags is not None and point_names:
        for value, tag_names in point_names.items():
            for name in tag_names:
                of_nodes[name] = np.union1d(of_nodes.get(name, np.empty(0, dtype=int)), np.flatnonzero(tags == value))
    for key, values in file.point_data.items():
        values = np.asarray(values)
        if values.ndim == 1 and np.issubdtype(values.dtype, np.integer) and set(np.unique(values)) == {0, 1}:
            of_nodes[key] = np.flatnonzero(values)
    points = np.asarray(file.points, dtype=float)
    labels = np.arange(1, len(points) + 1)
    of_nodes = {name: rows.astype(int) for name, rows in of_nodes.items()}
    groups = {"volumes": volumes, "faces": faces, "nodes": of_nodes, "skins": list(of_nodes)}
    return {"points": points, "labels": labels, "cells": cells, **groups, "unused": unused}
