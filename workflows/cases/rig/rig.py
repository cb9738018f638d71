"""Fretting rig: a cantilever in a column rubs on a specimen that a moving platform pushes up (thesis 5.2).

x runs along the beam from the column to the free end, y is the tangential (rubbing) direction across the thin beam, z
is up, the normal direction of the contact. Three bodies that touch but are not joined here: column, beam with the upper
specimen, platform with the lower specimen on its separator. Springs join column and table, beam and column, platform
and table; their places are the named surfaces and points. Joints that the drawings make solid are shared nodes.

The thesis gives the free length, the section, the contact face and its grid; its drawings are lost, so all other
dimensions are ours. The upper specimen hangs in a slot at the free end so that the contact lies at mid-height, on the
axis of the beam: twisting hardly feels the closed contact in the thesis (840 Hz open, 868 Hz stuck), while a contact
below the beam would couple the two."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from tribodyn.geometry import blocks, checks
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class Shapes:
    """Fixed dimensions, ours [m].

    shank : length of the shank, of the beam's whole thickness, that the upper specimen hangs on
    specimen_side, specimen_depth : of the lower specimen, which reaches into the slot
    head_depth, head_x, head_y : of the separator below the lower specimen, and how much it widens along x and y [-]
    limb_depth : vertical extent of the two limbs of the separator, at 45 degrees to the normal (thesis 5.2.1)
    plate_side, plate_depth : of the moving platform; screws, pins : their places below it
    cover_depth : of the cover plate; column_above : of the column over the beam"""

    shank: float = 0.010
    specimen_side: float = 0.020
    specimen_depth: float = 0.040
    head_depth: float = 0.015
    head_x: float = 1.5
    head_y: float = 2.0
    limb_depth: float = 0.025
    plate_side: float = 0.140
    plate_depth: float = 0.020
    screws: tuple[tuple[float, float], ...] = (
        (-0.040, -0.045), (0.040, -0.045), (-0.040, 0.045), (0.040, 0.045), (0.0, -0.070), (0.0, 0.070),
    )  # fmt: skip
    pins: tuple[tuple[float, float], ...] = ((-0.070, 0.0), (0.070, 0.0))
    cover_depth: float = 0.010
    column_above: float = 0.020


OURS = Shapes()
MESH = ("n_contact_length", "n_contact_width", "n_root", "n_half")  # numbers of elements or nodes


@dataclass(frozen=True)
class Parameters:
    """The rig, contact centre in the middle of the slot, y = 0.

    free_length, height, thickness : of the beam along x, z, y [m] (thesis 5.2.1)
    contact_length, contact_width : of the contact face along x and y [m] (thesis 5.2.1; ours: which side is which)
    n_contact_length, n_contact_width : contact nodes along x and y, odd (thesis 5.4: 5 and 11)
    slot_length, slot_height : of the slot from the free end and from the lower edge [m], ours
    protrusion : of the upper specimen into the slot [m], ours: the contact is at mid-height
    foot : straight part of the protrusion next to the contact [m], ours
    root_length : of the beam inside its seat on the column [m], ours
    column_length, column_depth : section of the column along x and y [m], ours
    column_height : of the beam's lower edge above the table [m], ours
    shaker_distance : from the column to the shaker [m], ours
    longest : longest element along the free length [m]
    n_root, n_half : elements along the seat, over half of the beam's height"""

    free_length: float = 0.310
    height: float = 0.060
    thickness: float = 0.010
    contact_length: float = 0.002
    contact_width: float = 0.005
    n_contact_length: int = 5
    n_contact_width: int = 11
    slot_length: float = 0.030
    slot_height: float = 0.038
    protrusion: float = 0.008
    foot: float = 0.001
    root_length: float = 0.080
    column_length: float = 0.100
    column_depth: float = 0.100
    column_height: float = 0.120
    shaker_distance: float = 0.040
    longest: float = 0.040
    n_root: int = 3
    n_half: int = 2

    def __post_init__(self) -> None:
        checks.numbers(self, ("n_contact_length", "n_contact_width"))
        for name, largest, label in (
            ("contact_length", OURS.shank, "the shank of the upper specimen"),
            ("contact_width", self.thickness, "geometry.thickness"),
            ("foot", 0.9 * self.protrusion, "nine tenths of geometry.protrusion"),
            ("protrusion", self.slot_height - 0.001, "geometry.slot_height less 1 mm"),
            ("slot_height", self.height - 0.005, "geometry.height less 5 mm"),
            ("slot_length", self.free_length / 2, "half of geometry.free_length"),
            ("shaker_distance", self.solid_length - 0.01, "the free length without the slot less 10 mm"),
        ):
            if getattr(self, name) > largest:
                raise Refusal(f"geometry.{name} is {getattr(self, name)}: keep it within {label}, {largest:.4g} m")
        if self.free_length > checks.MAX_COUNT * self.longest:
            raise Refusal(
                f"geometry.longest is {self.longest}: the free length of {self.free_length:g} m takes more than "
                f"{checks.MAX_COUNT} such elements; give at least {self.free_length / checks.MAX_COUNT:.4g} m"
            )
        if self.slot_length <= OURS.specimen_side:
            raise Refusal(
                f"geometry.slot_length is {self.slot_length}: the lower specimen needs {OURS.specimen_side} m"
            )
        if self.root_length >= self.column_length:
            raise Refusal(
                f"geometry.root_length is {self.root_length}: keep it below column_length ({self.column_length})"
            )
        if self.slot_height <= self.height / 2:
            raise Refusal(f"geometry.slot_height is {self.slot_height}: keep it above half of geometry.height")

    @property
    def contact_x(self) -> float:
        """Position of the contact centre along the beam [m]."""
        return self.free_length - self.slot_length / 2

    @property
    def contact_z(self) -> float:
        """Height of the contact above the lower edge of the beam [m]."""
        return self.slot_height - self.protrusion

    @property
    def solid_length(self) -> float:
        """Free length without the slot [m]."""
        return self.free_length - self.slot_length


def build(parameters: Parameters, path: str | Path) -> None:
    """Write the mesh.

    Groups: volumes "column", "beam", "upper_specimen", "lower_specimen", "separator", "platform"; surfaces
    "column_base", "column_seat" and "beam_root" (matching), "upper_contact", "lower_contact" (larger, with the matching
    grid in its middle); points "shaker", "accelerometer" (free end), "screws" (six below the platform), "pins" (two),
    and "low", "middle", "high" followed by 1 to 4 at quarters of the length before the slot, for mode shapes"""
    blocks.write(path, _column(parameters), _beam(parameters), _platform(parameters))


def _root_lines(p: Parameters) -> np.ndarray:
    return np.linspace(-p.root_length, 0.0, p.n_root + 1)


def _height_lines(p: Parameters) -> tuple[np.ndarray, np.ndarray]:
    """Vertex positions along z below and above the ceiling of the slot."""
    lower, upper = np.linspace(0.0, p.height / 2, p.n_half + 1), np.linspace(p.slot_height, p.height, p.n_half + 1)
    return np.append(lower, p.slot_height), upper


def _contact_lines(p: Parameters) -> tuple[np.ndarray, np.ndarray]:
    """Vertex positions of the contact grid along x and y, both about the contact centre."""
    x = np.linspace(-p.contact_length / 2, p.contact_length / 2, (p.n_contact_length + 1) // 2)
    y = np.linspace(-p.contact_width / 2, p.contact_width / 2, (p.n_contact_width + 1) // 2)
    return x, y


def _column(p: Parameters) -> blocks.JoinedBlocks:
    """Bulk column next to the beam; its side y = thickness / 2 is the seat of the beam."""
    root, up = _root_lines(p), np.unique(np.concatenate(_height_lines(p)))
    back = np.array([-p.column_length, root[0]])
    full_x = np.append(back[0], root)
    depth = p.thickness / 2 + blocks.towards_start(0.0, p.column_depth, 3, 2.0)
    lower_z = np.linspace(-p.column_height, 0.0, 3)
    above = np.array([p.height, p.height + OURS.column_above])
    return blocks.body(
        [
            blocks.Block(full_x, depth, lower_z, "column", {"w-": "column_base"}),
            blocks.Block(root, depth, up, "column", {"v-": "column_seat"}),
            blocks.Block(back, depth, up, "column"),
            blocks.Block(full_x, depth, above, "column"),
        ]
    )


def _beam(p: Parameters) -> blocks.JoinedBlocks:
    """Beam on edge with its cover plate at the seat and the upper specimen under its free end."""
    x_lines, y_lines = _contact_lines(p)
    root, (_, above) = _root_lines(p), _height_lines(p)
    up = np.unique(np.concatenate(_height_lines(p)))
    thick = y_lines * (p.thickness / p.contact_width)
    cover = np.array([thick[0] - OURS.cover_depth, thick[0]])
    quarters = p.solid_length * np.array([0.25, 0.5, 0.75, 1.0])
    stops = sorted({0.0, p.shaker_distance, *quarters})
    pieces = [np.linspace(a, b, int(np.ceil((b - a) / p.longest)) + 1)[:-1] for a, b in pairwise(stops)]
    span = np.concatenate([*pieces, stops[-1:]])
    specimen = p.contact_x + x_lines * (OURS.shank / p.contact_length)
    arm = np.concatenate([span[-1:], specimen, [p.free_length]])
    taper = p.contact_z + np.array([0.0, p.foot, (p.foot + p.protrusion) / 2, p.protrusion])

    def widen(at: np.ndarray) -> np.ndarray:
        rise = np.clip((at[:, 2] - taper[1]) / (taper[2] - taper[1]), 0.0, 1.0)
        scale = 1 + rise[:, None] * (np.array([OURS.shank / p.contact_length, p.thickness / p.contact_width]) - 1)
        return np.column_stack([p.contact_x + scale[:, 0] * at[:, 0], scale[:, 1] * at[:, 1], at[:, 2]])

    points: dict[str, tuple[float, float, float]] = {
        "shaker": (p.shaker_distance, -p.thickness / 2, p.height / 2),
        "accelerometer": (p.free_length, -p.thickness / 2, p.height),
    }
    for number, x in enumerate(quarters, start=1):
        for name, z in (("low", 0.0), ("middle", p.height / 2), ("high", p.height)):
            points[f"{name}{number}"] = (x, -p.thickness / 2, z)
    return blocks.body(
        [
            blocks.Block(root, thick, up, "beam", {"v+": "beam_root"}),
            blocks.Block(root, cover, up, "beam"),
            blocks.Block(span, thick, up, "beam"),
            blocks.Block(arm, thick, above, "beam"),
            blocks.Block(x_lines, y_lines, taper, "upper_specimen", {"w-": "upper_contact"}, widen),
        ],
        points=points,
    )


def _platform(p: Parameters) -> blocks.JoinedBlocks:
    """Lower specimen on the separator, whose two limbs stand at 45 degrees on the platform."""
    x_lines, y_lines = _contact_lines(p)
    side = OURS.specimen_side / 2
    u, v = np.concatenate([[-side], x_lines, [side]]), np.concatenate([[-side], y_lines, [side]])
    top = p.contact_z
    foot, neck, sole, bottom = top - np.cumsum(
        [OURS.specimen_depth, OURS.head_depth, OURS.limb_depth, OURS.plate_depth]
    )
    up = np.array([foot, (foot + top) / 2, (foot + 7 * top) / 8, top])
    wide = np.array([OURS.head_x, OURS.head_y])

    def place(at: np.ndarray) -> np.ndarray:
        return at + [p.contact_x, 0.0, 0.0]

    def head(at: np.ndarray) -> np.ndarray:
        scale = 1 + (foot - at[:, 2:]) / OURS.head_depth * (wide - 1)
        return place(np.column_stack([scale * at[:, :2], at[:, 2]]))

    def limb(sign: int) -> blocks.Block:
        def lean(at: np.ndarray) -> np.ndarray:
            outward = sign * (neck - at[:, 2])
            return place(np.column_stack([wide[0] * at[:, 0], wide[1] * at[:, 1] + outward, at[:, 2]]))

        lines = v[:2] if sign < 0 else v[-2:]
        return blocks.Block(u, lines, np.linspace(sole, neck, 3), "separator", mapping=lean)

    inner, outer = wide[1] * v[-2] + OURS.limb_depth, wide[1] * v[-1] + OURS.limb_depth  # where a limb stands
    half = OURS.plate_side / 2
    plate_x = np.concatenate([[-half, OURS.screws[0][0]], wide[0] * u, [OURS.screws[1][0], half]])
    plate_y = np.concatenate([[-half, -outer, -inner, 0.0, inner, outer, half]])
    return blocks.body(
        [
            blocks.Block(u, v, up, "lower_specimen", {"w+": "lower_contact"}, place),
            blocks.Block(u, v, np.linspace(neck, foot, 3), "separator", mapping=head),
            limb(-1),
            limb(1),
            blocks.Block(plate_x, plate_y, np.array([bottom, sole]), "platform", mapping=place),
        ],
        points={
            "screws": np.array([(p.contact_x + x, y, bottom) for x, y in OURS.screws]),
            "pins": np.array([(p.contact_x + x, y, bottom) for x, y in OURS.pins]),
        },
    )
