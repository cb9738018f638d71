"""Curves about an axis, and rings of cells between two of them: holes, shanks, washers, nuts and heads of bolts.

A curve gives the points (n, 2) at fractions u of a turn; a ring is a block over (u, v, z) with v from 0 on its inner
curve to 1 on its outer one."""

from collections.abc import Callable, Mapping

import numpy as np

from tribodyn.geometry.blocks import Block

Curve = Callable[[np.ndarray], np.ndarray]


def circle(radius: float, start: float = 0.0) -> Curve:
    """A circle; start : angle of u = 0 [rad]."""

    def points(u: np.ndarray) -> np.ndarray:
        angle = start + 2 * np.pi * u
        return radius * np.column_stack([np.cos(angle), np.sin(angle)])

    return points


def hexagon(flats: float) -> Curve:
    """A regular hexagon by its width across flats, by angle from the middle of a flat at u = 0."""

    def points(u: np.ndarray) -> np.ndarray:
        angle = 2 * np.pi * u
        off = np.mod(angle + np.pi / 6, np.pi / 3) - np.pi / 6
        return (flats / 2 / np.cos(off))[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])

    return points


def polygon(corners: np.ndarray) -> Curve:
    """A closed polygon (k, 2) whose sides take equal parts of the turn, from its first corner on."""
    closed = np.vstack([corners, corners[:1]])

    def points(u: np.ndarray) -> np.ndarray:
        at = np.mod(u, 1.0) * len(corners)
        side = np.minimum(at.astype(int), len(corners) - 1)
        part = (at - side)[:, None]
        return (1 - part) * closed[side] + part * closed[side + 1]

    return points


def ring(
    inner: Curve, outer: Curve, angles: int, across: int, z: np.ndarray, volume: str,
    sides: Mapping[str, str] | None = None, centre: tuple[float, float] = (0.0, 0.0),
) -> Block:  # fmt: skip
    """Cells between two curves: so many around and across, and between the heights z (k,) [m].

    sides : "v-" is the inner one, "v+" the outer one, "w-" and "w+" the ends along z"""

    def mapped(position: np.ndarray) -> np.ndarray:
        u, v, height = position.T
        plane = (1 - v)[:, None] * inner(u) + v[:, None] * outer(u) + np.asarray(centre)
        return np.column_stack([plane, height])

    return Block(np.linspace(0, 1, angles + 1), np.linspace(0, 1, across + 1), z, volume, sides or {}, mapped)


def core(half: float, across: int, z: np.ndarray, volume: str, sides: Mapping[str, str] | None = None) -> Block:
    """The square inside a disk, its corners on the axes at a distance `half`, with cells that meet a ring about it."""

    def mapped(position: np.ndarray) -> np.ndarray:
        u, v, height = position.T
        return np.column_stack([half * (1 - u - v), half * (u - v), height])

    side = np.linspace(0, 1, across + 1)
    return Block(side, side, z, volume, sides or {}, mapped)
