"""A bolt as an elastic rod between the faces under its head and under its nut.

The rod sees the mean displacements of the faces along its axis, e = a . (u_nut - u_head). Its force
N = N_0 + k (e - alpha T L) pulls the faces together; k is left out where the force is kept constant.
Source  VDI 2230 part 1, 2015, section 3.2: bolt and clamped parts as springs; section 5.4.2: heat"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from tribodyn.fem.elements import coordinates
from tribodyn.fem.interface import unit
from tribodyn.fem.mortar import MORTAR
from tribodyn.fem.springs import shares
from tribodyn.fem.surface import surface
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class Seat:
    """The nodes of the face under a head or a nut, (n,) their shares of the force, (n, 3) their points [m]."""

    nodes: np.ndarray
    share: np.ndarray
    points: np.ndarray

    @classmethod
    def of(cls, mesh: Any, node_sets: Mapping[str, np.ndarray], name: str) -> Seat:
        """The seat on a face or a node set, pressed evenly."""
        nodes, share = shares(mesh, node_sets, name)
        return cls(nodes, share, coordinates(mesh)[nodes])

    @property
    def middle(self) -> np.ndarray:
        """(3,) where its force acts [m]."""
        return np.asarray(self.share @ self.points)

    def spread(self, across: np.ndarray) -> np.ndarray:
        """Second moments (3, 3) of its shares about the middle, of what a projection (3, 3) leaves [m2]."""
        arm = (self.points - self.middle) @ across
        return np.asarray(arm.T @ (self.share[:, None] * arm))

    def eccentric(self, offset: np.ndarray, across: np.ndarray) -> Seat | None:
        """The seat with a pressure that is linear over it, so that its force acts at `offset` (3,) from its middle.

        Returns None where the seat would have to be pulled somewhere"""
        slope = np.linalg.pinv(self.spread(across), rcond=MORTAR.rounding) @ offset
        eccentric = Seat(self.nodes, self.share * (1 + (self.points - self.middle) @ slope), self.points)
        is_there = np.allclose((eccentric.middle - self.middle) @ across, offset, atol=1e-9 * np.linalg.norm(offset))
        return eccentric if is_there and eccentric.share.min() >= 0 else None


@dataclass(frozen=True)
class Bolt:
    """name : for errors; head, nut : names of the faces; stiffness : k [N/m], 0 for a constant force
    expansion : of the shank [1/K], None where it is not known
    axis : (3,) of the shank, either sense; from the middle of one face to that of the other where None

    As a load it is 1 N in the shank, which is minus the row of its elongation e."""

    name: str
    head: str
    nut: str
    stiffness: float = 0.0
    expansion: float | None = None
    axis: tuple[float, float, float] | None = None

    def elongation(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> np.ndarray:
        """Row e (3 n_node,).

        Raises  Refusal for unknown faces, where the bolt crosses nothing, or pulls at a face instead of pressing"""
        points = coordinates(mesh)
        row = np.zeros(points.shape)
        head, nut, axis = self._shank(mesh, node_sets)
        length = float(np.linalg.norm(axis))
        if np.intersect1d(head.nodes, nut.nodes).size or length <= 1e-6 * np.linalg.norm(np.ptp(points, axis=0)):
            raise Refusal(
                f"bolts.{self.name} crosses nothing: '{self.head}' and '{self.nut}' lie at one place; give the faces "
                "under its head and under its nut"
            )
        for name, inward in ((self.head, axis), (self.nut, -axis)):
            if outward_normal(mesh, name) @ inward > MORTAR.facing * length:
                raise Refusal(
                    f"bolts.{self.name} would pull at '{name}' instead of pressing on it: give the faces under head "
                    "and nut, which look away from each other"
                )
        row[nut.nodes] += nut.share[:, None] * axis / length
        row[head.nodes] -= head.share[:, None] * axis / length
        return row.ravel()

    def length(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> float:
        """Distance of its faces along the shank [m]."""
        return float(np.linalg.norm(self._shank(mesh, node_sets)[2]))

    def lean(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> float:
        """Largest angle of the shank against the normals of its faces [rad]; of a node set or a bore there is none."""
        axis = unit(self._shank(mesh, node_sets)[2].tolist(), f"the shank of bolts.{self.name}")
        normals = [-outward_normal(mesh, self.head), outward_normal(mesh, self.nut)]
        cosines = [normal @ axis / size for normal in normals if (size := np.linalg.norm(normal)) > MORTAR.facing]
        return float(np.arccos(np.clip(min(cosines, default=1.0), -1.0, 1.0)))

    def thermal_force(self, mesh: Any, node_sets: Mapping[str, np.ndarray], temperature: np.ndarray) -> float:
        """-k alpha T L [N]: what heat adds to a shank of constant length, T the mean of its two faces.

        temperature : (n_node,) change at the nodes [K]
        Raises  Refusal where the shank is heated and its expansion is not known"""
        head, nut, axis = self._shank(mesh, node_sets)
        change = float(head.share @ temperature[head.nodes] + nut.share @ temperature[nut.nodes]) / 2
        if not self.stiffness or not change:
            return 0.0
        if self.expansion is None:
            raise Refusal(f"bolts.{self.name} is heated, and its stiffness does not say how it expands: give material")
        return -self.stiffness * self.expansion * change * float(np.linalg.norm(axis))

    def _shank(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> tuple[Seat, Seat, np.ndarray]:
        """Seats of head and nut, and the shank (3,) from the one to the other [m].

        A given axis goes through the middle of the smaller face; the other one is pressed unevenly, so that the two
        forces are in line and make no moment."""
        head, nut = (Seat.of(mesh, node_sets, name) for name in (self.head, self.nut))
        between = nut.middle - head.middle
        if self.axis is None:
            return head, nut, between
        across = np.eye(3) - np.outer(self.axis, self.axis)
        offset = across @ between
        is_head_larger = np.trace(head.spread(across)) > np.trace(nut.spread(across))
        eccentric = head.eccentric(offset, across) if is_head_larger else nut.eccentric(-offset, across)
        if eccentric is None:
            raise Refusal(
                f"bolts.{self.name}.axis: through the smaller of its faces it meets the other one "
                f"{1e3 * np.linalg.norm(offset):.3g} mm off the middle, and would pull at this face "
                "somewhere: give as a face what lies under the head alone"
            )
        return (eccentric, nut, between - offset) if is_head_larger else (head, eccentric, between - offset)

    def vector(self, mesh: Any, node_sets: Mapping[str, np.ndarray], mass: Any = None) -> np.ndarray:
        """Force vector (3 n_node,) of 1 N in the shank."""
        return -self.elongation(mesh, node_sets)

    def matrix(self, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> csr_matrix:
        """Stiffness (3 n_node, 3 n_node) [N/m]."""
        row = csr_matrix(self.elongation(mesh, node_sets))
        return csr_matrix(self.stiffness * row.T @ row)


def outward_normal(mesh: Any, name: str) -> np.ndarray:
    """Mean outward normal (3,) of a face; zero of a node set that is none, small of a bore."""
    faces = mesh.boundaries or {}
    if name not in faces:
        return np.zeros(3)
    face = surface(mesh, faces[name])
    return np.asarray(face.area @ face.normals / face.area.sum())
