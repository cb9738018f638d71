"""Stiffness of a stressed and spinning part: stress stiffening and spin softening about a static equilibrium.

Statics give the stress once; the vibration about it is linear. The static displacement is not added to the geometry.
In the turning frame a velocity v meets the Coriolis force -2 speed axis x v.
Source  Cook, Malkus, Plesha and Witt, Concepts and Applications of Finite Element Analysis, 2002, chapter 18
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import block_diag, csr_matrix, identity, kron

from tribodyn.fem.assembly import materials_of
from tribodyn.fem.elasticity import of_elements, symmetric
from tribodyn.fem.elements import batches, connectivity, scatter
from tribodyn.fem.factor import SingularStiffness, factorise
from tribodyn.fem.interface import unit
from tribodyn.fem.material import Material
from tribodyn.fem.modes import StaticDivergence
from tribodyn.fem.part import Part
from tribodyn.geometry.placing import cross

UNSTABLE = (
    "under its static load or speed the part is unstable at rest: its stress and spin softening outweigh its "
    "stiffness; lower the load or the speed"
)


def prestressed(
    part: Part,
    material: Material | Mapping[str, Material],
    force: np.ndarray,
    softening: Any = 0,
    tie: csr_matrix | None = None,
) -> Part:
    """The part vibrating about its static equilibrium under a force.

    material : the one it was built with; force : (n_free,) static force [N], such as speed^2 times a centrifugal load
    softening : `spin_softening` at that speed over the free DOFs [N/m], 0 where it does not spin
    tie : (n_free, m) what q = tie z the equilibrium is looked for in, such as fem.cyclic.seam_map of index 0
    Returns the part with stiffness K + softening + geometric stiffness of the stress under the force
    Raises  ValueError where the part can move rigidly, StaticDivergence where it is beyond buckling or divergence
    """
    K = part.system.stiffness + softening
    T = identity(K.shape[0], format="csr") if tie is None else tie
    u = part.field(T @ factorise(csr_matrix(T.T @ K @ T), definite=False).solve(T.T @ force))
    stressed = csr_matrix(K + part.restricted(geometric_stiffness(part.mesh, material, u)))
    check_stability(csr_matrix(T.T @ stressed @ T))
    return replace(part, system=replace(part.system, stiffness=stressed))


def check_stability(stiffness: csr_matrix) -> None:
    """Raise StaticDivergence where a stressed stiffness (n, n) [N/m] is not positive definite."""
    try:
        factorise(stiffness)
    except SingularStiffness:
        raise StaticDivergence(UNSTABLE) from None


def geometric_stiffness(mesh: Any, material: Any, u: np.ndarray, temperature: np.ndarray | None = None) -> csr_matrix:
    """K_(ai)(bj) = delta_ij integral of g_a . sigma . g_b over all DOFs (3 n_node, 3 n_node) [N/m].

    mesh, material : as for fem.elasticity.assemble
    u : (n_node, 3) static displacement [m] whose stress sigma stiffens (tension) or softens (compression)
    temperature : (n_node,) change of temperature [K] whose free expansion carries no stress
    """
    blocks = []
    for piece, one in materials_of(mesh, material):
        own = slice(piece.node, piece.node + piece.mesh.doflocs.shape[1])
        heat = None if temperature is None else temperature[own]
        blocks.append(_geometric_stiffness(piece.mesh, one, u[own], heat))
    n_beyond = mesh.doflocs.shape[1] - sum(block.shape[0] for block in blocks)
    whole = block_diag([*blocks, csr_matrix((n_beyond, n_beyond))], format="csr")
    return kron(whole, identity(3), format="csr")


def _geometric_stiffness(mesh: Any, material: Any, u: np.ndarray, temperature: np.ndarray | None) -> csr_matrix:
    """The same of one mesh, without the factor of three components: (n_node, n_node)."""
    nodes = connectivity(mesh)
    kinds, kind = of_elements(mesh, material)
    C = np.array([one.tensor for one in kinds])
    expansion = np.array([one.expansion_tensor for one in kinds])
    blocks = np.empty((*nodes.shape, nodes.shape[1], 1, 1))
    for elements, N, gradient, weight in batches(mesh):
        strain = gradient @ u[nodes[elements]][:, None]  # d u_j / d x_i; the tensor takes its symmetric part
        if temperature is not None:
            strain = strain - (temperature[nodes[elements]] @ N.T)[..., None, None] * expansion[kind[elements], None]
        stress = np.einsum("eijkl,eqkl->eqij", C[kind[elements]], strain, optimize=True)
        weighted = weight[..., None, None] * (stress @ gradient)
        blocks[elements] = symmetric(np.einsum("eqia,eqib->eab", gradient, weighted, optimize=True)[..., None, None])
    return scatter(nodes, mesh.doflocs.shape[1], blocks)


def spin_softening(mass: Any, axis: Sequence[float], speed: float) -> csr_matrix:
    """-speed^2 M P, P taking the part normal to the axis: the centrifugal force grows with the displacement.

    mass : (3 n_node, 3 n_node) of whole nodes [kg]; axis : (3,); speed : [rad/s]
    Returns (3 n_node, 3 n_node) [N/m]
    """
    direction = unit(axis, "the axis of rotation")
    normal = np.eye(3) - np.outer(direction, direction)
    return csr_matrix(-(speed**2) * mass @ kron(identity(mass.shape[0] // 3), normal))


def coriolis(mass: Any, axis: Sequence[float], speed: float) -> csr_matrix:
    """G = 2 speed M [axis x]: what multiplies the velocity in the turning frame, antisymmetric.

    mass : (3 n_node, 3 n_node) of whole nodes [kg]; axis : (3,); speed : [rad/s]
    Returns (3 n_node, 3 n_node) [N s/m]
    Source  Geradin and Rixen, Mechanical Vibrations, 2015, section 2.9
    """
    a = unit(axis, "the axis of rotation")
    return csr_matrix(2 * speed * mass @ kron(identity(mass.shape[0] // 3), cross(a)))
