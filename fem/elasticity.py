"""Mass and stiffness of linear elasticity from batches of element matrices.

K_(ai)(bj) = integral of lambda g_ai g_bj + mu g_aj g_bi + mu delta_ij g_ak g_bk with g_ai = dN_a/dx_i: all three terms
come from one product G = g^T g, which is what makes the batch fast.
Source  Hughes, The Finite Element Method, 2000, section 2.8
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, identity, kron

from tribodyn.fem.elements import batches, connectivity, scatter
from tribodyn.fem.material import Material


def assemble(
    mesh: Any, material: Material | Mapping[str, Material], order: int | None = None
) -> tuple[csr_matrix, csr_matrix]:
    """Mass and stiffness over all nodes, DOF = node * 3 + component.

    mesh : scikit-fem MeshHex2 or MeshTet2
    material : one for the whole mesh, or subdomain name -> material
    order : quadrature order, 5 unless told
    Returns M [kg], K [N/m], each (3 n_node, 3 n_node), symmetric to the last bit
    """
    nodes = connectivity(mesh)
    lam, mu, rho = per_element(mesh, material)
    n_element, n_a = nodes.shape
    mass = np.empty((n_element, n_a, n_a, 1, 1))
    stiffness = np.empty((n_element, n_a, n_a, 3, 3))
    for elements, N, gradient, weight in batches(mesh, order):
        mass[elements] = symmetric(mass_blocks(N, weight * rho[elements, None]))
        stiffness[elements] = symmetric(stiffness_blocks(gradient, weight, lam[elements], mu[elements]))
    n_node = mesh.doflocs.shape[1]
    return kron(scatter(nodes, n_node, mass), identity(3), format="csr"), scatter(nodes, n_node, stiffness)


def mass_blocks(N: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Element mass (n_e, n_a, n_a, 1, 1) [kg] of shape functions N (n_q, n_a) and weight rho |J| w (n_e, n_q)."""
    pairs = (N[:, :, None] * N[:, None, :]).reshape(len(N), -1)
    n_a = N.shape[1]
    return (weight @ pairs).reshape(-1, n_a, n_a, 1, 1)


def stiffness_blocks(gradient: np.ndarray, weight: np.ndarray, lam: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """Element stiffness (n_e, n_a, n_a, 3, 3) [N/m].

    gradient : (n_e, n_q, 3, n_a) [1/m]; weight : (n_e, n_q) [m3]; lam, mu : (n_e,) [Pa]
    """
    n_e, n_q, _, n_a = gradient.shape
    g = gradient.reshape(n_e, n_q, 3 * n_a)  # column i * n_a + a
    G = g.transpose(0, 2, 1) @ (weight[:, :, None] * g)
    G = G.reshape(n_e, 3, n_a, 3, n_a).transpose(0, 2, 4, 1, 3)  # e, a, b, i, j
    lam, mu = lam[:, None, None, None, None], mu[:, None, None, None, None]
    trace = np.trace(G, axis1=3, axis2=4)[..., None, None]
    return lam * G + mu * (G.swapaxes(3, 4) + trace * np.eye(3))


def symmetric(blocks: np.ndarray) -> np.ndarray:
    """Element matrices (n_e, n_a, n_a, k, k) without the rounding that breaks their symmetry."""
    return (blocks + blocks.transpose(0, 2, 1, 4, 3)) / 2


def per_element(
    mesh: Any, material: Material | Mapping[str, Material]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lame's constants [Pa] and density [kg/m3] of each element, three arrays (n_element,).

    Raises  ValueError for a subdomain the mesh lacks, or an element with no or two materials
    """
    n_element = mesh.t.shape[1]
    if isinstance(material, Material):
        material, members = {"": material}, {"": np.arange(n_element)}
    else:
        members = mesh.subdomains or {}
    count = np.zeros(n_element, dtype=int)
    values = np.empty((3, n_element))
    for name, one in material.items():
        if name not in members:
            raise ValueError(f"material: the mesh has no subdomain '{name}'; it has {sorted(members) or 'none'}")
        count[members[name]] += 1
        values[:, members[name]] = np.array([*one.lame, one.rho])[:, None]
    if (count != 1).any():
        raise ValueError(
            f"material: {np.sum(count == 0)} elements have no material and {np.sum(count > 1)} have more than one; "
            f"name each of the subdomains {sorted(members)} once"
        )
    return values[0], values[1], values[2]
