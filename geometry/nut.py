"""Hexagonal nut with a smooth bore along z, standing on the plane z = 0."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tribodyn.geometry import blocks, checks, rings
from tribodyn.refusal import Refusal

MESH = ("n_around", "n_height")  # numbers of elements


@dataclass(frozen=True)
class Parameters:
    """bore, flats, height : [m]; seat_diameter : inside of the ring by which it rests [m]

    n_around : elements around, a multiple of 6; n_height : along the axis"""

    bore: float = 7.9375e-3
    flats: float = 12.7e-3
    height: float = 5.159375e-3
    seat_diameter: float = 8.73125e-3
    n_around: int = 12
    n_height: int = 1

    def __post_init__(self) -> None:
        checks.numbers(self)
        if self.n_around % 6:
            raise Refusal(f"geometry.n_around is {self.n_around}: give a multiple of 6, for the corners of a hexagon")
        if not self.bore < self.seat_diameter < self.flats:
            raise Refusal("geometry.seat_diameter must lie between geometry.bore and geometry.flats")


def build(parameters: Parameters, path: str | Path) -> None:
    """Write the mesh. Groups: volume "nut"; surfaces "seat" on z = 0, "bore", "top"."""
    p = parameters
    z = np.linspace(0.0, p.height, p.n_height + 1)
    bore, seat = rings.circle(p.bore / 2), rings.circle(p.seat_diameter / 2)
    ends = {"w-": "seat", "w+": "top"}
    joined = blocks.body(
        [
            rings.ring(bore, seat, p.n_around, 1, z, "nut", {"v-": "bore", "w+": "top"}),
            rings.ring(seat, rings.hexagon(p.flats), p.n_around, 1, z, "nut", ends),
        ]
    )
    blocks.write(path, joined)
