"""Asperities of a measured face: its summits, their curvature, density and heights.

Two rough faces count as one: the sum of their heights against a plane, whose summits have the effective radius
(Greenwood and Tripp 1970)."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import maximum_filter

from tribodyn.geometry.height_map import HeightMap, centred
from tribodyn.geometry.map_repair import LIMITS, repair, split
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class Asperities:
    """Summits of a face.

    height : (n,) above the mean of the face [m];  curvature : (n,) mean of that along x and y, positive [1/m]
    area : searched for summits [m2]
    repairs : one sentence for each thing that was changed in a map"""

    height: np.ndarray
    curvature: np.ndarray
    area: float
    repairs: tuple[str, ...] = ()

    @property
    def density(self) -> float:
        """Summits per area [1/m2]."""
        return len(self.height) / self.area

    @property
    def radius(self) -> float:
        """One over their mean curvature [m] (McCool 1986)."""
        return 1 / float(self.curvature.mean())

    @property
    def gap(self) -> np.ndarray:
        """(n,) how far each is below the highest [m]."""
        return self.height.max() - self.height

    def table(self, rows: int = 101) -> np.ndarray:
        """(rows, 2) gaps [m], equidistant from the highest to the lowest summit, and summits per m2 and m of gap.

        The density is linear between the rows and keeps the number and the mean gap of the summits: each counts at
        the rows on its two sides, more at the nearer one.
        Raises  Refusal: fewer than two rows, or all summits at one height"""
        if rows < 2:
            raise Refusal(f"a table of {rows} rows holds no density of asperities: give 2 or more")
        gap = self.gap
        if not gap.max() > 0:
            raise Refusal("all summits are at one height: they have no density of gaps")
        at = gap / gap.max() * (rows - 1)
        remaining = np.minimum(at.astype(int), rows - 2)
        share = at - remaining
        count = np.bincount(remaining, 1 - share, rows) + np.bincount(remaining + 1, share, rows)
        width = np.full(rows, gap.max() / (rows - 1))
        width[[0, -1]] /= 2
        return np.column_stack([np.linspace(0, gap.max(), rows), count / (self.area * width)])


def identify(
    first: HeightMap, second: HeightMap | None = None, cutoff: float | None = None, shortest: float | None = None
) -> Asperities:
    """The asperities of one rough face against a plane, or of two faces against each other as they lie.

    second : in the coordinates of the first, already mirrored; both are centred and the smaller extent counts
    cutoff : wavelength [m] above which waves are no roughness and taken off; only the mean plane by default
    shortest : wavelength [m] below which waves are noise of the instrument and taken off (S-filter of ISO 25178-2)
    Raises  Refusal: what map_repair.repair refuses, heights that come in steps, too few summits"""
    faces: list[HeightMap] = []
    repairs: list[str] = []
    for face in (first, second):
        if face is None:
            continue
        if shortest is None:
            _refuse_steps(face)
        rough, changed = repair(face)
        if cutoff is not None:
            rough = split(rough, cutoff)[1]
        faces.append(centred(split(rough, shortest)[0] if shortest is not None else rough))
        repairs += changed
    both_faces = faces[0] if len(faces) == 1 else _sum(*faces)
    height, curvature = summits(both_faces)
    area = float(np.prod([step * (n - 2) for step, n in zip(both_faces.spacing, both_faces.z.shape, strict=True)]))
    return Asperities(height, curvature, area, tuple(repairs))


def _sum(first: HeightMap, second: HeightMap) -> HeightMap:
    """Sum of the heights of two centred maps, where both are known, on the grid of the finer one."""
    if max(second.spacing) < max(first.spacing):
        first, second = second, first
    inside = [
        (axis >= other[0] - 1e-9 * step) & (axis <= other[-1] + 1e-9 * step)
        for axis, other, step in zip((first.x, first.y), (second.x, second.y), first.spacing, strict=True)
    ]
    x, y = first.x[inside[0]], first.y[inside[1]]
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    points = np.clip(points, (second.x[0], second.y[0]), (second.x[-1], second.y[-1]))
    method = "cubic" if min(second.z.shape) >= 4 and second.spacing != first.spacing else "linear"
    other = RegularGridInterpolator((second.x, second.y), second.z, method)(points)
    return HeightMap(x, y, first.z[np.ix_(*inside)] + other, f"{first.name} and {second.name}")


def summits(surface: HeightMap) -> tuple[np.ndarray, np.ndarray]:
    """Heights above the mean of the face [m] and curvatures [1/m] of the points above all eight neighbours, (n,) each.

    The curvature is the mean of the second differences along x and y. The rim holds no summit.
    Raises  Refusal: holes, too few summits"""
    z = surface.z
    if not np.isfinite(z).all():
        raise Refusal(f"{surface.name}: it has points without height: fill the holes before the search for summits")
    inner = z[1:-1, 1:-1]
    is_summit = inner > _highest_neighbour(z)
    count = int(is_summit.sum())
    if count < LIMITS.summits:
        raise Refusal(
            f"{surface.name}: {count} summits are too few for statistics, {LIMITS.summits} are wanted: "
            "measure a larger area"
        )
    bend_x, bend_y = _bends(surface)
    return inner[is_summit] - z.mean(), -0.5 * (bend_x + bend_y)[is_summit]


def _highest_neighbour(z: np.ndarray) -> np.ndarray:
    """Largest of the eight heights around each inner point (nx - 2, ny - 2)."""
    neighbours = np.ones((3, 3), bool)
    neighbours[1, 1] = False
    return np.asarray(maximum_filter(z, footprint=neighbours)[1:-1, 1:-1])


def _refuse_steps(surface: HeightMap) -> None:
    """Raise Refusal where many summits are terraces, because an instrument gave its heights in steps.

    To be asked before levelling, which tilts them. Plane land around a terrace is none."""
    z = np.where(np.isfinite(surface.z), surface.z, -np.inf)
    inner, highest, lowest = z[1:-1, 1:-1], _highest_neighbour(z), -_highest_neighbour(-z)
    single, shared = int((inner > highest).sum()), int(((inner == highest) & (inner > lowest)).sum())
    if shared > LIMITS.terraces * max(single, 1):
        raise Refusal(
            f"{surface.name}: {shared} points are as high as their highest neighbour and {single} above all of them, "
            "so that its heights come in steps and summits cannot be found: give `shortest`, some steps of the grid"
        )


def _bends(surface: HeightMap) -> tuple[np.ndarray, np.ndarray]:
    """Second derivatives along x and y at the inner points (nx - 2, ny - 2) [1/m]."""
    z, (dx, dy) = surface.z, surface.spacing
    axis = (z[2:, 1:-1] - 2 * z[1:-1, 1:-1] + z[:-2, 1:-1]) / dx**2
    across = (z[1:-1, 2:] - 2 * z[1:-1, 1:-1] + z[1:-1, :-2]) / dy**2
    return axis, across
