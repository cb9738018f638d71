"""Sector of a shrouded bladed disk: root block, tapered and twisted airfoil, tip shroud, disk if wanted (thesis 4.3).

The wheel turns about x, the blade stands along z. Left is the side of positive rotation (towards -y), where the next
blade stands: left faces turned back by one pitch are right faces. The dimensions are ours; the thesis's are lost."""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi
from pathlib import Path

import numpy as np

from tribodyn.geometry import blocks, checks
from tribodyn.refusal import Refusal
from tribodyn.workflows.cases.blade.airfoil_platform import Platform, Section, between, platform, unit

MESH = ("n_along", "n_up", "n_span", "n_through", "n_side", "n_end", "n_root", "n_disk")  # numbers of elements or nodes


@dataclass(frozen=True)
class Parameters:
    """Lengths [m], angles [rad]; what the thesis gives is marked.

    n_blades : blades of the wheel (thesis)
    hub_radius, span : foot of the airfoil, and its length up to the shroud
    root_chord, tip_chord, root_thickness, tip_thickness : of the airfoil
    camber, edge : height of the mean line over the chord; thickness at the edges over that at mid-chord
    root_stagger, tip_stagger : from the axis x to the chord
    couple_height : fraction of the span where the couple of static forces acts
    contact_length, contact_height : of a shroud contact face, 30 x 20 mm (thesis)
    shroud_angle : from the axis x to the contact face; shroud_length : axial
    clearance : that opens between neighbours beside the contact faces, on each side
    root_height, root_length : of the root block; root_fill : its width over the pitch at its radius, below 1
    disk_radius : inner radius of the disk sector, 0 for none (the root block is clamped then)
    disk_taper : axial length of the disk at its inner radius over that at the rim
    n_along, n_up : contact nodes along and up a contact face, at vertices, 5 x 4 (thesis); n_along - 1 elements lie
        along the chord
    n_span, n_through : elements along the span and through the airfoil
    n_side, n_end : elements of the platforms beside the airfoil and before and behind it
    n_root, n_disk : elements of the root block and of the disk along the radius"""

    n_blades: int = 40
    hub_radius: float = 0.25
    span: float = 0.25
    root_chord: float = 0.07
    tip_chord: float = 0.042
    root_thickness: float = 0.016
    tip_thickness: float = 0.011
    camber: float = 0.04
    edge: float = 0.55
    root_stagger: float = 0.17
    tip_stagger: float = 0.65
    couple_height: float = 0.75
    contact_length: float = 0.03
    contact_height: float = 0.02
    shroud_angle: float = 0.61
    shroud_length: float = 0.05
    clearance: float = 0.002
    root_height: float = 0.03
    root_length: float = 0.09
    root_fill: float = 0.9
    disk_radius: float = 0.0
    disk_taper: float = 0.5
    n_along: int = 5
    n_up: int = 4
    n_span: int = 12
    n_through: int = 1
    n_side: int = 2
    n_end: int = 1
    n_root: int = 2
    n_disk: int = 4

    def __post_init__(self) -> None:
        angle = (-1.3, 1.3)
        checks.numbers(
            self, camber=(-0.5, 0.5), couple_height=(0.0, 1.0), root_fill=(0.1, 0.99), disk_radius=None,
            root_stagger=angle, tip_stagger=angle, shroud_angle=angle, n_blades=3, n_along=2, n_up=2,
        )  # fmt: skip
        along_axis = self.contact_length * cos(self.shroud_angle)
        if along_axis >= self.shroud_length:
            raise Refusal(
                f"geometry.shroud_length is {self.shroud_length}: give more than {along_axis:.4g} m, what the contact "
                "face takes along the axis"
            )
        limit = self.hub_radius - self.root_height
        if not 0 <= self.disk_radius < limit:
            raise Refusal(
                f"geometry.disk_radius is {self.disk_radius}: give 0 for no disk, or a radius below {limit:.4g} m, the "
                "bottom of the root block"
            )

    @property
    def pitch(self) -> float:
        """Angle of one sector [rad]."""
        return 2 * pi / self.n_blades

    @property
    def root(self) -> Section:
        """Airfoil section at the hub."""
        return Section(self.root_chord, self.root_thickness, self.camber, self.edge, self.root_stagger)

    @property
    def tip(self) -> Section:
        """Airfoil section at the shroud."""
        return Section(self.tip_chord, self.tip_thickness, self.camber, self.edge, self.tip_stagger)


def build(parameters: Parameters, path: str | Path) -> None:
    """Write the mesh of one sector.

    Groups: volumes "root", "airfoil", "shroud", and "disk" where there is one; surfaces "shroud_right", "shroud_left",
    "clamp" (under the root, or the bore of the disk), "cyclic_right", "cyclic_left" (of the disk); points
    "couple_leading", "couple_trailing" (edges of the airfoil), "excitation" (mid-span, mid-chord), "tip" (top of the
    shroud)"""
    p = parameters
    rows = (p.n_end, p.n_along - 1, p.n_end)
    columns = (p.n_side, p.n_through, p.n_side)
    root, shroud = _root(p), shroud_of(p)
    all_blocks = [(i, j) for i in range(3) for j in range(3)]
    under = {} if p.disk_radius else {at: {"w-": "clamp"} for at in all_blocks}
    faces = {(1, 2): {"v+": "shroud_right"}, (1, 0): {"v-": "shroud_left"}}
    sector = [
        *root.blocks(rows, columns, p.n_root, "root", under),
        blocks.Block(unit(rows[1]), unit(columns[1]), unit(p.n_span), "airfoil", {}, lambda q: airfoil_at(p, q)),
        *shroud.blocks(rows, columns, p.n_up - 1, "shroud", faces),
    ]
    if p.disk_radius:
        sector += _disk(p, root, rows, columns)
    couple = round(p.couple_height * 2 * p.n_span) / (2 * p.n_span)  # nearest node along the span
    points = airfoil_at(p, np.array([[0.0, 0.5, couple], [1.0, 0.5, couple], [0.5, 1.0, 0.5]]))
    named = dict(zip(("couple_leading", "couple_trailing", "excitation"), points, strict=True))
    named["tip"] = shroud.position(1, 1, np.array([[0.5, 0.5, 1.0]]))[0]
    blocks.write(path, blocks.body(sector, points=named))


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    """Points (..., 3) turned about x by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([x, c * y - s * z, s * y + c * z], axis=-1)


def airfoil_at(p: Parameters, q: np.ndarray) -> np.ndarray:
    """Map (n, 3) fractions of chord, thickness, span into space."""
    x, y = between(p.root, p.tip, q[:, 2]).at(q[:, 0], q[:, 1])
    return np.column_stack([x, y, p.hub_radius + q[:, 2] * p.span])


def shroud_of(p: Parameters) -> Platform:
    """The Z-shaped shroud: a contact face between two edges that leave a clearance."""
    radii = (p.hub_radius + p.span, p.hub_radius + p.span + p.contact_height)
    x = 0.5 * p.contact_length * np.cos(p.shroud_angle)
    y = 0.5 * p.contact_length * np.sin(p.shroud_angle)
    edge = np.array([[-p.shroud_length / 2, -y], [-x, -y], [x, y], [p.shroud_length / 2, y]])
    relief = p.clearance * np.array([1.0, 0.0, 0.0, 1.0])
    line = np.stack([np.column_stack([edge, np.full(4, r)]) for r in radii])
    left_side, right_side = line.copy(), line.copy()
    left_side[..., 1] += relief
    right_side[..., 1] -= relief
    return platform(p.tip, radii, turned(left_side, p.pitch / 2), turned(right_side, -p.pitch / 2))


def _root(p: Parameters) -> Platform:
    """The root block, its sides along rays inside the pitch."""
    radii = (p.hub_radius - p.root_height, p.hub_radius)
    ends, v = np.array([0.0, 1.0]), np.full(2, 0.5)
    x = np.array([-p.root_length / 2, *p.root.at(ends, v)[0], p.root_length / 2])
    if not (np.diff(x) > 0).all():
        raise Refusal(f"geometry.root_length is {p.root_length}: it must be longer than the airfoil at the hub")
    line = np.stack([np.column_stack([x, np.zeros(4), np.full(4, r)]) for r in radii])
    half = p.root_fill * p.pitch / 2
    return platform(p.root, radii, turned(line, half), turned(line, -half))


def _disk(p: Parameters, root: Platform, rows: tuple[int, ...], columns: tuple[int, ...]) -> list[blocks.Block]:
    """Disk sector under the root block: five columns; the outer two end at the cyclic faces."""
    rim = root.corners[0]
    columns = (1, *columns, 1)
    edges = {}  # of the outer columns, from left to right: (corner of the root block, cyclic face)
    for j, of_root, angle in ((0, 0, p.pitch / 2), (4, 3, -p.pitch / 2)):
        axial = rim[:, of_root, 0]
        face = np.column_stack([axial, np.zeros(4), np.full(4, p.hub_radius - p.root_height)])
        edges[j] = [turned(face, angle), rim[:, of_root]][:: 1 if j == 0 else -1]

    def rim_at(i: int, j: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        if j not in edges:
            return root.position(i, j - 1, np.column_stack([a, b, np.zeros_like(a)]))
        left_side, right = ((1 - a[:, None]) * edge[i] + a[:, None] * edge[i + 1] for edge in edges[j])
        return (1 - b[:, None]) * left_side + b[:, None] * right

    def mapping(i: int, j: int) -> Callable[[np.ndarray], np.ndarray]:
        def place(q: np.ndarray) -> np.ndarray:
            top = rim_at(i, j, q[:, 0], q[:, 1])
            bore = top * (p.disk_radius / np.hypot(top[:, 1], top[:, 2]))[:, None]
            bore[:, 0] = p.disk_taper * top[:, 0]
            return bore + q[:, 2:] * (top - bore)

        return place

    sides = {0: {"v-": "cyclic_left"}, 4: {"v+": "cyclic_right"}}
    return [
        blocks.Block(
            unit(rows[i]), unit(columns[j]), unit(p.n_disk), "disk", {"w-": "clamp", **sides.get(j, {})}, mapping(i, j)
        )
        for i in range(3)
        for j in range(5)
    ]
