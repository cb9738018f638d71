"""Bolt with a hexagonal head and a smooth shank along -z, its head resting on the plane z = 0."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tribodyn.geometry import blocks, checks, rings
from tribodyn.refusal import Refusal

MESH = ("n_around", "n_grip", "n_nut", "n_end", "n_head")  # numbers of elements


@dataclass(frozen=True)
class Parameters:
    """Head and shank.

    diameter, length : of the shank [m]; flats : of the head [m]; head_height [m]
    seat_diameter : inside of the ring by which the head rests [m]
    grip : distance of the nut from the head [m]; nut_height : over which the shank holds the nut [m]
    core : where the square core of the shank ends, over its radius
    n_around : elements around, a multiple of 12; n_grip, n_nut, n_end, n_head : along grip, nut, free end and head"""

    diameter: float = 7.9375e-3
    length: float = 38.1e-3
    flats: float = 12.7e-3
    head_height: float = 5.159375e-3
    seat_diameter: float = 8.73125e-3
    grip: float = 28.575e-3
    nut_height: float = 5.159375e-3
    core: float = 0.55
    n_around: int = 12
    n_grip: int = 3
    n_nut: int = 1
    n_end: int = 1
    n_head: int = 1

    def __post_init__(self) -> None:
        checks.numbers(self, core=(0.1, 0.7))
        if self.n_around % 12:
            raise Refusal(f"geometry.n_around is {self.n_around}: give a multiple of 12, for a hexagon about a square")
        if not self.diameter < self.seat_diameter < self.flats:
            raise Refusal("geometry.seat_diameter must lie between geometry.diameter and geometry.flats")
        if not self.grip + self.nut_height < self.length:
            raise Refusal("geometry.length must exceed geometry.grip and geometry.nut_height together")


def build(parameters: Parameters, path: str | Path) -> None:
    """Write the mesh. Groups: volume "bolt"; surfaces "under_head", "thread" where the nut holds, "head", "end"."""
    p = parameters
    radius, across = p.diameter / 2, p.n_around // 4
    square = rings.polygon(p.core * radius * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]))
    shank, seat = rings.circle(radius), rings.circle(p.seat_diameter / 2)
    parts = []
    stations = [
        (-p.length, -p.grip - p.nut_height, p.n_end, {"w-": "end"}, None),
        (-p.grip - p.nut_height, -p.grip, p.n_nut, {}, "thread"),
        (-p.grip, 0.0, p.n_grip, {}, None),
        (0.0, p.head_height, p.n_head, {"w+": "head"}, None),
    ]
    for start, stop, count, ends, side in stations:
        z = np.linspace(start, stop, count + 1)
        outside = {} if side is None else {"v+": side}
        parts.append(rings.core(p.core * radius, across, z, "bolt", ends))
        parts.append(rings.ring(square, shank, p.n_around, 1, z, "bolt", {**ends, **outside}))
    z = np.linspace(0.0, p.head_height, p.n_head + 1)
    parts.append(rings.ring(shank, seat, p.n_around, 1, z, "bolt", {"w+": "head"}))
    ends = {"w-": "under_head", "w+": "head"}
    parts.append(rings.ring(seat, rings.hexagon(p.flats), p.n_around, 1, z, "bolt", ends))
    blocks.write(path, blocks.body(parts))
