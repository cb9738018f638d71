"""Leaf seal of a combustor: a thin annular sector with curved contact patches along two edges (thesis 6.2).

The leaf stands in the plane x (circumferential), y (radial, up), z (axial): z = 0 is the face that touches nozzle and
liner, z = thickness the face that the pressure pushes. The origin lies in the middle of the sector at mid-height."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tribodyn.geometry import blocks, checks
from tribodyn.refusal import Refusal

MESH = ("n_column", "n_row", "n_web", "n_thickness")  # numbers of elements or nodes


@dataclass(frozen=True)
class Parameters:
    """Annular sector; dimensions are not published, the defaults come from "./tribodyn prove leaf fit" (ours).

    radius : at mid-height [m]; angle : of the sector [rad]; height : radial [m]; thickness : [m]
    patch_height : radial width of each contact patch, at the lower and the upper edge [m]
    bow : how far the middle of the leaf stands away from the contact, its ends fixed [m]; either sign
    pin_height : of the two pins above mid-height [m]; pin_width : radial width of the seat of a pin's spring [m]
    pin_column : column of nodes of the pins, counted from either end, 0 is the end itself
    n_column : nodes along each patch, n_row : across it, both odd (nine-node faces); thesis 21 x 3
    n_web : elements between a patch and a pin, above and below; n_thickness : elements through the thickness"""

    radius: float = 0.5
    angle: float = 0.4
    height: float = 0.06
    thickness: float = 0.002
    patch_height: float = 0.006
    bow: float = 0.0
    pin_height: float = 0.01
    pin_width: float = 0.004
    pin_column: int = 4
    n_column: int = 21
    n_row: int = 3
    n_web: int = 2
    n_thickness: int = 1

    def __post_init__(self) -> None:
        checks.numbers(self, ("n_column", "n_row"), n_column=5, bow=None, pin_height=None, pin_column=0)
        if self.angle >= np.pi:
            raise Refusal(f"geometry.angle is {self.angle}: keep the sector below pi radians")
        if self.height >= 2 * self.radius:
            raise Refusal(f"geometry.height is {self.height}: keep it below twice geometry.radius ({self.radius})")
        if 2 * self.pin_column >= self.n_column - 1:
            raise Refusal(
                f"geometry.pin_column is {self.pin_column}: keep it below {(self.n_column - 1) // 2}, "
                "the middle column, so that there are two pins"
            )
        room = self.height / 2 - self.patch_height - self.pin_width / 2
        if not np.isfinite(self.bow):
            raise Refusal(f"geometry.bow is {self.bow}: give a finite length (metres)")
        if not abs(self.pin_height) < room:
            raise Refusal(
                f"geometry.pin_height is {self.pin_height}: the seats of the pins must lie between the patches, "
                f"keep it between {-room:.4g} and {room:.4g}"
            )


def build(parameters: Parameters, path: str | Path) -> None:
    """Write the mesh.

    Groups: volume "leaf"; surfaces "upper_contact", "lower_contact", "front" (the rest of z = 0) and "back"; points
    "left_pin", "right_pin" (three nodes across each spring seat, mid-thickness), "left_hole", "right_hole" (their
    middles), "upper_centre" (middle of the upper patch), "middle" (of the leaf, the nearest node) and "lower_corner"
    (outermost node of the lower edge, x > 0), all three on z = 0"""
    p = parameters
    half = p.angle / 2
    columns = np.linspace(-half, half, (p.n_column + 1) // 2)
    through = np.linspace(0.0, p.thickness, p.n_thickness + 1)
    pin_bottom, pin_top = p.pin_height - p.pin_width / 2, p.pin_height + p.pin_width / 2
    low, high = -p.height / 2, p.height / 2
    patch = (p.n_row + 1) // 2

    def place(position: np.ndarray) -> np.ndarray:
        theta, r = position[:, 0], p.radius + position[:, 1]
        z = position[:, 2] + p.bow * (1 - (theta / half) ** 2)
        return np.stack([r * np.sin(theta), r * np.cos(theta) - p.radius, z], axis=1)

    def strip(heights: np.ndarray, front: str) -> blocks.Block:
        return blocks.Block(columns, heights, through, "leaf", {"w-": front, "w+": "back"}, place)

    strips = [
        strip(np.linspace(low, low + p.patch_height, patch), "lower_contact"),
        strip(np.linspace(low + p.patch_height, pin_bottom, p.n_web + 1), "front"),
        strip(np.array([pin_bottom, pin_top]), "front"),
        strip(np.linspace(pin_top, high - p.patch_height, p.n_web + 1), "front"),
        strip(np.linspace(high - p.patch_height, high, patch), "upper_contact"),
    ]
    at_pin = half * (1 - 2 * p.pin_column / (p.n_column - 1))
    seat, middle = np.array([pin_bottom, p.pin_height, pin_top]), p.thickness / 2
    ends = np.unique(np.concatenate([s.v for s in strips]))
    heights = np.sort(np.concatenate([ends, (ends[1:] + ends[:-1]) / 2]))

    def line(theta: float, at: np.ndarray, z: float) -> np.ndarray:
        return place(np.stack([np.full(at.shape, theta), at, np.full(at.shape, z)], axis=1))

    points = {
        "left_pin": line(-at_pin, seat, middle),
        "right_pin": line(at_pin, seat, middle),
        "left_hole": line(-at_pin, seat[1:2], middle),
        "right_hole": line(at_pin, seat[1:2], middle),
        "upper_centre": line(0.0, np.array([high - p.patch_height / 2]), 0.0),
        "middle": line(0.0, heights[np.abs(heights).argmin()][None], 0.0),
        "lower_corner": line(half, np.array([low]), 0.0),
    }
    blocks.write(path, blocks.body(strips, points))
