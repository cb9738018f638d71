"""Half of a beam with a bolted lap joint: full height up to the lap, half the height with a row of holes in the lap.

The lap lies about the origin, its face on the plane z = 0. Turned by half a turn about y, the same part is the other
half, and the nodes of both laps meet."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tribodyn.geometry import blocks, checks, rings
from tribodyn.refusal import Refusal

MESH = ("n_side", "n_pad", "n_field", "n_lap", "n_end", "n_length")  # numbers of elements


@dataclass(frozen=True)
class Parameters:
    """length : of the half, from its end to the tip of its lap [m]; width, height : of the beam along y and z [m]

    lap : length of the lap [m]; holes : number of holes in a row; pitch : their distance [m]
    hole, pad : diameters of the holes and of the disks about them under the washers [m]
    n_side : elements along each side of the field about a hole; n_pad, n_field : from hole to rim of the pad, and on to
    the border of the field; n_lap : through the lap; n_end : along the strips at both ends of the lap
    n_length, grading : along the full beam, the last over the first one next to the lap"""

    length: float = 0.42
    width: float = 25.4e-3
    height: float = 25.4e-3
    lap: float = 0.12
    holes: int = 3
    pitch: float = 30e-3
    hole: float = 8.5e-3
    pad: float = 17.4625e-3
    n_side: int = 2
    n_pad: int = 1
    n_field: int = 1
    n_lap: int = 1
    n_end: int = 1
    n_length: int = 8
    grading: float = 2.0

    def __post_init__(self) -> None:
        checks.numbers(self)
        if not self.hole < self.pad < min(self.pitch, self.width):
            raise Refusal("geometry.pad must lie between geometry.hole and the smaller of geometry.pitch and width")
        if not self.holes * self.pitch < self.lap < self.length:
            raise Refusal("geometry.lap must exceed geometry.holes times geometry.pitch, and geometry.length the lap")


def build(parameters: Parameters, path: str | Path) -> None:
    """Write the mesh.

    Groups: volume "beam"; surfaces "lap", "end", "pad_1" ... below the holes from the end of the beam on; points
    "tip" in the middle of the end, "top" above it"""
    p = parameters
    half, side, row = p.height / 2, p.width / 2, p.holes * p.pitch / 2
    y = np.linspace(-side, side, p.n_side + 1)
    lower_half, upper_half = np.linspace(-half, 0.0, p.n_lap + 1), np.linspace(0.0, half, p.n_lap + 1)
    lap = {"w+": "lap"}
    parts = []
    for number in range(p.holes):
        centre = (-row + (number + 0.5) * p.pitch, 0.0)
        hole, pad = (rings.circle(d / 2, np.pi / 4) for d in (p.hole, p.pad))
        a, b = p.pitch / 2, side
        field = rings.polygon(np.array([[a, b], [-a, b], [-a, -b], [a, -b]]))
        under = {"w-": f"pad_{number + 1}", **lap}
        parts.append(rings.ring(hole, pad, 4 * p.n_side, p.n_pad, lower_half, "beam", under, centre))
        parts.append(rings.ring(pad, field, 4 * p.n_side, p.n_field, lower_half, "beam", lap, centre))
    strip = np.linspace(row, p.lap / 2, p.n_end + 1)
    parts.append(blocks.Block(-strip[::-1], y, lower_half, "beam", lap))
    parts.append(blocks.Block(strip, y, lower_half, "beam", lap))
    end = p.lap / 2 - p.length
    x = blocks.towards_end(end, -p.lap / 2, p.n_length, p.grading)
    parts += [blocks.Block(x, y, z, "beam", {"u-": "end"}) for z in (lower_half, upper_half)]
    joined = blocks.body(parts)
    at = {"tip": (end, 0.0, 0.0), "top": (end, 0.0, half)}
    nodes = {name: np.array([np.linalg.norm(joined.nodes - place, axis=1).argmin()]) for name, place in at.items()}
    blocks.write(path, replace(joined, points=nodes))
