"""The contact interface: which displacements meet, in which frame, with which area."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

COMPONENTS = ("t1", "t2", "n")


@dataclass(frozen=True)
class ContactInterface:
    """Node pairs (or nodes against the ground) whose relative displacement is x = B q.

    components : the components a scene needs, a subset of ("t1", "t2", "n") in this order
    points : (n_pair, 3) position of the body-1 node [m]
    frames : (n_pair, 3, 3) rows t1, t2, n; n points from body 1 into body 2, so closing is positive
    area : (n_pair,) tributary area [m2], sums to the area of the patch
    gap : (n_pair,) opening before loading [m], negative is interference
    B : (n_pair * n_component, n_dof) row pair * n_component + component, sparse (full model) or dense (reduced)
    faces : (n_face, k) corner-ordered polygons over the pairs, for area and pictures (may be empty)
    """

    components: tuple[str, ...]
    points: np.ndarray
    frames: np.ndarray
    area: np.ndarray
    gap: np.ndarray
    B: Any
    faces: np.ndarray

    @property
    def n_pair(self) -> int:
        """Number of node pairs."""
        return len(self.area)

    def stiffness(self, tangential: float, normal: float) -> np.ndarray:
        """Share the stiffness of the whole patch by tributary area.

        tangential, normal : stiffness of the whole patch [N/m]
        Returns (n_pair, n_component) [N/m], each column summing to the patch value
        Source  Tamatam 2021, section 3.3: distribution by elemental area contribution
        """
        total = {"t1": tangential, "t2": tangential, "n": normal}
        return np.outer(self.area / self.area.sum(), [total[c] for c in self.components])
