"""Stiffness of a stressed and spinning part: stress stiffening and spin softening about a static equilibrium.

Linear statics give the stress once; the vibration about it is linear. Coriolis forces are left out, as is usual for
blades, and the static displacement is not added to the geometry.
Source  Cook, Malkus, Plesha and Witt, Concepts and Applications of Finite Element Analysis, 2002, chapter 18
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, identity, kron

from tribodyn.fem.elasticity import assemble, per_element, symmetric
from tribodyn.fem.elements import batches, connectivity, scatter
from tribodyn.fem.factor import SingularStiffness, factorise
from tribodyn.fem.loads import Centrifugal, unit
from tribodyn.fem.material import Material
from tribodyn.fem.modes import StaticDivergence
from tribodyn.fem.part import Part


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
    try:
        factorise(csr_matrix(T.T @ stressed @ T))
    except SingularStiffness:
        raise StaticDivergence(
            "under its static load or speed the part is unstable at rest: its stress and spin softening outweigh its "
            "stiffness; lower the load or the speed"
        ) from None
    return replace(part, system=replace(part.system, stiffness=stressed))


def spinning(
    part: Part,
    material: Material | Mapping[str, Material],
    axis: Sequence[float],
    speed: float,
    tie: csr_matrix | None = None,
) -> Part:
    """The part vibrating about its equilibrium under its own centrifugal force.

    axis : (3,) of rotation, through the origin; speed : [rad/s]; others as `prestressed`. Its contacts are open: what
    they carry when the blades untwist does not stiffen
    """
    mass, _ = assemble(part.mesh, material)
    force = speed**2 * part.force(Centrifugal(axis).vector(part.mesh, part.node_sets, mass))
    softening = part.restricted(spin_softening(mass, axis, speed))
    return prestressed(part, material, force, softening, tie)


def geometric_stiffness(mesh: Any, material: Material | Mapping[str, Material], u: np.ndarray) -> csr_matrix:
    """K_(ai)(bj) = delta_ij integral of g_a . sigma . g_b over all DOFs (3 n_node, 3 n_node) [N/m].

    u : (n_node, 3) static displacement [m] whose stress sigma stiffens (tension) or softens (compression)
    """
    nodes = connectivity(mesh)
    lam, mu, _ = per_element(mesh, material)
    blocks = np.empty((*nodes.shape, nodes.shape[1], 1, 1))
    for elements, _, gradient, weight in batches(mesh):
        slope = gradient @ u[nodes[elements]][:, None]  # d u_j / d x_i
        trace = np.trace(slope, axis1=2, axis2=3)[..., None, None]
        stress = lam[elements, None, None, None] * trace * np.eye(3)
        stress = stress + mu[elements, None, None, None] * (slope + slope.swapaxes(2, 3))
        weighted = weight[..., None, None] * (stress @ gradient)
        blocks[elements] = symmetric(np.einsum("eqia,eqib->eab", gradient, weighted, optimize=True)[..., None, None])
    return kron(scatter(nodes, mesh.doflocs.shape[1], blocks), identity(3), format="csr")


def spin_softening(mass: Any, axis: Sequence[float], speed: float) -> csr_matrix:
    """-speed^2 M P, P taking the part normal to the axis: the centrifugal force grows with the displacement.

    mass : (3 n_node, 3 n_node) of whole nodes [kg]; axis : (3,); speed : [rad/s]
    Returns (3 n_node, 3 n_node) [N/m]
    """
    direction = unit(axis, "the axis of rotation")
    normal = np.eye(3) - np.outer(direction, direction)
    return csr_matrix(-(speed**2) * mass @ kron(identity(mass.shape[0] // 3), normal))
