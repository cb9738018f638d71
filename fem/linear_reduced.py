"""Linear hexahedra with reduced integration: those of a first-order mesh, or eight on the nodes of each 27-node one.

The gradient is the mean over the element, hourglass modes have a stiffness of HOURGLASS times the shear modulus, and
the mass is lumped: what explicit programs and many published models have. They are softer than the 27-node element.
Source  Flanagan and Belytschko, IJNME 17 (1981) 679
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from tribodyn.fem.elements import connectivity, coordinates

HOURGLASS = 0.005  # of the shear modulus
SIGNS = np.array(list(product((-1, 1), repeat=3)), float)
MODES = np.array([SIGNS[:, 1] * SIGNS[:, 2], SIGNS[:, 0] * SIGNS[:, 2], SIGNS[:, 0] * SIGNS[:, 1], SIGNS.prod(axis=1)])


def elements(mesh: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Nodes (n, 8), mean gradient (n, 3, 8) [1/m] and volume (n,) [m3] of the linear elements of a mesh; n goes through
    all 27-node ones eight times, through 8-node ones once.

    The fourth, (n, 8, 8) [m], times the shear modulus and a unit matrix (3, 3), holds hourglass modes
    Raises  ValueError for a mesh of other elements
    """
    nodes = connectivity(mesh)
    if nodes.shape[1] == 10:
        raise ValueError('material: elements = "linear_reduced" needs hexahedra, and the mesh has tetrahedra')
    reference = np.asarray(mesh.elem().doflocs).reshape(-1, 3)
    side = 2 if nodes.shape[1] == 27 else 1  # linear elements along an edge of one of the mesh
    corners = [(np.array(at) + (1 + SIGNS) / 2) / side for at in product(range(side), repeat=3)]
    own = [[int(np.abs(reference - corner).max(axis=1).argmin()) for corner in eight] for eight in corners]
    cells = np.concatenate([nodes[:, eight] for eight in own])
    x = coordinates(mesh)[cells]
    weighted, volume = np.zeros((len(x), 3, 8)), np.zeros(len(x))
    for corner in SIGNS:
        dN = _slopes(corner / np.sqrt(3))
        J = dN @ x
        det = np.abs(np.linalg.det(J))
        weighted += det[:, None, None] * np.linalg.solve(J, np.broadcast_to(dN, weighted.shape))
        volume += det
    mean = weighted / volume[:, None, None]
    shape = (MODES[None] - np.einsum("hI,eIi,eiJ->ehJ", MODES, x, mean)) / 8
    against = 8 * HOURGLASS * volume * (mean**2).sum(axis=(1, 2))
    return cells, mean, volume, np.einsum("e,ehI,ehJ->eIJ", against, shape, shape)


def _slopes(at: np.ndarray) -> np.ndarray:
    """(3, 8) derivatives of the trilinear functions at a point of [-1, 1]^3."""
    v = 1 + SIGNS * at
    return np.array([SIGNS[:, i] * v[:, (i + 1) % 3] * v[:, (i + 2) % 3] for i in range(3)]) / 8
