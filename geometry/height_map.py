"""Measured height maps: level, mirror and sample them at contact nodes; the gap between two of them.

Coordinates are those of the contact patch seen along the normal of body 1. A map of body 2 is seen along the
normal of body 2, so it must be mirrored once before it faces body 1."""

from dataclasses import dataclass, replace
from math import ceil

import numpy as np
import scipy

from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class HeightMap:
    """Heights of a face over a regular grid.

    x : (nx,) equally spaced, growing [m];  y : (ny,) [m]
    z : (nx, ny) heights along the outward normal of the face [m], NaN where not measured
    name : how messages call it"""

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


def level(surface: HeightMap) -> HeightMap:
    """Subtract the least-squares plane through the measured points."""
    x, y = np.meshgrid(surface.x - surface.x.mean(), surface.y - surface.y.mean(), indexing="ij")
    measured = np.isfinite(surface.z)
    size = max(surface.size)
    terms = np.stack([np.ones_like(x), x / size, y / size], axis=-1)
    plane, *_ = np.linalg.lstsq(terms[measured], surface.z[measured], rcond=None)
    return replace(surface, z=surface.z - terms @ plane)


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
    Raises  Refusal: nodes off the map, holes, nodes on a line
    Source  Tamatam 2021, 5.4.2: down-sampling by elemental area; here a point belongs to its nearest node"""
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
    Source  Tamatam 2021, 5.5: simulations 1, 2, 3 are mating heights 0, +3 and -3 um"""
    together = np.asarray(heights_1, float) + np.asarray(heights_2, float)
    if not np.isfinite(together).all():
        raise Refusal("a contact node has no height: fill the holes of both height maps first")
    return together.max() - together - mating_height


def synthetic_pair(
    seed: int, size: tuple[float, float] = (2e-3, 5e-3), spacing: float = 10e-6, ridge: float = 6e-6,
    waviness: float = 0.3e-6, roughness: float = 1e-6,
) -> tuple[HeightMap, HeightMap]:  # fmt: skip
    """A made-up pair of faces for the unpublished ones of the rig, in patch coordinates and already facing.

    The first has two ridges along its long edges, the second none; both have waviness and roughness.

    size : sides in x and y [m];  spacing : of the grid [m]
    ridge : height of the ridges over the middle [m]
    waviness, roughness : root mean square of random waves about 1 mm and about 50 um long [m]"""
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
