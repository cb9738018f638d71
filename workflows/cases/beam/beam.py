"""Cantilever over a square contact patch under its free end (thesis 4.2)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tribodyn.geometry import blocks, checks
from tribodyn.refusal import Refusal

MESH = ("n_patch", "n_length", "n_height")  # numbers of elements or nodes


@dataclass(frozen=True)
class Parameters:
    """Block of length x width x height along x, y, z, clamped at x = 0, patch on z = 0 at the free end.

    length, width, height : of the block [m] (thesis 4.2)
    patch_length : of the contact patch along x [m]; the patch is as wide as the block
    n_patch : contact nodes per side of the patch, odd (nine-node faces)
    n_length : elements along the length outside the patch
    n_height : elements through the height
    grading : middle over edge element length on the patch; above 1 is finer towards the patch boundary
    length_grading : longest element at mid-span over shortest at the clamp and at the patch
    height_grading : middle over outer element height; above 1 is finer towards the bottom and the top"""

    length: float = 0.2
    width: float = 0.02
    height: float = 0.02
    patch_length: float = 0.02
    n_patch: int = 13
    n_length: int = 12
    n_height: int = 4
    grading: float = 2.0
    length_grading: float = 4.0
    height_grading: float = 1.0

    def __post_init__(self) -> None:
        checks.numbers(self, ("n_patch",), n_length=2)
        if self.patch_length >= self.length / 2:
            raise Refusal(
                f"geometry.patch_length is {self.patch_length}: keep it below half of geometry.length "
                f"({self.length / 2}), the loads act at mid-span"
            )


def build(parameters: Parameters, path: str | Path) -> None:
    """Write the mesh.

    Groups: volume "beam"; surfaces "clamp", "contact"; points "static_load" (mid-span, middle of the top face),
    "shaker" (mid-span, middle of the side y = width), "response" (middle of the patch)"""
    p = parameters
    middle, patch_start = p.length / 2, p.length - p.patch_length
    n_root = min(max(round(p.n_length * middle / patch_start), 1), p.n_length - 1)
    root = blocks.towards_start(0.0, middle, n_root, p.length_grading)
    outer = blocks.towards_end(middle, patch_start, p.n_length - n_root, p.length_grading)
    n_element = (p.n_patch - 1) // 2
    along_patch = blocks.towards_ends(patch_start, p.length, n_element, p.grading)
    across = blocks.towards_ends(0.0, p.width, n_element, p.grading)
    up = blocks.towards_ends(0.0, p.height, p.n_height, p.height_grading)
    beam = blocks.body(
        [
            blocks.Block(np.concatenate([root, outer[1:]]), across, up, "beam", {"u-": "clamp"}),
            blocks.Block(along_patch, across, up, "beam", {"w-": "contact"}),
        ],
        points={
            "static_load": (middle, p.width / 2, p.height),
            "shaker": (middle, p.width, p.height / 2),
            "response": ((patch_start + p.length) / 2, p.width / 2, 0.0),
        },
    )
    blocks.write(path, beam)
