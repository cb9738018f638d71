"""Flat round washer about the z axis, lying on the plane z = 0."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tribodyn.geometry import blocks, checks, rings
from tribodyn.refusal import Refusal

MESH = ("n_around", "n_across")  # numbers of elements


@dataclass(frozen=True)
class Parameters:
    """bore, diameter, thickness : [m]; n_around, n_across : elements around and from inside to outside."""

    bore: float = 8.73125e-3
    diameter: float = 17.4625e-3
    thickness: float = 1.5875e-3
    n_around: int = 12
    n_across: int = 2

    def __post_init__(self) -> None:
        checks.numbers(self)
        if self.n_around < 4:
            raise Refusal(f"geometry.n_around is {self.n_around}: give 4 or more")
        if not self.bore < self.diameter:
            raise Refusal("geometry.bore must be less than geometry.diameter")


def build(parameters: Parameters, path: str | Path) -> None:
    """Write the mesh. Groups: volume "washer"; surfaces "bottom" on z = 0, and "top"."""
    p = parameters
    inside, outside = rings.circle(p.bore / 2), rings.circle(p.diameter / 2)
    z = np.array([0.0, p.thickness])
    ends = {"w-": "bottom", "w+": "top"}
    blocks.write(path, blocks.body([rings.ring(inside, outside, p.n_around, p.n_across, z, "washer", ends)]))
