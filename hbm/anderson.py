"""Anderson mixing: a fixed point z = P(z) from the images of a slowly converging iteration."""

from __future__ import annotations

import numpy as np


class Anderson:
    """Proposes the next iterate from the last ones; on a linear map it is equivalent to GMRES.

    depth : how many differences are remembered
    Source  Anderson 1965; least-squares form of Walker and Ni 2011
    """

    def __init__(self, depth: int):
        self._depth = depth
        self.forget()

    def forget(self) -> None:
        """Start anew, as after a proposal that made things worse."""
        self._z: list[np.ndarray] = []
        self._r: list[np.ndarray] = []

    def propose(self, z: np.ndarray, image: np.ndarray) -> np.ndarray:
        """Next iterate from z and its image P(z), both (n,) in units whose Euclidean norm means something."""
        self._z = [*self._z[-self._depth :], z]
        self._r = [*self._r[-self._depth :], image - z]
        if len(self._z) == 1:
            return image
        dz = np.diff(np.array(self._z), axis=0)
        dr = np.diff(np.array(self._r), axis=0)
        size = np.linalg.norm(dr, axis=1)
        size[size == 0] = 1.0
        gamma = np.linalg.lstsq((dr / size[:, None]).T, self._r[-1], rcond=1e-10)[0] / size
        return image - gamma @ (dz + dr)
