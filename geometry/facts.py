"""Plain facts of a mesh: extent, volume, centre, areas of its faces, its worst element."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from skfem import FacetBasis, Functional
from skfem.quadrature import get_quadrature

from tribodyn.geometry.mesh import quality


@dataclass(frozen=True)
class Facts:
    """low, high : (3,) corners of the box around it [m]; volume [m3]; mass [kg], None without a density
    centre : (3,) of its mass, or of its volume without a density [m]
    scaled_jacobian, worst_centre : of the worst element, see geometry.mesh.quality; (3,) [m]
    """

    low: np.ndarray
    high: np.ndarray
    volume: float
    centre: np.ndarray
    scaled_jacobian: float
    worst_centre: np.ndarray
    mass: float | None = None


def facts(mesh: Any, density: np.ndarray | None = None) -> Facts:
    """Measure a mesh. mesh : skfem MeshHex2 or MeshTet2; density : (n_element,) [kg/m3]

    Raises  ValueError: an element is inverted or degenerate
    """
    found = quality(mesh)
    X, w = get_quadrature(mesh.elem.refdom, 5)
    mapping = mesh.mapping()
    weight = np.abs(mapping.detDF(X)) * w
    x = mapping.F(X)
    volume = float(weight.sum())
    worst = mesh.p[:, mesh.t[:, found.worst_element]].mean(axis=1)
    heavy = weight if density is None else weight * density[:, None]
    total = float(heavy.sum())
    centre = np.einsum("ieq,eq->i", x, heavy) / total
    mass = None if density is None else total
    points = mesh.doflocs
    return Facts(points.min(axis=1), points.max(axis=1), volume, centre, found.scaled_jacobian, worst, mass)


def area(mesh: Any, facets: np.ndarray) -> float:
    """Area of some facets [m2]."""
    if not len(facets):
        return 0.0
    basis = FacetBasis(mesh, mesh.elem(), facets=facets, intorder=4)
    return float(Functional(lambda w: 1.0 + 0.0 * w.x[0]).assemble(basis))
