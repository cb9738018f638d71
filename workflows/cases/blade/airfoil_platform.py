"""A platform around an airfoil section: three by three blocks, the section in the middle, straight edges outside.

The sections are cambered, blunt at both edges, turned by their stagger.

Rows i run from front to rear, columns j from left to right; corner (i, j) of the 4 x 4 corners belongs to blocks on
all its sides, so blocks meet node to node by construction."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from tribodyn.geometry.blocks import Block

Names = Mapping[tuple[int, int], Mapping[str, str]]


@dataclass(frozen=True)
class Section:
    """chord, thickness : [m]; camber : height of the mean line over the chord; edge : thickness at the leading and the
    trailing edge over that at mid-chord; stagger : angle from x to the chord [rad]."""

    chord: float
    thickness: float
    camber: float
    edge: float
    stagger: float

    def at(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions x, y [m] at fractions u of the chord and v of the thickness, centred on the mean line.

        Mean line and thickness are parabolas: no sharp edge folds a cell"""
        bulge = 4 * u * (1 - u)
        slope = 4 * self.camber * (1 - 2 * u)
        offset = (v - 0.5) * self.thickness * (self.edge + (1 - self.edge) * bulge)
        x = (u - 0.5) * self.chord - offset * slope / np.hypot(1, slope)
        y = self.camber * self.chord * (bulge - 2 / 3) + offset / np.hypot(1, slope)
        c, s = np.cos(self.stagger), np.sin(self.stagger)
        return x * c - y * s, x * s + y * c


def between(root: Section, tip: Section, height: np.ndarray) -> Section:
    """Section at fractions `height` of the span, every property linear from root to tip (arrays like `height`)."""
    names = ("chord", "thickness", "camber", "edge", "stagger")
    a, b = ([getattr(s, n) for n in names] for s in (root, tip))
    return Section(*(np.asarray(p + (q - p) * height) for p, q in zip(a, b, strict=True)))  # type: ignore[arg-type]


@dataclass(frozen=True)
class Platform:
    """corners : (2, 4, 4, 3) bottom and top [m]; the inner ones are those of the section; section : in the middle."""

    corners: np.ndarray
    section: Section

    def position(self, i: int, j: int, p: np.ndarray) -> np.ndarray:
        """Map (n, 3) fractions (rearwards, rightwards, upwards) of block (i, j) into space [m].

        Source  Coons patch whose one curved edge is that of the section (Gordon and Hall 1973)"""
        weights = [np.stack([1 - t, t]) for t in p.T]
        straight = np.einsum("an,bn,cn,cabx->nx", *weights, self.corners[:, i : i + 2, j : j + 2])
        a, b = p[:, 0], p[:, 1]
        ones, zeros = np.ones_like(a), np.zeros_like(a)
        curved = {
            (1, 1): (a, b, ones),
            (1, 2): (a, ones, 1 - b),
            (1, 0): (a, zeros, b),
            (0, 1): (zeros, b, a),
            (2, 1): (ones, b, 1 - a),
        }
        if (i, j) in curved:
            u, v, fading = curved[i, j]
            straight[:, :2] += fading[:, None] * self._bulge(u, v)
        return straight

    def _bulge(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """(n, 2) how far the section lies from the straight quadrilateral of its corners [m]."""
        square = np.array([0.0, 0.0, 1.0, 1.0]), np.array([0.0, 1.0, 0.0, 1.0])
        weights = np.stack([(1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v])
        exact, corners = np.stack(self.section.at(u, v)), np.stack(self.section.at(*square))
        return (exact - corners @ weights).T

    def mapping(self, i: int, j: int) -> Callable[[np.ndarray], np.ndarray]:
        """`position` of one block."""
        return lambda p: self.position(i, j, p)

    def blocks(
        self, n_row: tuple[int, ...], n_column: tuple[int, ...], n_up: int, volume: str, names: Names
    ) -> list[Block]:
        """The nine blocks with uniform cells.

        n_row, n_column : elements of the three rows and columns; n_up : elements upwards
        names : (i, j) -> names of sides of that block"""
        return [
            Block(unit(n_row[i]), unit(n_column[j]), unit(n_up), volume, names.get((i, j), {}), self.mapping(i, j))
            for i in range(3)
            for j in range(3)
        ]


def platform(section: Section, heights: tuple[float, float], left_edge: np.ndarray, right_edge: np.ndarray) -> Platform:
    """Platform around a section from its left and right edge.

    heights : z of the section at bottom and top [m]
    left_edge, right_edge : (2, 4, 3) points of the edges at bottom and top, from front to rear [m]"""
    corners = np.empty((2, 4, 4, 3))
    corners[:, :, 0], corners[:, :, 3] = left_edge, right_edge
    u, v = np.array([0.0, 1.0])[:, None], np.array([0.0, 1.0])[None, :]
    x, y = section.at(*np.broadcast_arrays(u, v))
    corners[:, 1:3, 1:3, 0], corners[:, 1:3, 1:3, 1] = x, y
    corners[:, 1:3, 1:3, 2] = np.asarray(heights)[:, None, None]
    lean = np.tan(section.stagger / 2)  # edges leave the section half-way between the chord and the axis
    for end, inner in ((0, 0), (3, 1)):
        first, last = corners[:, end, 0], corners[:, end, 3]
        aim = y[inner] + lean * (first[0, 0] - x[inner])
        for j, fraction in enumerate((aim - first[0, 1]) / (last[0, 1] - first[0, 1]), start=1):
            corners[:, end, j] = first + fraction * (last - first)
    return Platform(corners, section)


def unit(n: int) -> np.ndarray:
    """(n + 1,) uniform positions from 0 to 1."""
    return np.linspace(0.0, 1.0, n + 1)
