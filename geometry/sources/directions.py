"""Local coordinate systems of decks: places given in them, and the directions of a material at a place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
import scipy

from tribodyn.geometry.placement import rotation
from tribodyn.refusal import Refusal


class Directions(Protocol):
    """Three directions that may change from place to place."""

    def at(self, points: np.ndarray) -> np.ndarray:
        """(n, 3, 3) at points (n, 3): the rows are unit vectors, orthogonal by the right hand."""
        ...

    def scaled(self, metre: float) -> Directions:
        """The same where lengths are counted in another unit."""
        ...


def orthogonal(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(..., 3, 3) rows: along the first vector, in the plane of both, and normal to it.

    Raises  Refusal where the two are parallel"""
    third = np.cross(first, second)
    size = np.linalg.norm(third, axis=-1)
    if not (size > 1e-9 * np.linalg.norm(first, axis=-1) * np.linalg.norm(second, axis=-1)).all():
        raise Refusal("two axes of a local system are parallel or zero: correct its points")
    rows = np.stack([first, np.cross(third, first), third], axis=-2)
    return np.asarray(rows / np.linalg.norm(rows, axis=-1, keepdims=True))


@dataclass(frozen=True)
class System:
    """A rectangular, cylindrical or spherical system.

    axes : (3, 3) rows x, y, z of its own; angles count from x towards y, the axis of a cylinder and the pole are z
    kind : "rectangular"; "cylindrical": radial, tangential, axial; "spherical": radial, tangential about the pole,
        along the meridian; "nastran spherical": radial, along the meridian away from the pole, tangential
    turn : (3, 3) rows that the local directions are turned to, seen in themselves"""

    kind: str
    origin: np.ndarray
    axes: np.ndarray
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))

    @classmethod
    def of_points(cls, kind: str, origin: Sequence[float], pole: Sequence[float], plane: Sequence[float]) -> System:
        """By a point on its z axis and one in its x z plane. Raises Refusal where these lie on one line."""
        at = np.array(origin, dtype=float)
        z, x, y = orthogonal(np.asarray(pole) - at, np.asarray(plane) - at)
        return cls(kind, at, np.stack([x, y, z]))

    def transformed(self, turn: np.ndarray, shift: np.ndarray) -> System:
        """The system carried along by x -> turn @ x + shift."""
        return replace(self, origin=turn @ self.origin + shift, axes=self.axes @ turn.T)

    def scaled(self, metre: float) -> System:
        """The same where lengths are counted in another unit."""
        return replace(self, origin=metre * self.origin)

    def places(self, coordinates: np.ndarray) -> np.ndarray:
        """Points (n, 3) of coordinates (n, 3): x, y, z; r, angle, z; or r and two angles, all in degrees.

        The angles of "spherical" are the longitude and the latitude, those of "nastran spherical" the angle from the
        pole and the longitude."""
        local = np.array(coordinates, dtype=float)
        if self.kind != "rectangular":
            r, a, b = local[:, 0], np.radians(local[:, 1]), np.radians(local[:, 2])
            if self.kind == "cylindrical":
                local = np.stack([r * np.cos(a), r * np.sin(a), local[:, 2]], axis=1)
            else:
                longitude, height = (a, b) if self.kind == "spherical" else (b, np.pi / 2 - a)
                flat = r * np.cos(height)
                local = np.stack([flat * np.cos(longitude), flat * np.sin(longitude), r * np.sin(height)], axis=1)
        return np.asarray(self.origin + local @ self.axes)

    def at(self, points: np.ndarray) -> np.ndarray:
        """(n, 3, 3) directions at points (n, 3), rows. Raises Refusal at a point on the axis or pole."""
        if self.kind == "rectangular":
            return np.broadcast_to(self.turn @ self.axes, (len(points), 3, 3))
        z = np.broadcast_to(self.axes[2], points.shape)
        arm = points - self.origin
        tangent = np.cross(z, arm)
        if not (np.linalg.norm(tangent, axis=1) > 1e-9 * np.linalg.norm(arm, axis=1)).all():
            raise Refusal("an element with directions of a material lies on its system's axis: mesh around it")
        tangent = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
        if self.kind == "cylindrical":
            rows = np.stack([np.cross(tangent, z), tangent, z], axis=1)
        else:
            radial = arm / np.linalg.norm(arm, axis=1, keepdims=True)
            rows = np.stack([radial, tangent, np.cross(radial, tangent)], axis=1)
            if self.kind == "nastran spherical":
                rows = np.stack([radial, -rows[:, 2], tangent], axis=1)
        return np.asarray(self.turn @ rows)


@dataclass(frozen=True)
class ElementAxes:
    """Directions that a file lists by element or node; the nearest centre counts, or the mean of equally near ones.

    centres : (n, 3); rows : (n, 3, 3)"""

    centres: np.ndarray
    rows: np.ndarray

    def at(self, points: np.ndarray) -> np.ndarray:
        """(n, 3, 3) directions at points (n, 3), rows."""
        distance, nearest = scipy.spatial.cKDTree(self.centres).query(points, k=range(1, min(4, len(self.centres)) + 1))
        equally_near = distance <= 1.000001 * distance[:, :1]
        mean = np.einsum("nk,nkij->nij", equally_near, self.rows[nearest])
        return np.where(
            (equally_near.sum(axis=1) > 1)[:, None, None], orthogonal(mean[:, 0], mean[:, 1]), self.rows[nearest[:, 0]]
        )

    def scaled(self, metre: float) -> ElementAxes:
        """The same where lengths are counted in another unit."""
        return ElementAxes(metre * self.centres, self.rows)


def axis_rotation(axis: int, degrees: float) -> np.ndarray:
    """(3, 3) rows of directions that are turned about one of them, 0..2, by the right hand."""
    return rotation(np.eye(3)[axis], np.radians(degrees)).T
