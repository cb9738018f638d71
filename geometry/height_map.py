"""Measured height maps: is it plausible, mend it, level it, part waviness from roughness; two maps face to face.

`prepare` runs the steps in order: refuse what cannot be a machined face, take spikes out, close holes, level, filter.
Each step that changes measured points reports it in a sentence.
Coordinates are those of the contact patch seen along the normal of body 1. A face of body 2 is measured looking at it,
so it must be mirrored once before it faces body 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil

import numpy as np
import scipy
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from tribodyn.refusal import Refusal

GAUSS_CONSTANT = np.sqrt(np.log(2) / np.pi)
"""alpha of ISO 16610-21: a wave as long as the cut-off passes with one half of its amplitude."""


@dataclass(frozen=True)
class MapLimits:
    """What a measured face can be.

    largest, smallest : sides [m] beyond which the lateral unit must be wrong
    steepest : median slope beyond which the height unit must be wrong; machined faces have some hundredths
    flattest : peak to valley [m], about an atom, below which the height unit must be wrong
    spike : distance of a spike from its surroundings, in robust standard deviations (1.4826 times the median of all
        distances); it also stands out by a tenth of the height that nine tenths of the levelled surface keep to, so
        that smooth maps lose no crests
    spikes, holes : shares of the points beyond which a map is refused
    summits : below which there are no statistics of them
    terraces : points with a highest neighbour as high, over summits, beyond which the heights come in steps
    """

    largest: float = 1.0
    smallest: float = 1e-6
    steepest: float = 1.0
    flattest: float = 1e-10
    spike: float = 8.0
    spikes: float = 0.05
    holes: float = 0.2
    summits: int = 30
    terraces: float = 0.1


LIMITS = MapLimits()


@dataclass(frozen=True)
class HeightMap:
    """Heights of a face over a regular grid.

    x : (nx,) equally spaced, growing [m];  y : (ny,) [m]
    z : (nx, ny) heights along the outward normal of the face [m], NaN where not measured
    name : how messages call it
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    name: str = "height map"

    def __post_init__(self) -> None:
        if self.z.shape != (len(self.x), len(self.y)):
            raise Refusal(
                f"{self.name}: heights have shape {self.z.shape} but the axes {len(self.x)} and {len(self.y)} points"
            )
        if min(self.z.shape) < 4:
            raise Refusal(f"{self.name}: {self.z.shape[0]} x {self.z.shape[1]} points are too few for a face")
        for axis, values in (("x", self.x), ("y", self.y)):
            steps = np.diff(values)
            if not (np.isfinite(values).all() and (steps > 0).all() and np.ptp(steps) <= 1e-3 * steps.mean()):
                raise Refusal(f"{self.name}: {axis} is not growing in equal steps: resample it to a regular grid")

    @property
    def spacing(self) -> tuple[float, float]:
        """Steps along x and y [m]."""
        return float(np.ptp(self.x) / (len(self.x) - 1)), float(np.ptp(self.y) / (len(self.y) - 1))

    @property
    def size(self) -> tuple[float, float]:
        """Sides [m]."""
        return float(np.ptp(self.x)), float(np.ptp(self.y))


@dataclass(frozen=True)
class PreparedMap:
    """A height map ready for contact.

    waviness, roughness : levelled parts; their sum is the levelled surface
    repairs : one sentence for each thing that was changed
    """

    waviness: HeightMap
    roughness: HeightMap
    repairs: tuple[str, ...]


def prepare(surface: HeightMap, cutoff: float, expected_size: tuple[float, float] | None = None) -> PreparedMap:
    """Check, mend, level and split a measured surface.

    cutoff : wavelength that parts waviness from roughness [m]
    expected_size : sides of the face it should cover [m]
    Raises  ValueError: what the steps refuse
    """
    levelled, repairs = repair(surface, expected_size)
    return PreparedMap(*split(levelled, cutoff), repairs)


def repair(surface: HeightMap, expected_size: tuple[float, float] | None = None) -> tuple[HeightMap, tuple[str, ...]]:
    """The map without spikes and holes, levelled, and what was changed; arguments and errors as of `prepare`."""
    check(surface, expected_size)
    without_spikes, spikes = remove_outliers(surface)
    whole, holes = fill_holes(without_spikes)
    return level(whole), (*spikes, *holes)


def check(surface: HeightMap, expected_size: tuple[float, float] | None = None) -> None:
    """Raise ValueError for a map that cannot be a measured face in metres.

    expected_size : sides it should cover [m]; up to five times as large is taken as a wider measurement
    """
    name = surface.name
    if not np.isfinite(surface.z).any():
        raise Refusal(f"{name}: no point has a height: check the file and its missing-value code")
    for axis, side in zip("xy", surface.size, strict=True):
        if not LIMITS.smallest <= side <= LIMITS.largest:
            raise Refusal(f"{name}: it is {side:g} m long in {axis}: give the lateral unit, 1e-6 for micrometres")
    if expected_size is not None:
        for axis, side, wanted in zip("xy", surface.size, expected_size, strict=True):
            if not 0.98 * wanted <= side <= 5 * wanted:
                raise Refusal(
                    f"{name}: it covers {side:g} m in {axis} but the contact {wanted:g} m: are map and unit right?"
                )
    slopes = [np.abs(np.diff(surface.z, axis=axis)) / step for axis, step in enumerate(surface.spacing)]
    known = np.concatenate([slope[np.isfinite(slope)] for slope in slopes])
    if known.size and np.median(known) > LIMITS.steepest:
        raise Refusal(
            f"{name}: its median slope is {np.median(known):.3g}, steeper than any machined face: "
            "give the height unit, such as 1e-6 for micrometres"
        )
    span = np.nanmax(surface.z) - np.nanmin(surface.z)
    if 0 < span < LIMITS.flattest:
        raise Refusal(f"{name}: peak to valley is {span:.3g} m, less than an atom: give the height unit")


def remove_outliers(surface: HeightMap) -> tuple[HeightMap, list[str]]:
    """Turn spikes into holes: points far off the median of the 5 x 5 points around them.

    Returns the map with NaN at spikes, and what was done
    """
    measured = np.isfinite(surface.z)
    nearest = scipy.ndimage.distance_transform_edt(~measured, return_distances=False, return_indices=True)
    closed = surface.z[tuple(nearest)]
    distance = np.abs(closed - scipy.ndimage.median_filter(closed, size=5, mode="nearest"))
    sigma = 1.4826 * np.median(distance[measured])
    low, high = np.percentile(level(surface).z[measured], (5, 95))
    spikes = measured & (distance > LIMITS.spike * sigma) & (distance > 0.1 * (high - low))
    count = int(spikes.sum())
    if count == 0:
        return surface, []
    if count > LIMITS.spikes * measured.sum():
        raise Refusal(
            f"{surface.name}: {count} of {measured.sum()} points are spikes: this is noise, not a face with outliers"
        )
    largest = distance[spikes].max()
    return replace(surface, z=np.where(spikes, np.nan, surface.z)), [
        f"{surface.name}: {count} spikes up to {largest:.3g} m off their surroundings were taken out"
    ]


def fill_holes(surface: HeightMap) -> tuple[HeightMap, list[str]]:
    """Close holes with the surface that has no curvature of its own there (Laplace), bounded by its rim.

    Returns the map without NaN, and what was done
    """
    holes = ~np.isfinite(surface.z)
    count = int(holes.sum())
    if count == 0:
        return surface, []
    if count > LIMITS.holes * holes.size:
        raise Refusal(
            f"{surface.name}: {100 * count / holes.size:.0f} % of its points have no height, more than "
            f"{100 * LIMITS.holes:.0f} %: measure again or crop it"
        )
    number = np.full(holes.shape, -1)
    number[holes] = np.arange(count)
    diagonal, known = np.zeros(count), np.zeros(count)
    rows, columns, values = [], [], []
    for axis, step in enumerate(surface.spacing):
        for side in (1, -1):
            middle = [slice(None), slice(None)]
            beside = [slice(None), slice(None)]
            middle[axis], beside[axis] = (slice(None, -1), slice(1, None))[::side]
            inner = holes[tuple(middle)]
            row, neighbour = number[tuple(middle)][inner], number[tuple(beside)][inner]
            weight = 1 / step**2
            diagonal[row] += weight
            inside = neighbour >= 0
            rows.append(row[inside])
            columns.append(neighbour[inside])
            values.append(np.full(inside.sum(), -weight))
            known[row[~inside]] += weight * surface.z[tuple(beside)][inner][~inside]
    at = (np.concatenate(rows), np.concatenate(columns))
    laplace = sp.coo_matrix((np.concatenate(values), at), shape=(count, count))
    z = surface.z.copy()
    z[holes] = spsolve((laplace + sp.diags(diagonal)).tocsc(), known)
    return replace(surface, z=z), [
        f"{surface.name}: {count} points without height ({100 * count / holes.size:.2g} %) were filled from their rim"
    ]


def level(surface: HeightMap) -> HeightMap:
    """Subtract the least-squares plane through the measured points."""
    x, y = np.meshgrid(surface.x - surface.x.mean(), surface.y - surface.y.mean(), indexing="ij")
    measured = np.isfinite(surface.z)
    size = max(surface.size)
    terms = np.stack([np.ones_like(x), x / size, y / size], axis=-1)
    plane, *_ = np.linalg.lstsq(terms[measured], surface.z[measured], rcond=None)
    return replace(surface, z=surface.z - terms @ plane)


def split(surface: HeightMap, cutoff: float) -> tuple[HeightMap, HeightMap]:
    """Part waviness from roughness by the areal Gaussian filter.

    cutoff : wavelength [m] of which one half of the amplitude goes to either part
    Returns (waviness, roughness), their sum is the surface
    Raises  ValueError: holes, or a cut-off that the map cannot hold
    Source  ISO 16610-61 (areal Gaussian, separable), weights of ISO 16610-21 out to one cut-off; at the edges the local
        linear fit with the same weights, which keeps planes (moment criterion of ISO 16610-28)
    """
    if not np.isfinite(surface.z).all():
        raise Refusal(f"{surface.name}: it has points without height: fill the holes before filtering")
    if not 2 * max(surface.spacing) <= cutoff <= min(surface.size):
        raise Refusal(
            f"{surface.name}: cutoff {cutoff:g} m must lie between two steps of the grid "
            f"({2 * max(surface.spacing):g} m) and the shorter side ({min(surface.size):g} m)"
        )
    smooth = surface.z
    for axis, step in enumerate(surface.spacing):
        smooth = _local_linear(smooth, axis, step, cutoff)
    return replace(surface, z=smooth), replace(surface, z=surface.z - smooth)


def _local_linear(z: np.ndarray, axis: int, step: float, cutoff: float) -> np.ndarray:
    """Value at each point of the line fitted with Gaussian weights to the points around it, along one axis."""
    reach = int(cutoff / step)
    offset = np.arange(-reach, reach + 1) * (step / cutoff)
    weight = np.exp(-np.pi * (offset / GAUSS_CONSTANT) ** 2)  # ISO 16610-21, eq. 1, up to its norm
    from scipy.signal import fftconvolve  # half a second to load, and few scenes have surfaces

    def moment(values: np.ndarray, order: int) -> np.ndarray:
        kernel = (weight * offset**order)[::-1]
        return fftconvolve(values, kernel[:, None], "same", axes=0)

    z = z if axis == 0 else z.T
    s0, s1, s2 = (moment(np.ones((len(z), 1)), order) for order in (0, 1, 2))
    fitted = (s2 * moment(z, 0) - s1 * moment(z, 1)) / (s0 * s2 - s1**2)
    return fitted if axis == 0 else fitted.T


def centred(surface: HeightMap) -> HeightMap:
    """The same map with its middle at the origin."""
    x, y = (axis - (axis[0] + axis[-1]) / 2 for axis in (surface.x, surface.y))
    return replace(surface, x=x, y=y)


def mirrored(surface: HeightMap, axis: str) -> HeightMap:
    """The map seen from behind: reversed along "x" or "y", in the same place."""
    if axis not in ("x", "y"):
        raise Refusal(f"cannot mirror along {axis!r}: give x or y")
    return replace(surface, z=np.flip(surface.z, 0 if axis == "x" else 1))


def onto_nodes(surface: HeightMap, nodes: np.ndarray, cells_across: int = 8) -> np.ndarray:
    """Mean height over the tributary area of each contact node.

    nodes : (n, 2) positions in the coordinates of the map [m]; the patch is their convex hull
    cells_across : sampling cells across the distance of neighbouring nodes, at least
    Returns (n,) heights [m]; weighted by tributary area their mean is the mean height of the patch
    Raises  ValueError: nodes off the map, holes, nodes on a line
    Source  Tamatam 2021, 5.4.2: down-sampling by elemental area; here a point belongs to its nearest node
    """
    nodes = np.asarray(nodes, float).reshape(-1, 2)
    if not np.isfinite(surface.z).all():
        raise Refusal(f"{surface.name}: it has points without height: fill the holes before it meets the nodes")
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    for k, (axis, step) in enumerate(zip((surface.x, surface.y), surface.spacing, strict=True)):
        if low[k] < axis[0] - step / 2 or high[k] > axis[-1] + step / 2:
            raise Refusal(
                f"{surface.name}: it spans {axis[0]:g} to {axis[-1]:g} m in {'xy'[k]} but the contact nodes "
                f"{low[k]:g} to {high[k]:g} m: centre it on the patch or measure the whole face"
            )
    try:
        sides = scipy.spatial.ConvexHull(nodes).equations
    except (scipy.spatial.QhullError, ValueError):
        raise Refusal(f"{surface.name}: {len(nodes)} contact nodes on a line span no area to average over") from None
    tree = scipy.spatial.cKDTree(nodes)
    distance = tree.query(nodes, 2)[0][:, 1].min()
    if not distance > 0:
        raise Refusal(f"{surface.name}: two contact nodes are in the same place")
    counts = [
        ceil(side / min(step, distance / cells_across) - 1e-9)
        for side, step in zip(high - low, surface.spacing, strict=True)
    ]
    x, y = (start + (np.arange(n) + 0.5) / n * (stop - start) for start, stop, n in zip(low, high, counts, strict=True))
    cells = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    cells = cells[(cells @ sides[:, :2].T + sides[:, 2] <= 0).all(axis=1)]
    limits = np.array([[surface.x[0], surface.y[0]], [surface.x[-1], surface.y[-1]]])
    heights = scipy.interpolate.RegularGridInterpolator((surface.x, surface.y), surface.z)(np.clip(cells, *limits))
    owner = tree.query(cells)[1]
    share = np.bincount(owner, minlength=len(nodes))
    return np.bincount(owner, heights, minlength=len(nodes)) / share


def facing_gap(heights_1: np.ndarray, heights_2: np.ndarray, mating_height: float = 0.0) -> np.ndarray:
    """Gap of two faces at the contact nodes.

    heights_1, heights_2 : (n,) heights of body 1 and of body 2 at the pairs, each along its own outward normal [m]
    mating_height : how far the bodies are pushed on from their first touch [m]; negative leaves them apart
    Returns (n,) gap [m], negative where they interfere; its smallest value is -mating_height
    Source  Tamatam 2021, 5.5: simulations 1, 2, 3 are mating heights 0, +3 and -3 um
    """
    together = np.asarray(heights_1, float) + np.asarray(heights_2, float)
    if not np.isfinite(together).all():
        raise Refusal("a contact node has no height: fill the holes of both height maps first")
    return together.max() - together - mating_height


def synthetic_pair(
    seed: int,
    size: tuple[float, float] = (2e-3, 5e-3),
    spacing: float = 10e-6,
    ridge: float = 6e-6,
    waviness: float = 0.3e-6,
    roughness: float = 1e-6,
) -> tuple[HeightMap, HeightMap]:
    """A made-up pair of faces for the unpublished ones of the rig, in patch coordinates and already facing.

    The first has two ridges along its long edges, the second none; both have waviness and roughness.

    size : sides in x and y [m];  spacing : of the grid [m]
    ridge : height of the ridges over the middle [m]
    waviness, roughness : root mean square of random waves about 1 mm and about 50 um long [m]
    """
    for name, value in (("size", min(size)), ("spacing", spacing)):
        if not value > 0:
            raise Refusal(f"{name} of the synthetic pair must be positive")
    random = np.random.default_rng(seed)
    x, y = (np.linspace(-side / 2, side / 2, round(side / spacing) + 1) for side in size)
    across, width = (x[:, None], size[0]) if size[0] <= size[1] else (y[None, :], size[1])
    form = ridge * np.sin(np.pi * across / width) ** 4 + np.zeros((len(x), len(y)))

    def waves(length: float, rms: float) -> np.ndarray:
        field = scipy.ndimage.gaussian_filter(
            random.standard_normal(form.shape), length / (2 * np.pi) / spacing, mode="reflect"
        )
        return rms * field / field.std()

    rough = [waves(1e-3, waviness) + waves(50e-6, roughness) for _ in range(2)]
    return HeightMap(x, y, form + rough[0], "synthetic body 1"), HeightMap(x, y, rough[1], "synthetic body 2")
