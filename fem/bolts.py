"""A bolt as an elastic rod between the faces under its head and under its nut.

The rod sees the mean displacements of the faces along its axis, e = a . (u_nut - u_head). Its force N = N_0 + k e pulls
the faces together; k is left out where the force is kept constant.
Source  VDI 2230 part 1, 2015, section 3.2: bolt and clamped parts as springs
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from tribodyn.fem.elements import coordinates
from tribodyn.fem.springs import shares


@dataclass(frozen=True)
class Bolt:
    """name : for errors; head, nut : names of the faces; stiffness : k [N/m], 0 for a constant force.

    As a load it is 1 N in the shank; as an output it is the elongation e [m/m].
    """

    name: str
    head: str
    nut: str
    stiffness: float = 0.0

    def elongation(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> np.ndarray:
        """Row e (3 n_node,); raises ValueError for unknown faces, or where the bolt crosses nothing."""
        points = coordinates(mesh)
        row = np.zeros(points.shape)
        (head, share_1), (nut, share_2) = (shares(mesh, node_sets, name) for name in (self.head, self.nut))
        axis = share_2 @ points[nut] - share_1 @ points[head]
        length = float(np.linalg.norm(axis))
        if np.intersect1d(head, nut).size or length <= 1e-6 * float(np.linalg.norm(np.ptp(points, axis=0))):
            raise ValueError(
                f"bolts.{self.name} crosses nothing: '{self.head}' and '{self.nut}' lie at one place; give the faces "
                "under its head and under its nut"
            )
        row[nut] += share_2[:, None] * axis / length
        row[head] -= share_1[:, None] * axis / length
        return row.ravel()

    def length(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> float:
        """Distance of the middles of its faces [m]."""
        points = coordinates(mesh)
        (head, share_1), (nut, share_2) = (shares(mesh, node_sets, name) for name in (self.head, self.nut))
        return float(np.linalg.norm(share_2 @ points[nut] - share_1 @ points[head]))

    def vector(self, mesh: Any, node_sets: Mapping[str, np.ndarray], mass: Any = None) -> np.ndarray:
        """Force vector (3 n_node,) of 1 N in the shank."""
        return -self.elongation(mesh, node_sets)

    def matrix(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> csr_matrix:
        """Stiffness (3 n_node, 3 n_node) [N/m]."""
        row = csr_matrix(self.elongation(mesh, node_sets))
        return csr_matrix(self.stiffness * row.T @ row)


@dataclass(frozen=True)
class Elongation:
    """The elongation of a bolt as an output."""

    bolt: Bolt

    def vector(self, mesh: Any, node_sets: Mapping[str, np.ndarray], mass: Any = None) -> np.ndarray:
        """Row e (3 n_node,)."""
        return self.bolt.elongation(mesh, node_sets)
