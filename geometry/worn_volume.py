"""How much of a face wore, and how sure that is: area, volume and depth of the difference of two scans that lie on
each other."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from tribodyn.geometry.height_map import HeightMap
from tribodyn.geometry.map_repair import check, fill_holes, remove_outliers
from tribodyn.geometry.scan_alignment import (
    ScanAlignment,
    ScanPair,
    align,
    blocks,
    deviation_of_unworn,
    grown,
    smooth,
    worn_places,
)


@dataclass(frozen=True)
class WornFace:
    """What wore between two scans of a face.

    pair : of scans without spikes;  alignment : of the second on the first
    depth : (nx, ny) on the points of the first [m], filled where it wore, nan where not measured
    worn, region : (nx, ny) where depth is above the noise; where it is summed up, which is wider
    noise : standard deviation of depth where nothing wore, of a point [m];  cell : area of a point [m2]
    volume, area, deepest : [m3], [m2], [m]; the depth over a mean of some points
    deviations : standard deviations of the volume by their cause [m3]
    missing : share of the region without measured depth;  remarks : sentences on what was changed or is in doubt"""

    pair: ScanPair
    alignment: ScanAlignment
    depth: np.ndarray
    worn: np.ndarray
    region: np.ndarray
    noise: float
    volume: float
    area: float
    deepest: float
    deviations: Mapping[str, float]
    missing: float
    remarks: tuple[str, ...]

    @property
    def volume_deviation(self) -> float:
        """Standard deviation of the volume [m3]."""
        return float(np.sqrt(sum(part**2 for part in self.deviations.values())))

    @property
    def map(self) -> HeightMap:
        """Depth as a height map, coordinates from the middle of the first scan; 0 where nothing was measured."""
        x, y = self.pair.grid
        return HeightMap(x[:, 0], y[0], np.nan_to_num(smooth(self.depth, 3.0)), f"depth of {self.pair.worn.name}")


def compare_scans(pristine: HeightMap, worn: HeightMap) -> WornFace:
    """Lay a worn scan on the pristine one, and measure what wore.

    Raises  Refusal: maps that cannot be faces, no overlap, too little that did not wear, too many holes"""
    scans, remarks = [], []
    for scan in (pristine, worn):
        check(scan)
        without_spikes, repairs = remove_outliers(scan)
        scans.append(without_spikes)
        remarks += repairs
    pair = ScanPair(*scans)
    alignment = align(pair)
    depth, covered = pair.depth(alignment), ndimage.binary_erosion(pair.overlap(alignment), iterations=3)
    measured = np.isfinite(depth)
    nearest = ndimage.distance_transform_edt(~measured, return_distances=False, return_indices=True)
    by_nearest = np.where(covered, depth[tuple(nearest)], np.nan)
    places = worn_places(by_nearest)
    if (places & ~ndimage.binary_erosion(covered, iterations=3)).any():
        remarks.append("what wore reaches the rim of the scans: wear beyond it is not counted")
    region = grown(places, 6.0) & covered
    inside = replace(pair.pristine, z=np.where(region, depth, 0.0), name=f"depth of {pair.worn.name} where it wore")
    filled = np.where(region, fill_holes(inside)[0].z, depth)
    cell = float(np.prod(pair.pristine.spacing))
    middle = ndimage.median_filter(np.nan_to_num(filled), 5)  # keeps edges where they are
    worn_area = region & (middle > 3 * deviation_of_unworn(middle[measured & ~region]))
    deviations = {
        **_by_noise(pair, alignment, depth, region, cell),
        "rim": cell * _error_of_rim(filled, worn_area),
        "threshold": cell * abs(float(by_nearest[places & ~worn_places(by_nearest, level=6.0)].sum())),
        "missing points": cell * abs(float((filled - by_nearest)[region].sum())),
    }
    return WornFace(
        pair, alignment, filled, worn_area, region, noise=deviation_of_unworn(depth[measured & ~region]),
        volume=cell * float(filled[region].sum()),
        deviations=deviations,
        area=cell * float(worn_area.sum()),
        deepest=float(np.max(smooth(filled, 3.0)[region], initial=0.0)),
        missing=float((region & ~measured).sum() / max(region.sum(), 1)),
        remarks=tuple(remarks),
    )  # fmt: skip


def _error_of_rim(depth: np.ndarray, worn: np.ndarray) -> float:
    """Standard deviation of the sum of depths [m] by walls that may stand anywhere between two points.

    A step between neighbours is uncertain by a twelfth of its square; those across one line of points stand alike"""
    rim = grown(worn, 3.0) & grown(~worn, 3.0)
    along, across = (np.diff(np.where(rim, depth, np.nan), axis=axis) for axis in (0, 1))
    steps = np.concatenate([np.nansum(along, axis=1), np.nansum(across, axis=0)])
    return float(np.sqrt((steps**2).sum() / 12))


def _by_noise(
    pair: ScanPair, alignment: ScanAlignment, depth: np.ndarray, region: np.ndarray, cell: float
) -> dict[str, float]:
    """Standard deviations of the volume of a region by noise, and by the alignment that the noise disturbs [m3].

    Noise of neighbours is correlated: a mean over a square scatters as one over fewer points would. Their number is
    that of the squares, of any side, whose means scatter most for their size"""
    remaining = np.where(region, np.nan, depth)
    variance, cells = float(np.nanvar(remaining)), 1.0
    side = 2
    while side <= min(depth.shape) // 10:
        squares = blocks(remaining, side)
        full = np.isfinite(squares).mean(axis=-1) > 0.5
        if full.sum() >= 20:
            means = np.nanmean(squares[full], axis=-1)
            weight = np.isfinite(squares[full]).sum(axis=-1).mean()
            cells = max(cells, float(means.var() * weight / variance))
        side *= 2
    rows = np.nan_to_num(pair.rows(depth)[:, region]).sum(axis=1)
    scale = cell * np.sqrt(variance * cells)
    return {
        "noise": scale * float(np.sqrt(region.sum())),
        "alignment": scale * float(np.sqrt(max(rows @ alignment.covariance @ rows, 0.0))),
    }
