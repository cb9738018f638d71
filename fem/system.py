"""Second-order systems M q'' + C q' + K q = f: the one type that the full and the reduced model share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.sparse import issparse


@dataclass(frozen=True)
class SecondOrderSystem:
    """A linear structure M q'' + (C + G) q' + K q = f in n coordinates, with the vectors that load and observe it.

    mass, stiffness : (n, n) symmetric (Hermitian for one harmonic index of a cyclic part), sparse or dense [kg], [N/m]
    damping : (n, n) like stiffness, or None for none [N s/m]
    loads : name -> (n,) force per unit of the named load [N/N]
    outputs : name -> (n,) row that observes a displacement, output = row . q [m/m]
    gyroscopic : (n, n) antisymmetric (anti-Hermitian), the Coriolis matrix G of a turning frame, or None [N s/m]
    circulatory : (n, n) antisymmetric (anti-Hermitian) forces of a flow, by displacement, beside the stiffness, or
        None [N/m]"""

    mass: Any
    stiffness: Any
    damping: Any = None
    loads: Mapping[str, np.ndarray] = field(default_factory=dict)
    outputs: Mapping[str, np.ndarray] = field(default_factory=dict)
    gyroscopic: Any = None
    circulatory: Any = None

    @property
    def n_dof(self) -> int:
        """Number of coordinates n."""
        return int(self.stiffness.shape[0])

    @property
    def velocity_matrix(self) -> Any:
        """C + G (n, n), what multiplies the velocity [N s/m]; None for neither."""
        if self.gyroscopic is None or self.damping is None:
            return self.damping if self.gyroscopic is None else self.gyroscopic
        return self.damping + self.gyroscopic

    def projected(self, T: Any) -> SecondOrderSystem:
        """The system in coordinates z with q = T z; T (n, n_z) dense or sparse, real or complex."""

        def congruent(matrix: Any, sign: float = 1.0) -> Any:
            if matrix is None:
                return None
            small = T.conj().T @ (matrix @ T)
            return (small + sign * small.conj().T) / 2

        return SecondOrderSystem(
            congruent(self.mass),
            congruent(self.stiffness),
            congruent(self.damping),
            {name: T.conj().T @ load for name, load in self.loads.items()},
            {name: T.T @ row for name, row in self.outputs.items()},
            congruent(self.gyroscopic, -1.0),
            congruent(self.circulatory, -1.0),
        )


def dense(matrix: Any) -> np.ndarray:
    """A sparse or dense matrix as an array."""
    return np.asarray(matrix.toarray() if issparse(matrix) else matrix)
