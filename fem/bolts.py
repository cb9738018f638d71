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
from tribodyn.fem.mortar import MORTAR
from tribodyn.fem.springs import shares
from tribodyn.fem.surface import surface
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class Bolt:
    """name : for errors; head, nut : names of the faces; stiffness : k [N/m], 0 for a constant force.

    As a load it is 1 N in the shank, which is minus the row of its elongation e.
    """

    name: str
    head: str
    nut: str
    stiffness: float = 0.0

    def elongation(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> np.ndarray:
        """Row e (3 n_node,).

        Raises  Refusal for unknown faces, where the bolt crosses nothing, or pulls at a face instead of pressing
        """
        points = coordinates(mesh)
        row = np.zeros(points.shape)
        (head, share_1), (nut, share_2) = (shares(mesh, node_sets, name) for name in (self.head, self.nut))
        axis = self._axis(mesh, node_sets)
        length = float(np.linalg.norm(axis))
        if np.intersect1d(head, nut).size or length <= 1e-6 * float(np.linalg.norm(np.ptp(points, axis=0))):
            raise Refusal(
                f"bolts.{self.name} crosses nothing: '{self.head}' and '{self.nut}' lie at one place; give the faces "
                "under its head and under its nut"
            )
        for name, towards in ((self.head, axis), (self.nut, -axis)):
            if _outward(mesh, name) @ towards > MORTAR.facing * length:
                raise Refusal(
                    f"bolts.{self.name} would pull at '{name}' instead of pressing on it: give the faces under head "
                    "and nut, which look away from each other"
                )
        row[nut] += share_2[:, None] * axis / length
        row[head] -= share_1[:, None] * axis / length
        return row.ravel()

    def length(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> float:
        """Distance of the middles of its faces [m]."""
        return float(np.linalg.norm(self._axis(mesh, node_sets)))

    def _axis(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> np.ndarray:
        """From the middle of the face under the head to that under the nut (3,) [m]."""
        (head, share_1), (nut, share_2) = (shares(mesh, node_sets, name) for name in (self.head, self.nut))
        points = coordinates(mesh)
        return np.asarray(share_2 @ points[nut] - share_1 @ points[head])

    def vector(self, mesh: Any, node_sets: Mapping[str, np.ndarray], mass: Any = None) -> np.ndarray:
        """Force vector (3 n_node,) of 1 N in the shank."""
        return -self.elongation(mesh, node_sets)

    def matrix(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> csr_matrix:
        """Stiffness (3 n_node, 3 n_node) [N/m]."""
        row = csr_matrix(self.elongation(mesh, node_sets))
        return csr_matrix(self.stiffness * row.T @ row)


def _outward(mesh: Any, name: str) -> np.ndarray:
    """Mean outward normal (3,) of a face; zero of a node set that is none, small of a bore."""
    faces = mesh.boundaries or {}
    if name not in faces:
        return np.zeros(3)
    face = surface(mesh, faces[name])
    return np.asarray(face.area @ face.normals / face.area.sum())
