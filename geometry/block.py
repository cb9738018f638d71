"""Rectangular block: the plainest body to build a structure from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tribodyn.geometry import blocks, checks, grid


@dataclass(frozen=True)
class Parameters:
    """Block of length x width x height along x, y, z with a corner at the origin.

    length, width, height : of the block [m]
    n_length, n_width, n_height : elements along x, y, z
    grading : middle over outer element length along x and y; above 1 is finer towards the edges
    """

    length: float = 0.1
    width: float = 0.02
    height: float = 0.01
    n_length: int = 8
    n_width: int = 2
    n_height: int = 1
    grading: float = 1.0

    def __post_init__(self) -> None:
        checks.positive(self, "length", "width", "height")
        checks.positive(self, "grading", unit="a ratio, 1 is uniform")
        checks.whole(self, "n_length", "n_width", "n_height", least=1)


def build(parameters: Parameters, path: str | Path) -> None:
    """Write the mesh.

    Groups: volume "block"; surfaces "x_min", "x_max", "y_min", "y_max", "z_min", "z_max"; point "centre_top", the
    middle of the face z_max, where a node lies whatever the number of elements
    """
    p = parameters
    names = {"u-": "x_min", "u+": "x_max", "v-": "y_min", "v+": "y_max", "w-": "z_min", "w+": "z_max"}
    block = blocks.Block(
        grid.towards_ends(0.0, p.length, p.n_length, p.grading),
        grid.towards_ends(0.0, p.width, p.n_width, p.grading),
        grid.towards_ends(0.0, p.height, p.n_height),
        "block",
        names,
    )
    blocks.write(path, blocks.body([block], points={"centre_top": (p.length / 2, p.width / 2, p.height)}))
