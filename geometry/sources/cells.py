"""Volume and surface elements of mesh files: corners, edges and faces, in the node order of meshio, which is VTK's."""

from __future__ import annotations

from dataclasses import dataclass

from tribodyn.geometry.numbering import HEX_EDGES, HEX_FACES, TET_EDGES

Face = tuple[int, ...]


@dataclass(frozen=True)
class Solid:
    """edges : the two corners of each; faces : corners of each in cyclic order, triangles and quadrilaterals"""

    corners: int
    edges: tuple[tuple[int, int], ...]
    faces: tuple[Face, ...]

    @property
    def quads(self) -> tuple[Face, ...]:
        """The faces with four corners."""
        return tuple(face for face in self.faces if len(face) == 4)


TETRA = Solid(4, TET_EDGES, ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)))
HEXA = Solid(8, HEX_EDGES, HEX_FACES)
WEDGE = Solid(
    6,
    ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    ((0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
)
PYRAMID = Solid(
    5,
    ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
    ((0, 1, 2, 3), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
)

# kind -> (its solid, whether it has edge nodes, whether it has nodes in its quadrilateral faces, in its middle)
VOLUMES: dict[str, tuple[Solid, bool, bool, bool]] = {
    "tetra": (TETRA, False, False, False),
    "tetra10": (TETRA, True, False, False),
    "hexahedron": (HEXA, False, False, False),
    "hexahedron20": (HEXA, True, False, False),
    "hexahedron27": (HEXA, True, True, True),
    "wedge": (WEDGE, False, False, False),
    "wedge15": (WEDGE, True, False, False),
    "wedge18": (WEDGE, True, True, False),
    "pyramid": (PYRAMID, False, False, False),
    "pyramid13": (PYRAMID, True, False, False),
    "pyramid14": (PYRAMID, True, True, False),
}
# kind -> its corners
SURFACES = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}
COMMON_NAMES = {
    "tetra": "tetrahedra",
    "hexahedron": "hexahedra",
    "wedge": "prisms",
    "pyramid": "pyramids",
}
