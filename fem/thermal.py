"""Forces of a temperature that strains a body.

The strain of a change of temperature T is alpha T; its stress, held back, C : alpha T, acts as the forces
f_ai = integral of C_ijkl alpha_kl T dN_a/dx_j. The displacements they make are the true ones.
Source  Cook, Malkus, Plesha and Witt, Concepts and Applications of Finite Element Analysis, 2002, section 3.9
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from tribodyn.fem.assembly import Assembly, materials_of
from tribodyn.fem.elasticity import element_tensors, strain_points
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class Heating:
    """A change of temperature of 1 K, or of a field of values at the nodes, in some bodies.

    material : as for fem.elasticity.assemble; bodies : names, all where empty; values : (n_node,) [K], None for 1 K
    """

    material: Any
    bodies: Sequence[str] = ()
    values: np.ndarray | None = None

    def vector(self, mesh: Any, node_sets: Mapping[str, np.ndarray], mass: Any = None) -> np.ndarray:
        """Force vector (3 n_node,) [N/K].

        Raises  Refusal for a body that is not there, or where nothing expands
        """
        names = [body.name for body in mesh.bodies] if isinstance(mesh, Assembly) else [""]
        for name in self.bodies:
            if name not in names:
                raise Refusal(f"temperature: there is no body '{name}'; there are {', '.join(names)}")
        n_node = mesh.doflocs.shape[1]
        values = np.ones(n_node) if self.values is None else self.values
        force = np.zeros((n_node, 3))
        for name, (piece, material) in zip(names, materials_of(mesh, self.material), strict=True):
            if self.bodies and name not in self.bodies:
                continue
            C, expansion = (
                element_tensors(piece.mesh, material, tensor_name) for tensor_name in ("tensor", "expansion_tensor")
            )
            held_back = np.einsum("eijkl,ekl->eij", C, expansion)
            for elements, nodes, N, gradient, weight in strain_points(piece.mesh, material):
                temperature = values[nodes + piece.node] @ N.T
                element_force = np.einsum(
                    "eq,eij,eqja->eai", weight * temperature, held_back[elements], gradient, optimize=True
                )
                np.add.at(force, nodes + piece.node, element_force)
        if not force.any():
            raise Refusal("temperature: no body that is heated expands; give its material an expansion")
        return force.ravel()


def temperature_at(path: Path, points: np.ndarray) -> np.ndarray:
    """Values (n,) at points (n, 3) [m] from a table with columns x, y, z [m] and value, linear between its rows; beyond
    them that of the nearest row.

    Raises  Refusal for a file that is no such table
    """
    try:
        table = np.loadtxt(path, delimiter=",", comments="#", skiprows=_header(path), ndmin=2)
    except (OSError, ValueError) as trouble:
        raise Refusal(f"the field '{path}' cannot be read ({trouble}): give lines x, y, z, value") from None
    if table.shape[1] != 4 or not np.isfinite(table).all():
        raise Refusal(f"the field '{path}' has {table.shape[1]} columns: give x, y, z and the value, all finite")
    nearest = scipy.interpolate.NearestNDInterpolator(table[:, :3], table[:, 3])(points)
    if len(table) < 5 or np.linalg.matrix_rank(table[:, :3] - table[0, :3]) < 3:
        return np.asarray(nearest)
    inside = scipy.interpolate.LinearNDInterpolator(table[:, :3], table[:, 3])(points)
    return np.where(np.isnan(inside), nearest, inside)


def _header(path: Path) -> int:
    """Lines before the first that is numbers: 1 for a line of names, else 0."""
    with path.open(encoding="utf-8") as file:
        first = file.readline().split(",")
    try:
        [float(word) for word in first]
    except ValueError:
        return 1
    return 0
