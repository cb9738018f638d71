"""A box of four kinds of elements: hexahedra below, pyramids with tetrahedra between, prisms above."""

from pathlib import Path

import numpy as np

from tribodyn.geometry.gmsh_session import session

GMSH_TYPES = {"tetra": 4, "hexahedron": 5, "wedge": 6, "pyramid": 7}
PYRAMIDS = ((0, 3, 2, 1), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


def mixed_cells(n: int = 2) -> tuple[np.ndarray, dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Points of the box n x n x 3 of unit cubes, its cells by kind, and the faces "bottom" and "top"."""
    grid = {}
    points = []
    for k in range(4):
        for j in range(n + 1):
            for i in range(n + 1):
                grid[i, j, k] = len(points)
                points.append((i, j, k))
    cells: dict[str, list[tuple[int, ...]]] = {kind: [] for kind in GMSH_TYPES}
    bottom, top = [], []
    for j in range(n):
        for i in range(n):

            def cube(k: int, i: int = i, j: int = j) -> list[int]:
                return [grid[i + a, j + b, k + c] for c in (0, 1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]

            low, middle, high = cube(0), cube(1), cube(2)
            cells["hexahedron"].append(tuple(low))
            centre = len(points)
            points.append((i + 0.5, j + 0.5, 1.5))
            cells["pyramid"] += [(*(middle[c] for c in reversed(face)), centre) for face in PYRAMIDS]
            a, b, c, d = middle[4:]
            cells["tetra"] += [(a, c, b, centre), (a, d, c, centre)]
            cells["wedge"] += [tuple(high[x] for x in (0, 1, 2, 4, 5, 6)), tuple(high[x] for x in (0, 2, 3, 4, 6, 7))]
            bottom.append(low[:4])
            top += [[high[4], high[5], high[6]], [high[4], high[6], high[7]]]
    faces = {"bottom": np.array(bottom), "top": np.array(top)}
    return np.array(points, dtype=float), {kind: np.array(nodes) for kind, nodes in cells.items()}, faces


def write_mixed(
    path: Path, order: int, complete: bool = True, version: float = 4.1, save_all: bool = False, named: bool = True
) -> Path:
    """Write the box with Gmsh: volume group "box", surface groups "bottom" and "top"."""
    points, cells, faces = mixed_cells()
    with session() as gmsh:
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", not complete)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.SaveAll", save_all)
        model = gmsh.model
        for tag in (1, 2):
            model.addDiscreteEntity(2, tag)
        model.addDiscreteEntity(3, 1, [1, 2])
        model.mesh.addNodes(3, 1, np.arange(1, len(points) + 1), points.ravel())
        for kind, nodes in cells.items():
            model.mesh.addElementsByType(1, GMSH_TYPES[kind], [], (nodes + 1).ravel())
        model.mesh.addElementsByType(1, 3, [], (faces["bottom"] + 1).ravel())
        model.mesh.addElementsByType(2, 2, [], (faces["top"] + 1).ravel())
        if order == 2:
            model.mesh.setOrder(2)
        if named:
            for dimension, tag, name in ((2, 1, "bottom"), (2, 2, "top"), (3, 1, "box")):
                model.addPhysicalGroup(dimension, [tag], name=name)
        gmsh.write(str(path))
    return path
