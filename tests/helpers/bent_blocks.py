"""Blocks of second-order elements, bent, and their steel."""

from collections.abc import Callable

import numpy as np
import skfem

from tribodyn.fem.material import Material

STEEL = Material(E=200e9, nu=0.3, rho=7800.0, expansion=12e-6)


def brick(*axes, tetrahedra=False, bent: Callable | None = None):
    """A block of second-order elements with its faces by name, bent by a function of its nodes (3, n) -> (3, n)."""
    kind, second = (skfem.MeshTet, skfem.MeshTet2) if tetrahedra else (skfem.MeshHex, skfem.MeshHex2)
    flat = second.from_mesh(kind.init_tensor(*axes))
    ends = [(np.min(a), np.max(a)) for a in axes]
    faces = {
        f"{name}_{side}": flat.facets_satisfying(lambda x, i=i, v=v: np.abs(x[i] - v) < 1e-9, boundaries_only=True)
        for i, name in enumerate("xyz") for side, v in zip(("min", "max"), ends[i], strict=True)
    }  # fmt: skip
    sets = {
        f"{name}_{side}": np.flatnonzero(np.abs(flat.doflocs[i] - v) < 1e-9)
        for i, name in enumerate("xyz") for side, v in zip(("min", "max"), ends[i], strict=True)
    }  # fmt: skip
    mesh = flat if bent is None else second(bent(flat.doflocs), flat.t)
    return mesh.with_boundaries(faces), sets
