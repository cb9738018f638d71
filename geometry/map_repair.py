"""Check and repair measured height maps, and split them into waviness and roughness.

`repair` runs the steps in order: refuse what cannot be a machined face, take spikes out, close holes, level; `split`
filters. Each step that changes measured points reports it in a sentence."""

from dataclasses import dataclass, replace

import numpy as np
import scipy
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from tribodyn.geometry.height_map import HeightMap, level
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
    terraces : points with a highest neighbour as high, over summits, beyond which the heights come in steps"""

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


def repair(surface: HeightMap, expected_size: tuple[float, float] | None = None) -> tuple[HeightMap, tuple[str, ...]]:
    """The map without spikes and holes, levelled, and a sentence for each thing that was changed.

    expected_size : sides of the face it should cover [m]
    Raises  Refusal: what the steps refuse"""
    check(surface, expected_size)
    without_spikes, spikes = remove_outliers(surface)
    filled, holes = fill_holes(without_spikes)
    return level(filled), (*spikes, *holes)


def check(surface: HeightMap, expected_size: tuple[float, float] | None = None) -> None:
    """Raise Refusal for a map that cannot be a measured face in metres.

    expected_size : sides it should cover [m]; up to five times as large is taken as a wider measurement"""
    name = surface.name
    if not np.isfinite(surface.z).any():
        raise Refusal(f"{name}: no point has a height: check the file and its missing-value code")
    for axis, side in zip("xy", surface.size, strict=True):
        if not LIMITS.smallest <= side <= LIMITS.largest:
            raise Refusal(f"{name}: it is {side:g} m long in {axis}: give the lateral unit, 1e-6 for micrometres")
    if expected_size is not None:
        for axis, side, expected in zip("xy", surface.size, expected_size, strict=True):
            if not 0.98 * expected <= side <= 5 * expected:
                raise Refusal(
                    f"{name}: it covers {side:g} m in {axis} but the contact {expected:g} m: are map and unit right?"
                )
    slopes = [np.abs(np.diff(surface.z, axis=axis)) / step for axis, step in enumerate(surface.spacing)]
    finite_slopes = np.concatenate([slope[np.isfinite(slope)] for slope in slopes])
    if finite_slopes.size and np.median(finite_slopes) > LIMITS.steepest:
        raise Refusal(
            f"{name}: its median slope is {np.median(finite_slopes):.3g}, steeper than any machined face: "
            "give the height unit, such as 1e-6 for micrometres"
        )
    span = np.nanmax(surface.z) - np.nanmin(surface.z)
    if 0 < span < LIMITS.flattest:
        raise Refusal(f"{name}: peak to valley is {span:.3g} m, less than an atom: give the height unit")


def remove_outliers(surface: HeightMap) -> tuple[HeightMap, list[str]]:
    """Turn spikes into holes: points far off the median of the 5 x 5 points around them, and off a fifth of these.

    A point of a wall, as at the rim of a worn place, is as high as others along the wall: it is no spike.
    Returns the map with NaN at spikes, and a sentence on each change"""
    measured = np.isfinite(surface.z)
    nearest = scipy.ndimage.distance_transform_edt(~measured, return_distances=False, return_indices=True)
    closed = surface.z[tuple(nearest)]
    distance = np.abs(closed - scipy.ndimage.median_filter(closed, size=5, mode="nearest"))
    sigma = 1.4826 * np.median(distance[measured])
    low, high = np.percentile(level(surface).z[measured], (5, 95))
    least = np.maximum(LIMITS.spike * sigma, 0.1 * (high - low))
    lower, higher = (scipy.ndimage.rank_filter(closed, rank, size=5, mode="mirror") for rank in (5, -6))
    spikes = measured & (distance > least) & ((closed < lower - least) | (closed > higher + least))
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

    Returns the map without NaN, and a sentence on each change"""
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
    diagonal, rim_heights = np.zeros(count), np.zeros(count)
    rows, columns, values = [], [], []
    for axis, step in enumerate(surface.spacing):
        for side in (1, -1):
            middle = [slice(None), slice(None)]
            neighbours = [slice(None), slice(None)]
            middle[axis], neighbours[axis] = (slice(None, -1), slice(1, None))[::side]
            inner = holes[tuple(middle)]
            row, neighbour = number[tuple(middle)][inner], number[tuple(neighbours)][inner]
            weight = 1 / step**2
            diagonal[row] += weight
            inside = neighbour >= 0
            rows.append(row[inside])
            columns.append(neighbour[inside])
            values.append(np.full(inside.sum(), -weight))
            rim_heights[row[~inside]] += weight * surface.z[tuple(neighbours)][inner][~inside]
    at = (np.concatenate(rows), np.concatenate(columns))
    laplace = sp.coo_matrix((np.concatenate(values), at), shape=(count, count))
    z = surface.z.copy()
    z[holes] = spsolve((laplace + sp.diags(diagonal)).tocsc(), rim_heights)
    return replace(surface, z=z), [
        f"{surface.name}: {count} points without height ({100 * count / holes.size:.2g} %) were filled from their rim"
    ]


def split(surface: HeightMap, cutoff: float) -> tuple[HeightMap, HeightMap]:
    """Part waviness from roughness by the areal Gaussian filter.

    cutoff : wavelength [m] at which each part takes half of the amplitude
    Returns (waviness, roughness), their sum is the surface
    Raises  Refusal: holes, or a cut-off that the map cannot hold
    Source  ISO 16610-61 (areal Gaussian, separable), weights of ISO 16610-21 out to one cut-off; at the edges the local
        linear fit with the same weights, which keeps planes (moment criterion of ISO 16610-28)"""
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
