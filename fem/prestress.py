"""Stiffness of a stressed and spinning part: stress stiffening and spin softening about a static equilibrium.

Stress and static displacement are iterated until they fit each other; the vibration about them is linear. The static
displacement is not added to the geometry, so that rotations have to be small.
In the turning frame a velocity v meets the Coriolis force -2 speed axis x v.
Source  Cook, Malkus, Plesha and Witt, Concepts and Applications of Finite Element Analysis, 2002, chapter 18"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import block_diag, csr_matrix, identity, kron

from tribodyn.fem.assembly import materials_of, pieces
from tribodyn.fem.elasticity import element_tensors, strain_points, symmetric
from tribodyn.fem.elements import batches, connectivity, scatter
from tribodyn.fem.factor import SingularStiffness, factorise
from tribodyn.fem.interface import unit
from tribodyn.fem.material import Material
from tribodyn.fem.modes import StaticDivergence
from tribodyn.fem.part import Part
from tribodyn.geometry.placement import cross

LOWER = "lower the load or the speed"
UNSTABLE = (
    "under its static load or speed the part is unstable at rest: its stress and spin softening outweigh its "
    f"stiffness; {LOWER}"
)
NO_EQUILIBRIUM = f"under its static load or speed the part comes to no equilibrium with its own stress; {LOWER}"
PASSES = 40  # of displacement and stress
CONVERGED = 1e-8  # relative change of the displacement in a pass
LARGE_ROTATION = 0.05  # of an element [rad]: its sine is off by 0.04 %, its geometry by 5 %


@dataclass(frozen=True)
class Prestress:
    """A static equilibrium and the stiffness about it.

    stiffness : (n_free, n_free) under the stress of its displacement [N/m]; displacement : (n_free,) [m]
    residual : relative change of that displacement by its own stress once more; rotation : largest of any element [rad]
    """

    stiffness: csr_matrix
    displacement: np.ndarray
    residual: float
    rotation: float


def solve_prestress(
    part: Part, material: Material | Mapping[str, Material], at_rest: Callable[[csr_matrix], np.ndarray],
    start: np.ndarray, softening: Any = 0, temperature: np.ndarray | None = None,
) -> Prestress:  # fmt: skip
    """The equilibrium whose stress stiffens the part that rests in it: the fixed point of q = at_rest(K(q)).

    material : the one it was built with; at_rest : displacement (n_free,) [m] at rest of a part of this stiffness
    start : (n_free,) displacement [m] whose stress is the first one; softening : `spin_softening` over the free DOFs
        [N/m], 0 where it does not spin; temperature : as for `geometric_stiffness`
    Raises  StaticDivergence where no equilibrium is found or an element turns by more than LARGE_ROTATION; and what
        at_rest raises. Whether the equilibrium is stable is for `check_stability`"""
    soft, q = part.system.stiffness + softening, start
    for _ in range(PASSES):
        stress = geometric_stiffness(part.mesh, material, part.field(q), temperature)
        stiffness = csr_matrix(soft + part.restricted(stress))
        before, q = q, at_rest(stiffness)
        residual = float(np.linalg.norm(q - before) / max(np.linalg.norm(q), np.finfo(float).tiny))
        if residual <= CONVERGED:
            break
    else:
        raise StaticDivergence(f"{NO_EQUILIBRIUM} (the displacement still changes by {residual:.1e})")
    rotation = largest_rotation(part.mesh, part.field(q))
    if rotation > LARGE_ROTATION:
        raise StaticDivergence(
            f"its static deflection of {1e3 * np.abs(q).max():.3g} mm turns elements by {np.degrees(rotation):.2g} "
            f"degrees, and small rotations are assumed, up to {np.degrees(LARGE_ROTATION):.2g}; {LOWER}"
        )
    return Prestress(stiffness, q, residual, rotation)


def largest_rotation(mesh: Any, u: np.ndarray) -> float:
    """Largest rotation [rad] of any element under the displacement u (n_node, 3) [m]: of its mean gradient."""
    largest = 0.0
    for piece in pieces(mesh):
        nodes, displacement = connectivity(piece.mesh), u[piece.node : piece.node + piece.mesh.doflocs.shape[1]]
        for elements, _, gradient, weight in batches(piece.mesh):
            slope = gradient @ displacement[nodes[elements]][:, None]  # d u_j / d x_i
            mean = np.einsum("eq,eqij->eij", weight, slope) / weight.sum(axis=1)[:, None, None]
            turn = 0.5 * (mean - mean.swapaxes(1, 2))
            largest = max(largest, float(np.linalg.norm(turn, axis=(1, 2)).max() / np.sqrt(2)))
    return largest


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
    temperature : (n_node,) change of temperature [K] whose free expansion carries no stress"""
    blocks = []
    for piece, material_of_piece in materials_of(mesh, material):
        nodes = slice(piece.node, piece.node + piece.mesh.doflocs.shape[1])
        heat = None if temperature is None else temperature[nodes]
        blocks.append(_geometric_stiffness(piece.mesh, material_of_piece, u[nodes], heat))
    n_beyond = mesh.doflocs.shape[1] - sum(block.shape[0] for block in blocks)
    matrix = block_diag([*blocks, csr_matrix((n_beyond, n_beyond))], format="csr")
    return kron(matrix, identity(3), format="csr")


def _geometric_stiffness(mesh: Any, material: Any, u: np.ndarray, temperature: np.ndarray | None) -> csr_matrix:
    """The same of one mesh, without the factor of three components: (n_node, n_node)."""
    C, expansion = (element_tensors(mesh, material, name) for name in ("tensor", "expansion_tensor"))
    blocks_by_batch = []
    for elements, nodes, N, gradient, weight in strain_points(mesh, material):
        strain = gradient @ u[nodes][:, None]  # d u_j / d x_i; the tensor takes its symmetric part
        if temperature is not None:
            strain = strain - (temperature[nodes] @ N.T)[..., None, None] * expansion[elements, None]
        stress = np.einsum("eijkl,eqkl->eqij", C[elements], strain, optimize=True)
        weighted = weight[..., None, None] * (stress @ gradient)
        blocks = np.einsum("eqia,eqib->eab", gradient, weighted, optimize=True)[..., None, None]
        blocks_by_batch.append((nodes, symmetric(blocks)))
    nodes, blocks = (np.concatenate(of) for of in zip(*blocks_by_batch, strict=True))
    return scatter(nodes, mesh.doflocs.shape[1], blocks)


def spin_softening(mass: Any, axis: Sequence[float], speed: float) -> csr_matrix:
    """-speed^2 M P, P taking the part normal to the axis: the centrifugal force grows with the displacement.

    mass : (3 n_node, 3 n_node) of whole nodes [kg]; axis : (3,); speed : [rad/s]
    Returns (3 n_node, 3 n_node) [N/m]"""
    direction = unit(axis, "the axis of rotation")
    normal = np.eye(3) - np.outer(direction, direction)
    return csr_matrix(-(speed**2) * mass @ kron(identity(mass.shape[0] // 3), normal))


def coriolis(mass: Any, axis: Sequence[float], speed: float) -> csr_matrix:
    """G = 2 speed M [axis x]: what multiplies the velocity in the turning frame, antisymmetric.

    mass : (3 n_node, 3 n_node) of whole nodes [kg]; axis : (3,); speed : [rad/s]
    Returns (3 n_node, 3 n_node) [N s/m]
    Source  Geradin and Rixen, Mechanical Vibrations, 2015, section 2.9"""
    a = unit(axis, "the axis of rotation")
    return csr_matrix(2 * speed * mass @ kron(identity(mass.shape[0] // 3), cross(a)))
