"""Lay a scan of a worn face on one of the same face before wear: shift and turn in plane, height and tilt.

What did not wear is the same in both scans, so that its texture says where each point went, and its heights say how
the instrument held the face. All is sought by what did not wear alone; wear takes material away, it adds none."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.fft import irfft2, rfft2
from scipy import ndimage

from tribodyn.geometry.height_map import HeightMap
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class ScanAlignment:
    """Where the points of a face are in its second scan.

    shift : along x and y [m], turn : about the middle [rad], of the second scan against the first
    plane : height in the middle [m], slopes along x and y [-] of the first above the second where nothing wore
    texture : height of the peak of the correlation in plane over its deviation elsewhere; nan where it was not sought
    covariance : (6, 6) of shift, turn and plane, per cell's variance of what remains where nothing wore"""

    shift: tuple[float, float] = (0.0, 0.0)
    turn: float = 0.0
    plane: tuple[float, float, float] = (0.0, 0.0, 0.0)
    texture: float = np.nan
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))

    @property
    def is_found(self) -> bool:
        """Whether both scans share a texture; else they lie as they were measured, but for height and tilt."""
        return bool(self.texture > 7)  # the highest of a million trials without one is 5 deviations


class SmoothMap:
    """A height map that can be sampled between its points, by cubic splines.

    Its coordinates count from its middle; a point without height, and what lies beyond the rim, is nan."""

    def __init__(self, surface: HeightMap, cells: float = 0.0) -> None:
        """Smooth it over some cells first."""
        z = smooth(surface.z, cells) if cells else surface.z
        self.middle = np.array([(axis[0] + axis[-1]) / 2 - axis[0] for axis in (surface.x, surface.y)])
        self.step = np.array(surface.spacing)
        self.hole = (~np.isfinite(z)).astype(np.float32)
        nearest = ndimage.distance_transform_edt(self.hole, return_distances=False, return_indices=True)
        self.spline = ndimage.spline_filter(z[tuple(nearest)], order=3)

    def at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Heights at points from the middle [m]."""
        places = [(p + m) / s for p, m, s in zip((x, y), self.middle, self.step, strict=True)]
        z = ndimage.map_coordinates(self.spline, places, order=3, prefilter=False, mode="nearest")
        hole = ndimage.map_coordinates(self.hole, places, order=1, cval=1.0)
        return np.where(hole > 1e-6, np.nan, z)


def smooth(z: np.ndarray, cells: float) -> np.ndarray:
    """Gaussian mean of the measured points over a standard deviation of some cells; nan stays nan."""
    measured = np.isfinite(z)
    weight, total = (
        ndimage.gaussian_filter(np.where(measured, values, 0.0), cells, truncate=3.0) for values in (1.0, z)
    )
    return np.where(measured, total / np.maximum(weight, 1e-12), np.nan)


@dataclass(frozen=True)
class ScanPair:
    """A face before and after wear, both as measured."""

    pristine: HeightMap
    worn: HeightMap

    @cached_property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        """(nx, ny) each: points of the pristine scan from its middle [m]."""
        axes = [axis - (axis[0] + axis[-1]) / 2 for axis in (self.pristine.x, self.pristine.y)]
        x, y = np.meshgrid(*axes, indexing="ij")
        return x, y

    def depth(self, alignment: ScanAlignment, worn: SmoothMap | None = None) -> np.ndarray:
        """(nx, ny) how much lower the worn face is at each point of the pristine one [m], nan where not measured."""
        x, y = self.grid
        offset, *slopes = alignment.plane
        sampled = (worn or SmoothMap(self.worn)).at(*_moved(x, y, alignment))
        return np.asarray(self.pristine.z - sampled - offset - slopes[0] * x - slopes[1] * y)

    def overlap(self, alignment: ScanAlignment) -> np.ndarray:
        """(nx, ny) points of the pristine scan that the worn one covers, measured or not."""
        places = zip(_moved(*self.grid, alignment), self.worn.size, strict=True)
        return np.asarray(np.all([np.abs(place) <= size / 2 for place, size in places], axis=0))

    def rows(self, depth: np.ndarray) -> np.ndarray:
        """(6, nx, ny) derivative of the worn heights by shift and turn of the points they are taken at, and by plane.

        Of the heights that make this depth; nan beside points without one"""
        x, y = self.grid
        along, across = np.gradient(self.pristine.z - depth, *self.pristine.spacing)
        return np.stack([along, across, across * x - along * y, np.ones_like(x), x, y])


def _moved(x: np.ndarray, y: np.ndarray, alignment: ScanAlignment) -> tuple[np.ndarray, np.ndarray]:
    cos, sin = np.cos(alignment.turn), np.sin(alignment.turn)
    return cos * x - sin * y + alignment.shift[0], sin * x + cos * y + alignment.shift[1]


def align(pair: ScanPair) -> ScanAlignment:
    """Find shift, turn, height and tilt by the part that did not wear.

    First by the highest correlation of both textures over shifts and turns of up to 6 degrees; then by least squares
    over what did not wear, first of smoothed maps.
    Raises  Refusal where the scans do not overlap, or too little of the face is as it was"""
    start = _by_correlation(pair)
    if not start.is_found:
        start = ScanAlignment(texture=start.texture)
    start = replace(start, plane=_plane_of_most(pair, start))
    coarse = _coarse_step(pair) / min(pair.pristine.spacing)
    for cells in (coarse / 2, 0.0) if start.is_found else (0.0,):
        start = _refined(pair, start, cells)
    return start


def _coarse_step(pair: ScanPair) -> float:
    """Step of the grid of the first search [m]."""
    return max(*pair.pristine.size) / 160


def _by_correlation(pair: ScanPair) -> ScanAlignment:
    """Shift and turn at the highest correlation of both textures (masked correlation; Padfield 2012)."""
    step = _coarse_step(pair)
    axes = [np.arange(-size / 2, size / 2, step) for size in pair.pristine.size]
    x, y = np.meshgrid(*axes, indexing="ij")
    maps = [SmoothMap(s, max(0.4 * step / min(s.spacing), 0.5)) for s in (pair.pristine, pair.worn)]
    shape = tuple(scipy.fft.next_fast_len(2 * n) for n in x.shape)
    first, first_mask = _texture(maps[0].at(x, y))
    spectra = [rfft2(values, shape).conj() for values in (first, first**2, first_mask)]
    radius = np.hypot(*pair.pristine.size) / 2
    best = ScanAlignment(texture=0.0)
    for turn in np.radians(6) * np.linspace(-1, 1, 2 * int(np.ceil(np.radians(6) * radius / step)) + 1):
        second, mask = _texture(maps[1].at(*_moved(x, y, ScanAlignment(turn=turn))))
        of_second, of_square, of_mask = (rfft2(values, shape) for values in (second, second**2, mask))
        pairs = (spectra[0], of_second), (spectra[1], of_mask), (spectra[2], of_square), (spectra[2], of_mask)
        product, square_1, square_2, overlap = (irfft2(a * b, shape) for a, b in pairs)
        enough = overlap > 0.4 * first_mask.sum()
        if not enough.any():
            continue
        score = np.where(enough, product, 0.0) / np.sqrt(np.maximum(square_1 * square_2, 1e-300))
        score /= 1.4826 * np.median(np.abs(score[enough]))
        peak = np.unravel_index(int(score.argmax()), shape)
        if score[peak] > best.texture:
            along, across = (np.array(step * ((p + n // 2) % n - n // 2)) for p, n in zip(peak, shape, strict=True))
            moved = _moved(along, across, ScanAlignment(turn=turn))  # x is there at R (x + shift)
            best = ScanAlignment((float(moved[0]), float(moved[1])), float(turn), texture=float(score[peak]))
    return best


def _texture(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heights over a running mean, without the largest, 0 where not measured; and where they are."""
    rough = z - smooth(z, 4.0)
    measured = np.isfinite(rough)
    if measured.sum() < 100:
        raise Refusal("fewer than a hundred points are measured in both scans: are they of the same face?")
    limit = 3 * 1.4826 * np.median(np.abs(rough[measured]))
    return np.where(measured, np.clip(np.nan_to_num(rough), -limit, limit), 0.0), measured.astype(float)


def _plane_of_most(pair: ScanPair, alignment: ScanAlignment) -> tuple[float, float, float]:
    """The plane on which most of the face lies that nothing lies above: what did not wear.

    Through medians of blocks, from random triples of these (RANSAC; Fischler and Bolles 1981), then least squares."""
    depth = pair.depth(alignment)
    x, y = pair.grid
    block = max(min(depth.shape) // 24, 1)
    places, depths = [blocks(values, block) for values in (x, y)], blocks(depth, block)
    measured = np.isfinite(depths).mean(axis=-1) > 0.5
    if measured.sum() < 12:
        raise Refusal("less than half of the face is measured in both scans: are they of the same face?")
    medians = np.full(measured.shape, np.nan)
    medians[measured] = height = np.nanmedian(depths[measured], axis=-1)
    at = np.stack([np.ones(len(height)), *(place[measured].mean(axis=-1) for place in places)], axis=1)
    scale = 3 * _local_deviation(medians)
    random = np.random.default_rng(0)
    triples = np.array([random.choice(len(at), 3, replace=False) for _ in range(1500)])
    regular = np.abs(np.linalg.det(at[triples])) > 0
    planes = np.linalg.solve(at[triples[regular]], height[triples[regular]][..., None])[..., 0]
    above = height - planes @ at.T
    score = (np.abs(above) < scale).sum(axis=1) - (above < -scale).sum(axis=1)
    plane = planes[score.argmax()]
    for _ in range(3):
        near = np.abs(height - at @ plane) < scale
        if near.sum() < 6:
            raise Refusal("no part of the face is as it was in both scans: scan more of what does not touch")
        plane = np.linalg.lstsq(at[near], height[near], rcond=None)[0]
    return float(plane[0]), float(plane[1]), float(plane[2])


def blocks(values: np.ndarray, size: int) -> np.ndarray:
    """(n, m, size**2) squares of points."""
    n, m = (length // size for length in values.shape)
    return values[: n * size, : m * size].reshape(n, size, m, size).swapaxes(1, 2).reshape(n, m, -1)


def _local_deviation(values: np.ndarray) -> float:
    """Standard deviation of noise on smooth values, by their second differences."""
    bends = np.concatenate([np.diff(values, 2, axis=axis).ravel() for axis in (0, 1)])
    return float(1.4826 * np.nanmedian(np.abs(bends)) / np.sqrt(6) + 1e-12)


def worn_places(depth: np.ndarray, scales: tuple[float, ...] = (1.0, 3.5, 12.0), level: float = 3.0) -> np.ndarray:
    """Where a face wore: its mean over some cells is lower by three deviations of what did not wear.

    depth : (nx, ny) [m];  scales : of the means, in cells; the larger ones find what is shallow and wide, outside of
    what the smaller ones found
    The deviation is that of negative depths, which no wear makes. Specks smaller than 25 scales squared are noise."""
    worn = np.zeros(depth.shape, bool)
    for cells in scales:
        mean = smooth(np.where(worn, np.nan, depth), cells)
        below = np.nan_to_num(mean) > level * deviation_of_unworn(mean)
        labels, count = ndimage.label(below | worn)
        size = np.bincount(labels.ravel(), minlength=count + 1)
        size[0] = 0
        worn |= (size > 25 * cells**2)[labels]
    return worn


def deviation_of_unworn(depth: np.ndarray) -> float:
    """Standard deviation of depth where nothing wore, by the negative ones [m]."""
    negative = -depth[depth < 0]
    return float(1.4826 * np.median(negative)) if len(negative) else 0.0


def grown(places: np.ndarray, cells: float) -> np.ndarray:
    """Places with all that is nearer to them than some cells."""
    return np.asarray(ndimage.distance_transform_edt(~places) <= cells) if places.any() else places


def _refined(pair: ScanPair, start: ScanAlignment, cells: float) -> ScanAlignment:
    """Least squares over what did not wear, of maps smoothed over some cells (Gauss-Newton)."""
    smoothed = ScanPair(replace(pair.pristine, z=smooth(pair.pristine.z, cells)) if cells else pair.pristine, pair.worn)
    worn = SmoothMap(pair.worn, cells * min(pair.pristine.spacing) / min(pair.worn.spacing))
    free = slice(0 if start.is_found else 3, 6)
    unworn = np.zeros(pair.pristine.z.shape, bool)
    for _ in range(12):
        depth = smoothed.depth(start, worn)
        if (same := unworn & np.isfinite(depth)).any():  # a step shifts all heights where it is not a small one
            offset = float(np.median(depth[same]))
            depth, start = depth - offset, replace(start, plane=(start.plane[0] + offset, *start.plane[1:]))
        rows = smoothed.rows(depth)[free]
        unworn = np.isfinite(rows.sum(axis=0) + depth) & ~grown(worn_places(depth), 6.0)
        unworn &= np.abs(depth) < 4 * deviation_of_unworn(depth)
        if unworn.sum() < 0.02 * depth.size:
            raise Refusal("less than 2 % of the face is as it was in both scans: scan more of what does not touch")
        rows = rows[:, unworn]
        scale = np.sqrt((rows**2).mean(axis=1))
        inverse = np.linalg.inv((rows / scale[:, None]) @ (rows / scale[:, None]).T) / np.outer(scale, scale)
        values, covariance = np.array([*start.shift, start.turn, *start.plane]), np.zeros((6, 6))
        covariance[free, free] = inverse
        change = covariance[:, free] @ (rows @ depth[unworn])
        place, plane = np.split(values + change, 2)
        start = ScanAlignment((place[0], place[1]), place[2], (plane[0], plane[1], plane[2]), start.texture, covariance)
        moved = np.hypot(change[0], change[1]) + abs(change[2]) * max(pair.pristine.size)
        if moved < 2e-3 * min(pair.pristine.spacing):
            break
    return start
