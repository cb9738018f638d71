"""Which DOFs are free, clamped or prescribed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

AXES = "xyz"


def named(groups: Mapping[str, np.ndarray], name: str, kind: str = "node set") -> np.ndarray:
    """The group of that name.

    Raises  ValueError that lists the names which exist, or says that the group is empty
    """
    if name not in groups:
        raise ValueError(f"the mesh has no {kind} '{name}'; it has {', '.join(sorted(groups)) or 'none'}")
    if len(groups[name]) == 0:
        raise ValueError(f"the {kind} '{name}' is empty; check the geometry that defines it")
    return np.asarray(groups[name])


@dataclass(frozen=True)
class Clamp:
    """Hold a node set. nodes : its name; axes : which of "xyz" are held."""

    nodes: str
    axes: str = AXES

    def __post_init__(self) -> None:
        if not self.axes or set(self.axes) - set(AXES):
            raise ValueError(f"clamp '{self.nodes}': axes = '{self.axes}' must be some of the letters x, y, z")

    def dofs(self, node_sets: Mapping[str, np.ndarray]) -> np.ndarray:
        """DOFs that are held."""
        nodes = named(node_sets, self.nodes)
        return (nodes[:, None] * 3 + [AXES.index(a) for a in self.axes]).ravel()


@dataclass(frozen=True)
class NoMeanRotation:
    """Hold the mean rotation about an axis through the centre of mass: c q = 0, c = (M psi)^T, psi the rotation.

    Every elastic mode of a free part is orthogonal to psi in this sense and stays as it is; only the rotation is lost.
    axis : (3,)
    """

    axis: Sequence[float]

    def row(self, points: np.ndarray, mass: Any) -> np.ndarray:
        """c (3 n_node,) [kg], for nodes at points (n_node, 3) and the mass over all DOFs.

        Raises  ValueError for an axis that is none
        """
        axis = np.asarray(self.axis, dtype=float)
        if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
            raise ValueError(f"the axis {list(np.ravel(axis))} of a held rotation must be three numbers, not all zero")
        share = np.asarray(mass @ np.tile([1.0, 0.0, 0.0], len(points)))[::3]
        arm = points - share @ points / share.sum()
        return np.asarray(mass @ np.cross(axis / np.linalg.norm(axis), arm).ravel())


def free_dofs(n_dof: int, clamps: Iterable[Clamp], node_sets: Mapping[str, np.ndarray]) -> np.ndarray:
    """Sorted DOFs (n_free,) that no clamp holds.

    Raises  ValueError where everything is held
    """
    free = np.ones(n_dof, dtype=bool)
    for clamp in clamps:
        free[clamp.dofs(node_sets)] = False
    if not free.any():
        raise ValueError("the clamps hold every DOF of the part; leave some node free")
    return np.flatnonzero(free)


def partition(n_dof: int, chosen: np.ndarray, what: str) -> tuple[np.ndarray, np.ndarray]:
    """Split the DOFs of a system into (others, chosen), both sorted: prescribed from free ones, masters from slaves.

    Raises  ValueError, naming what was chosen, where one lies outside the system
    """
    chosen = np.unique(np.asarray(chosen, dtype=int))
    if len(chosen) and not 0 <= chosen[0] <= chosen[-1] < n_dof:
        raise ValueError(f"a {what} lies outside the {n_dof} DOFs of the system; clamped DOFs are no part of it")
    return np.setdiff1d(np.arange(n_dof), chosen), chosen
