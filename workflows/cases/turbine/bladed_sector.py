"""Sector of a turbine wheel as it is built: disk with a dovetail slot, blade with root, platform and shroud, damper.

Three bodies that touch but are not joined: "disk", "blade" and "damper", each a volume of the mesh. The wheel turns
about x, the blade stands along z; left is the side of positive rotation, as in cases.blade, whose airfoil and shroud
the blade has. Its root hangs on two flanks that look outwards; its platforms and their neighbours leave a gap between
them that narrows outwards, in which the damper lies like a wedge. The dimensions are ours."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import pi
from pathlib import Path

import numpy as np

from tribodyn.geometry import blocks, checks
from tribodyn.refusal import Refusal
from tribodyn.workflows.cases.blade import blade
from tribodyn.workflows.cases.blade.airfoil_platform import Platform, platform, unit
from tribodyn.workflows.cases.blade.blade import turned

OF_BLADE = ("n_along", "n_up", "n_span", "n_through", "n_side", "n_end")
MESH = (*OF_BLADE, "n_platform", "n_neck", "n_flank", "n_axial", "n_slot", "n_post", "n_disk", "n_damper")
SHARED = (
    *("n_blades", "hub_radius", "span", "root_chord", "tip_chord", "root_thickness", "tip_thickness"),
    *("camber", "edge", "root_stagger", "tip_stagger", "contact_length", "contact_height", "shroud_angle"),
    *("shroud_length", "clearance", *OF_BLADE),
)  # with cases.blade


@dataclass(frozen=True)
class Parameters:
    """Lengths [m], angles [rad].

    n_blades : blades of the wheel
    hub_radius, span : foot of the airfoil, and its length up to the shroud
    root_chord, tip_chord, root_thickness, tip_thickness : of the airfoil
    camber, edge : height of the mean line over the chord; thickness at the edges over that at mid-chord
    root_stagger, tip_stagger : from the axis x to the chord
    contact_length, contact_height : of a shroud contact face
    shroud_angle : from the axis x to the contact face; shroud_length : axial
    clearance : that opens between neighbouring shrouds beside the contact faces, on each side
    platform_height, platform_length : of the platform below the airfoil, along the radius and axial
    gap_bottom, gap_top : between neighbouring platforms at their lower and upper edge
    neck_width, bulb_width : of the root above and below its flanks
    neck_height, flank_height, bulb_height : of the root along the radius, from the platform downwards
    lap : part of its length by which the flank of the slot starts and ends below that of the root
    post_gap, root_gap : that open between the posts of the disk and the platforms, and between root and slot beside the
        flanks
    disk_radius : of the bore; disk_taper : axial length of the disk at its bore over that at the rim
    damper_length : axial; damper_low, damper_high : where its faces begin and end, over the platform's height
    n_along, n_up : contact nodes along and up a shroud contact face, at vertices
    n_span, n_through : elements along the span and through the airfoil
    n_side, n_end : elements of shroud and platform beside the airfoil and before and behind it
    n_platform, n_neck : elements of the platform and the neck of the root along the radius
    n_flank : of a flank of the root along the radius, and of its bulb
    n_axial : elements of the disk along the axis; n_slot, n_post : of the slot's flank, and from slot to seam
    n_disk : elements of the disk below the slot along the radius; n_damper : of the damper along the axis"""

    n_blades: int = 24
    hub_radius: float = 0.2
    span: float = 0.09
    root_chord: float = 0.04
    tip_chord: float = 0.03
    root_thickness: float = 0.008
    tip_thickness: float = 0.005
    camber: float = 0.04
    edge: float = 0.55
    root_stagger: float = 0.15
    tip_stagger: float = 0.6
    contact_length: float = 0.018
    contact_height: float = 0.008
    shroud_angle: float = -0.61
    shroud_length: float = 0.036
    clearance: float = 0.002
    platform_height: float = 0.01
    platform_length: float = 0.056
    gap_bottom: float = 0.02
    gap_top: float = 0.004
    neck_width: float = 0.012
    bulb_width: float = 0.022
    neck_height: float = 0.008
    flank_height: float = 0.002
    bulb_height: float = 0.006
    lap: float = 0.1
    post_gap: float = 2e-3
    root_gap: float = 4e-4
    disk_radius: float = 0.11
    disk_taper: float = 0.6
    damper_length: float = 0.036
    damper_low: float = 0.1
    damper_high: float = 0.9
    n_along: int = 4
    n_up: int = 3
    n_span: int = 7
    n_through: int = 1
    n_side: int = 1
    n_end: int = 1
    n_platform: int = 1
    n_neck: int = 1
    n_flank: int = 1
    n_axial: int = 3
    n_slot: int = 1
    n_post: int = 1
    n_disk: int = 1
    n_damper: int = 3

    def __post_init__(self) -> None:
        free = dict.fromkeys(("camber", "root_stagger", "tip_stagger", "shroud_angle"))  # limits of cases.blade
        checks.numbers(self, lap=(0.0, 0.5), damper_low=(0.0, 1.0), damper_high=(0.0, 1.0), **free)
        _ = self.upper  # refuses what airfoil and shroud cannot be
        least_neck = self.under - self.post_top - self.lap * self.flank_height
        room = 0.9 * self.bottom * np.tan(self.pitch / 2)
        limits = (
            (self.bulb_width <= self.neck_width, "bulb_width",
             f"give more than geometry.neck_width ({self.neck_width}), or the root has no flanks to hang on"),
            (self.gap_top >= self.gap_bottom, "gap_top",
             f"give less than geometry.gap_bottom ({self.gap_bottom}), or the damper flies out"),
            (self.damper_low >= self.damper_high, "damper_low",
             f"give less than geometry.damper_high ({self.damper_high})"),
            (self.damper_length > self.platform_length, "damper_length",
             f"give at most geometry.platform_length ({self.platform_length})"),
            (self.disk_radius >= self.bottom, "disk_radius",
             f"give a radius below {self.bottom:.4g} m, the bottom of the slot"),
            (self.slot(self.lap)[1] >= self.post_top, "neck_height",
             f"give more than {least_neck:.4g}, or the posts of the disk end below the flanks of its slot"),
            (self.slot(1 + self.lap)[0] >= room, "bulb_width",
             "the disk has no room for it between its seams; give less, or fewer geometry.n_blades"),
        )  # fmt: skip
        for is_violated, name, cure in limits:
            if is_violated:
                raise Refusal(f"geometry.{name} is {getattr(self, name)}: {cure}")

    @property
    def upper(self) -> blade.Parameters:
        """Airfoil and shroud."""
        return blade.Parameters(
            **{name: getattr(self, name) for name in SHARED},
            root_height=self.platform_height,
            root_length=self.platform_length,
        )

    @property
    def pitch(self) -> float:
        """Angle of one sector [rad]."""
        return 2 * pi / self.n_blades

    @property
    def under(self) -> float:
        """Radius of the lower side of the platform, where the root begins [m]."""
        return self.hub_radius - self.platform_height

    @property
    def flank_top(self) -> float:
        """Height z of the upper edge of the root's flanks [m]."""
        return self.under - self.neck_height

    @property
    def bottom(self) -> float:
        """Height z of the bottom of the slot [m]."""
        return self.flank_top - self.flank_height - self.bulb_height - self.root_gap

    @property
    def post_top(self) -> float:
        """Height z of the top of the disk's posts, below the lowest corners of the platforms [m]."""
        return self.under * float(np.cos(self.pitch / 2)) - self.post_gap

    def slot(self, t: float) -> np.ndarray:
        """Point y, z (2,) of the line of the right flank, 0 at its upper and 1 at its lower edge on the root [m]."""
        half = 0.5 * (self.neck_width + t * (self.bulb_width - self.neck_width))
        return np.array([half, self.flank_top - t * self.flank_height])


def build(parameters: Parameters, path: str | Path) -> None:
    """Write the mesh of one sector.

    Groups: volumes "disk", "blade", "damper"; surfaces of the disk "slot_right", "slot_left" (flanks), "clamp" (bore),
    "cyclic_right", "cyclic_left"; of the blade "flank_right", "flank_left", "platform_right", "platform_left",
    "shroud_right", "shroud_left"; of the damper "wedge_right", "wedge_left"; points of the blade "excitation"
    (mid-span, mid-chord), "tip" (top of the shroud)"""
    blocks.write(path, _disk(parameters), _blade(parameters), _damper(parameters))


def _blade(p: Parameters) -> blocks.JoinedBlocks:
    upper = p.upper
    rows, columns = (p.n_end, p.n_along - 1, p.n_end), (p.n_side, p.n_through, p.n_side)
    base, shroud = _platform(p), blade.shroud_of(upper)
    sides = {(i, 0): {"v-": "platform_left"} for i in range(3)} | {(i, 2): {"v+": "platform_right"} for i in range(3)}
    contact = {(1, 2): {"v+": "shroud_right"}, (1, 0): {"v-": "shroud_left"}}
    parts = [
        *base.blocks(rows, columns, p.n_platform, "blade", sides),
        blocks.Block(
            unit(rows[1]), unit(columns[1]), unit(p.n_span), "blade", {}, lambda q: blade.airfoil_at(upper, q)
        ),
        *shroud.blocks(rows, columns, p.n_up - 1, "blade", contact),
        *_root(p, base, rows),
    ]
    points = {
        "excitation": blade.airfoil_at(upper, np.array([[0.5, 1.0, 0.5]]))[0],
        "tip": shroud.position(1, 1, np.array([[0.5, 0.5, 1.0]]))[0],
    }
    return blocks.body(parts, points=points)


def _platform(p: Parameters) -> Platform:
    """The platform; its sides lean towards the middle of the gap, where the damper lies."""
    section = p.upper.root
    x = np.array([-p.platform_length / 2, *section.at(np.array([0.0, 1.0]), np.full(2, 0.5))[0], p.platform_length / 2])
    if not (np.diff(x) > 0).all():
        raise Refusal(f"geometry.platform_length is {p.platform_length}: make it longer than the airfoil at the hub")
    edge = [(p.gap_bottom / 2, p.under), (p.gap_top / 2, p.hub_radius)]
    left_edge, right_edge = (
        np.stack([np.column_stack([x, np.full(4, sign * half), np.full(4, r)]) for half, r in edge]) for sign in (1, -1)
    )
    return platform(section, (p.under, p.hub_radius), turned(left_edge, p.pitch / 2), turned(right_edge, -p.pitch / 2))


def _root(p: Parameters, base: Platform, rows: tuple[int, ...]) -> list[blocks.Block]:
    """Neck, flanks and bulb under the middle column of the platform."""
    x = base.corners[0, :, 1:3, 0].mean(axis=1)  # where the rows of the platform begin and end, straightened
    low = p.slot(1.0)
    foot = low[1] - p.bulb_height

    def straight(i: int, half: float, height: float) -> Callable[[np.ndarray], np.ndarray]:
        def at(q: np.ndarray) -> np.ndarray:
            fractions = x[i] + q[:, 0] * (x[i + 1] - x[i])
            return np.column_stack([fractions, half * (2 * q[:, 1] - 1), np.full(len(q), height)])

        return at

    def under(i: int) -> Callable[[np.ndarray], np.ndarray]:
        return lambda q: base.position(i, 1, np.column_stack([q[:, :2], np.zeros(len(q))]))

    def between(
        low: Callable[[np.ndarray], np.ndarray], high: Callable[[np.ndarray], np.ndarray]
    ) -> Callable[[np.ndarray], np.ndarray]:
        return lambda q: (1 - q[:, 2:]) * low(q) + q[:, 2:] * high(q)

    root_blocks = []
    flanks = {"v+": "flank_right", "v-": "flank_left"}
    for i, n in enumerate(rows):
        top, middle, bottom = straight(i, p.neck_width / 2, p.flank_top), straight(i, *low), straight(i, low[0], foot)
        for layer, count, names in (
            (between(top, under(i)), p.n_neck, {}),
            (between(middle, top), p.n_flank, flanks),
            (between(bottom, middle), p.n_flank, {}),
        ):
            root_blocks.append(blocks.Block(unit(n), unit(p.n_through), unit(count), "blade", names, layer))
    return root_blocks


def _disk(p: Parameters) -> blocks.JoinedBlocks:
    """Two posts beside the slot and the disk below them, down to the bore."""
    half = p.platform_length / 2
    upper, lower = p.slot(p.lap), p.slot(1 + p.lap)
    wall = [np.array([lower[0], p.bottom]), lower, upper, np.array([upper[0], p.post_top])]

    def in_place(profile: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
        def at(q: np.ndarray) -> np.ndarray:
            yz = profile(q)
            radius = np.hypot(*yz.T)
            slim = p.disk_taper + (1 - p.disk_taper) * np.clip(
                (radius - p.disk_radius) / (p.bottom - p.disk_radius), 0, 1
            )
            return np.column_stack([half * (2 * q[:, 0] - 1) * slim, yz])

        return at

    def seam(z: np.ndarray) -> np.ndarray:
        """The point of the right seam at a height z of the slot's wall, as high above the bore."""
        return np.column_stack([z * np.tan(p.pitch / 2), z])

    def post(low: np.ndarray, high: np.ndarray, side: int) -> Callable[[np.ndarray], np.ndarray]:
        def profile(q: np.ndarray) -> np.ndarray:
            inner = (1 - q[:, 2:]) * low + q[:, 2:] * high
            across = q[:, 1:2] if side > 0 else 1 - q[:, 1:2]
            disk_blocks = (1 - across) * inner + across * seam(inner[:, 1])
            return disk_blocks * [side, 1]

        return in_place(profile)

    def under_slot(inner: tuple[float, float], outer: tuple[float, float]) -> Callable[[np.ndarray], np.ndarray]:
        """A column under the slot's bottom, from the bore; between two places there."""

        def profile(q: np.ndarray) -> np.ndarray:
            start, end = np.array(inner), np.array(outer)
            rim = (1 - q[:, 1:2]) * start + q[:, 1:2] * end
            bore = rim * (p.disk_radius / np.hypot(*rim.T))[:, None]
            return (1 - q[:, 2:]) * bore + q[:, 2:] * rim

        return in_place(profile)

    axial = unit(p.n_axial)
    parts = []
    corner = (float(lower[0]), p.bottom)
    edge = (float(p.bottom * np.tan(p.pitch / 2)), p.bottom)
    for side, name, outward, inward in ((1, "right", "v+", "v-"), (-1, "left", "v-", "v+")):
        for (low, high), flank in zip(pairwise(wall), (False, True, False), strict=True):
            names = {outward: f"cyclic_{name}"} | ({inward: f"slot_{name}"} if flank else {})
            parts.append(blocks.Block(axial, unit(p.n_post), unit(p.n_slot), "disk", names, post(low, high, side)))
        ends = (corner, edge) if side > 0 else ((-edge[0], edge[1]), (-corner[0], corner[1]))
        names = {outward: f"cyclic_{name}", "w-": "clamp"}
        parts.append(blocks.Block(axial, unit(p.n_post), unit(p.n_disk), "disk", names, under_slot(*ends)))
    middle = under_slot((-corner[0], corner[1]), corner)
    parts.append(blocks.Block(axial, unit(p.n_post), unit(p.n_disk), "disk", {"w-": "clamp"}, middle))
    return blocks.body(parts)


def _damper(p: Parameters) -> blocks.JoinedBlocks:
    """A wedge whose faces lie on those of the platforms, in the gap on the right of the blade."""

    def at(q: np.ndarray) -> np.ndarray:
        height = p.damper_low + q[:, 2] * (p.damper_high - p.damper_low)
        half = 0.5 * (p.gap_bottom + height * (p.gap_top - p.gap_bottom))
        points = np.column_stack(
            [p.damper_length * (q[:, 0] - 0.5), half * (2 * q[:, 1] - 1), p.under + height * p.platform_height]
        )
        return turned(points, -p.pitch / 2)

    names: Mapping[str, str] = {"v-": "wedge_left", "v+": "wedge_right"}
    return blocks.body([blocks.Block(unit(p.n_damper), unit(1), unit(1), "damper", names, at)])
