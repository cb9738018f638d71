"""Which rotation brings one face of a sector onto the other, and which key of a wheel says otherwise.

Both faces have the same shape: their principal axes are turned into each other. The axis, the angle and the offset that
remains follow from the rotation, wherever the wheel was said to turn."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations, product
from typing import Any

import numpy as np
import scipy

from tribodyn.fem.bolts import Seat, outward_normal
from tribodyn.fem.interface import unit
from tribodyn.fem.mortar import MORTAR
from tribodyn.geometry.placement import rotation

ALIGNED = 1e-3  # of directions, of the number of sectors, and over the length of a face that its like lies off it


@dataclass(frozen=True)
class SectorFit:
    """The rotation of one face of a sector onto the other, by the right hand about `axis`.

    axis : (3,), towards the axis of the wheel as it was said
    sectors : 2 pi over its angle, negative against the right hand
    offset : (3,) from the first face, turned about the origin, to the second one [m]; length : of the face [m]"""

    axis: np.ndarray
    sectors: float
    offset: np.ndarray
    length: float

    @property
    def centre(self) -> np.ndarray:
        """(3,) point of its axis that is nearest to the origin [m]."""
        turn = rotation(self.axis, 2 * np.pi / self.sectors)
        return np.asarray(np.linalg.lstsq(np.eye(3) - turn, self.offset, rcond=1e-9)[0])

    def faults(self, n_sectors: int, axis: np.ndarray) -> list[str]:
        """What is wrong with a wheel of so many sectors about an axis (3,), each with the cure."""
        faults, count = [], round(abs(self.sectors))
        if np.linalg.norm(np.cross(self.axis, axis)) > ALIGNED:
            main = int(np.abs(self.axis).argmax())
            name = f"{'-' if self.axis[main] < 0 else ''}{'xyz'[main]}"
            is_named = abs(self.axis[main]) > 1 - ALIGNED**2
            value = f'"{name}"' if is_named else str((self.axis.round(6) + 0.0).tolist())
            faults.append(f"give wheel.axis = {value}")
        elif self.sectors < 0 and count > 2:
            faults.append("swap the two faces, or let wheel.axis point the other way")
        if abs(abs(self.sectors) / count - 1) > ALIGNED:
            faults.append(f"give a part of a whole number of sectors, not of {abs(self.sectors):.4g}")
        elif count != n_sectors:
            faults.append(f"give wheel.sectors = {count}")
        if not faults and np.linalg.norm(self.offset) > MORTAR.reach * self.length:
            x, y, z = np.where(np.abs(self.centre) < ALIGNED * self.length, 0.0, self.centre)
            faults.append(
                f"its axis goes through ({x:.4g}, {y:.4g}, {z:.4g}) m: move it there to the origin, or correct a unit"
            )
        return faults


def describe_fault(
    mesh: Any, node_sets: Mapping[str, np.ndarray], faces: tuple[str, str], n_sectors: int, axis: Sequence[float]
) -> str:
    """Why the right face does not come to the left one in a wheel, with the cure; empty where it does, or the faces are
    not of one shape.

    faces : names of the right and the left one; n_sectors, axis (3,) : of the wheel as they were said"""
    stated_axis = unit(axis, "the axis of rotation")
    fits = [fit.faults(n_sectors, stated_axis) for fit in _fits(mesh, node_sets, faces, stated_axis)]
    best = min(fits, key=len, default=[])
    if not best:
        return ""
    return f"one turn by 2 pi / {n_sectors} does not bring '{faces[0]}' to '{faces[1]}': {', and '.join(best)}"


def _fits(
    mesh: Any, node_sets: Mapping[str, np.ndarray], faces: tuple[str, str], stated_axis: np.ndarray
) -> Iterator[SectorFit]:
    """All rotations that bring a face to the other one, of which there are several where it is symmetric."""
    right, left = (Seat.of(mesh, node_sets, name) for name in faces)
    length = float(np.linalg.norm(np.ptp(right.points, axis=0)))
    axes_right, axes_left = (np.linalg.eigh(seat.spread(np.eye(3)))[1] for seat in (right, left))
    normal_right, normal_left = (outward_normal(mesh, name) for name in faces)
    tree = scipy.spatial.cKDTree(left.points - left.middle)
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = axes_left @ (np.diag(signs)[:, list(order)] @ axes_right.T)
        if np.linalg.det(turn) < 0 or (turn @ normal_right) @ normal_left > 0:
            continue
        if tree.query((right.points - right.middle) @ turn.T)[0].max() > ALIGNED * length:
            continue
        vector = scipy.spatial.transform.Rotation.from_matrix(turn).as_rotvec()
        angle = float(np.linalg.norm(vector))
        if angle < ALIGNED:
            continue
        direction = vector / angle if vector @ stated_axis >= -ALIGNED * angle else -vector / angle
        sign = np.sign(vector @ direction)
        offset = left.middle - turn @ right.middle
        yield SectorFit(direction, sign * 2 * np.pi / angle, offset, length)
