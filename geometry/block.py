"""Rectangular block: the plainest body to build a structure from."""

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from tribodyn.geometry import blocks, checks
from tribodyn.refusal import Refusal

MESH = ("n_length", "n_width", "n_height")  # numbers of elements


@dataclass(frozen=True)
class Parameters:
    """Block of length x width x height along x, y, z with a corner at the origin.

    length, width, height : of the block [m]
    n_length, n_width, n_height : elements along x, y, z
    pad_start, pad_end : a strip across the block from here to there along x, such as a bolt needs [m]; none where equal
    """

    length: float = 0.1
    width: float = 0.02
    height: float = 0.01
    n_length: int = 8
    n_width: int = 2
    n_height: int = 1
    pad_start: float = 0.0
    pad_end: float = 0.0

    def __post_init__(self) -> None:
        checks.numbers(self, pad_start=None, pad_end=None)
        if not 0 <= self.pad_start <= self.pad_end <= self.length:
            raise Refusal(
                f"geometry.pad_end is {self.pad_end}: give a strip from geometry.pad_start ({self.pad_start}) to "
                f"at most geometry.length ({self.length})"
            )


def build(parameters: Parameters, path: str | Path) -> None:
    """Write the mesh.

    Groups: volume "block"; surfaces "x_min", "x_max", "y_min", "y_max", "z_min", "z_max", and of a strip "pad_min"
    below and "pad_max" above"""
    p = parameters
    across, up = blocks.towards_ends(0.0, p.width, p.n_width), blocks.towards_ends(0.0, p.height, p.n_height)
    padded = p.pad_end > p.pad_start
    ends = sorted({0.0, p.length, *((p.pad_start, p.pad_end) if padded else ())})
    parts = []
    for start, end in pairwise(ends):
        x = blocks.towards_ends(start, end, max(round(p.n_length * (end - start) / p.length), 1))
        kind = "pad" if padded and start == p.pad_start else "z"
        sides = {"v-": "y_min", "v+": "y_max", "w-": f"{kind}_min", "w+": f"{kind}_max"}
        sides |= {"u-": "x_min"} if start == 0.0 else {}
        sides |= {"u+": "x_max"} if end == p.length else {}
        parts.append(blocks.Block(x, across, up, "block", sides))
    joined = blocks.body(parts)
    if padded:
        empty = np.empty((0, 9), dtype=int)
        cells = {
            f"z_{side}": np.concatenate([joined.surfaces.get(f"z_{side}", empty), joined.surfaces[f"pad_{side}"]])
            for side in ("min", "max")
        }
        joined = replace(joined, surfaces={**joined.surfaces, **cells})
    blocks.write(path, joined)
