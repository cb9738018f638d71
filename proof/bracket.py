"""Angle bracket with bolt holes, in tetrahedra: a leg that is clamped at its back, and one whose end rests on a pad."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.geometry import checks
from tribodyn.geometry.gmsh_session import save, session
from tribodyn.refusal import Refusal

MESH = ("n_length",)  # numbers of elements


@dataclass(frozen=True)
class Parameters:
    """The clamped leg stands along z, its back on x = 0; the other lies along x, its lower face on z = 0.

    length, height : of the lying and of the standing leg, outside [m]; width : along y; thickness : of both legs
    hole, holes : diameter of the holes through the standing leg, in a row up the middle, and their number
    sides : of a hole, straight, so that no element bends
    pad_length : of the pad below the end of the lying leg
    n_length : elements along the lying leg, which sets the size of all"""

    length: float = 0.1
    height: float = 0.06
    width: float = 0.03
    thickness: float = 0.008
    hole: float = 0.008
    holes: int = 2
    sides: int = 8
    pad_length: float = 0.02
    n_length: int = 14

    def __post_init__(self) -> None:
        checks.numbers(self, holes=0, n_length=3, sides=3)
        if self.thickness >= self.height or self.thickness + self.pad_length >= self.length:
            raise Refusal(
                f"geometry.thickness is {self.thickness}: keep it below height, and with pad_length below length"
            )
        if self.holes and self.hole >= min(self.width, (self.height - self.thickness) / self.holes):
            raise Refusal(f"geometry.hole is {self.hole}: keep it below width, and all holes within the height")


def build(parameters: Parameters, path: str | Path) -> None:
    """Write the mesh.

    Groups: volume "bracket"; surfaces "back" (x = 0), "pad" (below the end), "top" (above the pad), "end" (x = length),
    "side" (of the end, y = width)"""
    p = parameters
    start = p.length - p.pad_length
    with session() as gmsh:
        occ = gmsh.model.occ
        standing = occ.addBox(0, 0, 0, p.thickness, p.width, p.height)
        for number in range(p.holes):
            z = p.thickness + (p.height - p.thickness) * (number + 0.5) / p.holes
            turn = np.pi / p.sides * (2 * np.arange(p.sides) + 1)
            corners = [occ.addPoint(0, p.width / 2 + p.hole / 2 * c, z + p.hole / 2 * s) for c, s in _circle(turn)]
            sides = [occ.addLine(a, b) for a, b in pairwise([*corners, corners[0]])]
            face = occ.addPlaneSurface([occ.addCurveLoop(sides)])
            bore = [entity for entity in occ.extrude([(2, face)], p.thickness, 0, 0) if entity[0] == 3]
            occ.cut([(3, standing)], bore)
        boxes = [(3, occ.addBox(p.thickness, 0, 0, start - p.thickness, p.width, p.thickness))]
        boxes.append((3, occ.addBox(start, 0, 0, p.pad_length, p.width, p.thickness)))
        occ.fragment([(3, standing)], boxes)
        occ.synchronize()
        volumes = [tag for _, tag in gmsh.model.getEntities(3)]
        gmsh.model.addPhysicalGroup(3, volumes, name="bracket")
        for name, low, high in (
            ("back", (0, 0, 0), (0, p.width, p.height)),
            ("pad", (start, 0, 0), (p.length, p.width, 0)),
            ("top", (start, 0, p.thickness), (p.length, p.width, p.thickness)),
            ("end", (p.length, 0, 0), (p.length, p.width, p.thickness)),
            ("side", (start, p.width, 0), (p.length, p.width, p.thickness)),
        ):
            gmsh.model.addPhysicalGroup(2, _within(gmsh, low, high), name=name)
        size = p.length / p.n_length
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.optimize("Netgen")
        gmsh.model.mesh.setOrder(2)
        save(gmsh, path)


def _within(gmsh: Any, low: tuple[float, ...], high: tuple[float, ...]) -> list[int]:
    """Tags of the faces in a box."""
    slack = 1e-4 * np.ptp([low, high])  # Open CASCADE widens its boxes
    a, b = np.array(low) - slack, np.array(high) + slack
    return [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*a, *b, 2)]


def _circle(angle: np.ndarray) -> Iterator[tuple[float, float]]:
    """Cosine and sine of angles."""
    return zip(np.cos(angle).tolist(), np.sin(angle).tolist(), strict=True)
