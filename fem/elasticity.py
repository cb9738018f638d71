"""Mass and stiffness of linear elasticity from batches of element matrices.

K_(ai)(bj) = integral of lambda g_ai g_bj + mu g_aj g_bi + mu delta_ij g_ak g_bk with g_ai = dN_a/dx_i: all three terms
come from one product G = g^T g, which is what makes the batch fast.
Source  Hughes, The Finite Element Method, 2000, section 2.8"""

from collections.abc import Iterator, Mapping
from itertools import product
from typing import Any

import numpy as np
from scipy.sparse import block_diag, csr_matrix, identity, kron

from tribodyn.fem.assembly import materials_of
from tribodyn.fem.elements import batches, connectivity, coordinates, mapped_batches, scatter
from tribodyn.fem.material import AnyMaterial, Material
from tribodyn.refusal import Refusal

FORMULATIONS = ("linear_full", "linear_bbar", "linear_incompatible", "linear_reduced")
"""Of 8-node hexahedra: all of 2 x 2 x 2 points; these with the mean dilatation of the element, or with three bubbles
for each displacement besides; or mean gradients."""
HOURGLASS = 0.005  # stiffness of hourglass modes over the shear modulus
SIGNS = np.array(list(product((-1, 1), repeat=3)), float)  # of the corners of an element
MODES = np.array([SIGNS[:, 1] * SIGNS[:, 2], SIGNS[:, 0] * SIGNS[:, 2], SIGNS[:, 0] * SIGNS[:, 1], SIGNS.prod(axis=1)])


def assemble(mesh: Any, material: Any, order: int = 5) -> tuple[csr_matrix, csr_matrix]:
    """Mass and stiffness over all nodes, DOF = node * 3 + component; reference points of an assembly have none.

    mesh : scikit-fem MeshHex2 or MeshTet2, MeshHex1 with linear reduced elements, or an assembly of such
    material : one for the whole mesh, or subdomain name -> material; of an assembly one, or body name -> these
    order : quadrature order
    Returns M [kg], K [N/m], each (3 n_node, 3 n_node), symmetric to the last bit"""
    matrices = [
        _assemble(piece.mesh, material_of_piece, order) for piece, material_of_piece in materials_of(mesh, material)
    ]
    n_reference = 3 * mesh.doflocs.shape[1] - sum(M.shape[0] for M, _ in matrices)
    if len(matrices) == 1 and not n_reference:
        return matrices[0]
    reference_points = [csr_matrix((n_reference, n_reference))] if n_reference else []
    mass, stiffness = (block_diag([*blocks, *reference_points], format="csr") for blocks in zip(*matrices, strict=True))
    return mass, stiffness


def _assemble(
    mesh: Any, material: AnyMaterial | Mapping[str, AnyMaterial], order: int
) -> tuple[csr_matrix, csr_matrix]:
    nodes = connectivity(mesh)
    kinds, _ = element_materials(mesh, material)
    isotropic = all(isinstance(kind, Material) for kind in kinds)
    rho = densities(mesh, material)
    form = formulation(mesh, material)
    if form == "linear_reduced":
        return _linear_reduced(mesh, material)
    if bool(form) != (nodes.shape[1] == 8):
        raise Refusal(f'the elements have {nodes.shape[1]} nodes: elements = "linear_full", "linear_bbar" and '
                      '"linear_incompatible" are for eight, "linear_reduced" for eight or 27')  # fmt: skip
    if isotropic:
        lam, mu, _ = element_constants(mesh, material)
    C = element_tensors(mesh, material, "tensor")
    n_element, n_a = nodes.shape
    mass = np.empty((n_element, n_a, n_a, 1, 1))
    stiffness = np.empty((n_element, n_a, n_a, 3, 3))
    for elements, N, gradient, weight, enhancement in strain_operators(mesh, material, 3 if form else order):
        mass[elements] = symmetric(mass_blocks(N, weight * rho[elements, None]))
        if enhancement is not None:
            blocks = _enhanced_blocks(gradient, enhancement, weight, C[elements])
        elif isotropic:
            blocks = stiffness_blocks(gradient, weight, lam[elements], mu[elements])
        else:
            blocks = tensor_blocks(gradient, weight, C[elements])
        stiffness[elements] = symmetric(blocks)
    n_node = mesh.doflocs.shape[1]
    return kron(scatter(nodes, n_node, mass), identity(3), format="csr"), scatter(nodes, n_node, stiffness)


def formulation(mesh: Any, material: AnyMaterial | Mapping[str, AnyMaterial]) -> str:
    """The formulation that the materials of a mesh ask for; raises Refusal where they ask for several."""
    forms = {kind.elements for kind in element_materials(mesh, material)[0]}
    if len(forms) > 1:
        raise Refusal(f"material: one mesh has elements of {' and '.join(map(repr, sorted(forms)))}: give all the same")
    return forms.pop()


def strain_operators(
    mesh: Any, material: AnyMaterial | Mapping[str, AnyMaterial], order: int, size: int = 256,
    only: np.ndarray | None = None,
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]]:  # fmt: skip
    """Yield (elements, N, grad N, weight, E) as `batches` does.

    E (n_e, n_q, 3, 3, 8, 3) [1/m], times the displacements, is what the formulation of 8-node hexahedra adds to the
    displacement gradient; None where it adds nothing
    Source  Hughes, IJNME 15 (1980) 1413, for the mean dilatation"""
    form = formulation(mesh, material)
    C = element_tensors(mesh, material, "tensor") if form == "linear_incompatible" else None
    for elements, N, dN, J, weight in mapped_batches(mesh, order, size, only):
        gradient, enhancement = np.linalg.solve(J, dN[None]), None
        if form == "linear_bbar":
            mean = np.einsum("eq,eqka->eka", weight / weight.sum(axis=1, keepdims=True), gradient)[:, None]
            enhancement = np.einsum("ij,eqka->eqijak", np.eye(3) / 3, mean - gradient)
        elif C is not None:
            enhancement = _bubble_strain(gradient, _bubbles(J, N @ mesh.elem().doflocs), weight, C[elements])
        yield elements, N, gradient, weight, enhancement


def _bubbles(J: np.ndarray, X: np.ndarray) -> np.ndarray:
    """Gradients (n_e, n_q, 3, 3) of x (1 - x) for each reference coordinate, at X (n_q, 3); their mean is zero.

    Source  Taylor, Beresford and Wilson, IJNME 10 (1976) 1211: with the Jacobian of the centre they pass the patch test
    """
    centre = J.mean(axis=1, keepdims=True)
    ratio = np.linalg.det(centre) / np.linalg.det(J)
    return np.asarray(ratio[..., None, None] * np.linalg.solve(centre, (1 - 2 * X)[:, :, None] * np.eye(3)))


def _bubble_strain(gradient: np.ndarray, bubbles: np.ndarray, weight: np.ndarray, C: np.ndarray) -> np.ndarray:
    """What the bubbles add to the displacement gradient (n_e, n_q, 3, 3, n_a, 3), the forces on them being zero."""
    n_e, n_a = len(gradient), gradient.shape[3]
    K = tensor_blocks(np.concatenate([gradient, bubbles], axis=3), weight, C).transpose(0, 1, 3, 2, 4)
    K = K[:, n_a:].reshape(n_e, 9, 3 * (n_a + 3))
    amplitude = -np.linalg.solve(K[:, :, 3 * n_a :], K[:, :, : 3 * n_a]).reshape(n_e, 3, 3, n_a, 3)
    return np.einsum("eqib,ebjak->eqijak", bubbles, amplitude, optimize=True)


def _enhanced_blocks(gradient: np.ndarray, enhancement: np.ndarray, weight: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Element stiffness (n_e, n_a, n_a, 3, 3) [N/m] with what a formulation adds to the displacement gradient."""
    n_e, n_q, _, n_a = gradient.shape
    slope = enhancement + np.einsum("eqia,jk->eqijak", gradient, np.eye(3))
    slope = slope.reshape(n_e, n_q, 9, 3 * n_a)
    stress = (weight[..., None, None] * (C.reshape(n_e, 1, 9, 9) @ slope)).reshape(n_e, -1, 3 * n_a)
    K = slope.reshape(n_e, -1, 3 * n_a).transpose(0, 2, 1) @ stress
    return K.reshape(n_e, n_a, 3, n_a, 3).transpose(0, 1, 3, 2, 4)


def _linear_reduced(mesh: Any, material: AnyMaterial | Mapping[str, AnyMaterial]) -> tuple[csr_matrix, csr_matrix]:
    cells, gradient, volume, hourglass = reduced_elements(mesh)
    times = len(cells) // mesh.nelements
    rho = np.tile(densities(mesh, material), times)
    if all(isinstance(kind, Material) for kind in element_materials(mesh, material)[0]):
        lam, mu, _ = (np.tile(values, times) for values in element_constants(mesh, material))
        stiffness = stiffness_blocks(gradient[:, None], volume[:, None], lam, mu)
    else:
        C = np.tile(element_tensors(mesh, material, "tensor"), (times, 1, 1, 1, 1))
        mu = (C[:, 0, 1, 0, 1] + C[:, 0, 2, 0, 2] + C[:, 1, 2, 1, 2]) / 3
        stiffness = tensor_blocks(gradient[:, None], volume[:, None], C)
    stiffness += (mu[:, None, None] * hourglass)[..., None, None] * np.eye(3)
    lumped = (rho * volume / 8)[:, None, None, None, None] * np.eye(8)[None, :, :, None, None]
    n_node = mesh.doflocs.shape[1]
    mass = kron(scatter(cells, n_node, lumped), identity(3), format="csr")
    return mass, scatter(cells, n_node, symmetric(stiffness))


def strain_points(mesh: Any, material: AnyMaterial | Mapping[str, AnyMaterial]) -> Iterator[tuple[np.ndarray, ...]]:
    """Yield (elements, nodes, N, grad N, weight) as `batches` does, nodes (n_e, n_a) of each element besides, where the
    strain of one mesh is taken: for linear elements, once or eight times in each of the mesh, its mean."""
    if formulation(mesh, material):
        cells, gradient, volume, _ = reduced_elements(mesh)
        parents = np.tile(np.arange(mesh.nelements), len(cells) // mesh.nelements)
        yield parents, cells, np.full((1, 8), 1 / 8), gradient[:, None], volume[:, None]
        return
    for elements, *of_points in batches(mesh):
        yield elements, connectivity(mesh)[elements], *of_points


def mass_blocks(N: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Element mass (n_e, n_a, n_a, 1, 1) [kg] of shape functions N (n_q, n_a) and weight rho |J| w (n_e, n_q)."""
    pairs = (N[:, :, None] * N[:, None, :]).reshape(len(N), -1)
    n_a = N.shape[1]
    return (weight @ pairs).reshape(-1, n_a, n_a, 1, 1)


def stiffness_blocks(gradient: np.ndarray, weight: np.ndarray, lam: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """Element stiffness (n_e, n_a, n_a, 3, 3) [N/m].

    gradient : (n_e, n_q, 3, n_a) [1/m]; weight : (n_e, n_q) [m3]; lam, mu : (n_e,) [Pa]"""
    n_e, n_q, _, n_a = gradient.shape
    g = gradient.reshape(n_e, n_q, 3 * n_a)  # column i * n_a + a
    G = g.transpose(0, 2, 1) @ (weight[:, :, None] * g)
    G = G.reshape(n_e, 3, n_a, 3, n_a).transpose(0, 2, 4, 1, 3)  # e, a, b, i, j
    lam, mu = lam[:, None, None, None, None], mu[:, None, None, None, None]
    trace = np.trace(G, axis1=3, axis2=4)[..., None, None]
    return lam * G + mu * (G.swapaxes(3, 4) + trace * np.eye(3))


def tensor_blocks(gradient: np.ndarray, weight: np.ndarray, C: np.ndarray) -> np.ndarray:
    """The same as `stiffness_blocks` for any elasticity tensors C (n_e, 3, 3, 3, 3) [Pa].

    K_(ai)(bj) = integral of C_ikjl g_ka g_lb"""
    n_e, n_q, _, n_a = gradient.shape
    g = gradient.reshape(n_e, n_q, 3 * n_a)
    G = (g.transpose(0, 2, 1) @ (weight[:, :, None] * g)).reshape(n_e, 3, n_a, 3, n_a)
    return np.einsum("eikjl,ekalb->eabij", C, G, optimize=True)


def symmetric(blocks: np.ndarray) -> np.ndarray:
    """Element matrices (n_e, n_a, n_a, k, k) without the rounding that breaks their symmetry."""
    return (blocks + blocks.transpose(0, 2, 1, 4, 3)) / 2


def element_materials(
    mesh: Any, material: AnyMaterial | Mapping[str, AnyMaterial]
) -> tuple[list[AnyMaterial], np.ndarray]:
    """Materials, and for each element of one mesh (n_element,) which of them it has.

    Raises  Refusal for a subdomain the mesh lacks, or an element with no or two materials"""
    n_element = mesh.t.shape[1]
    if not isinstance(material, Mapping):
        return [material], np.zeros(n_element, dtype=int)
    members = mesh.subdomains or {}
    count, kind = np.zeros((2, n_element), dtype=int)
    for i, name in enumerate(material):
        if name not in members:
            raise Refusal(f"material: the mesh has no subdomain '{name}'; it has {sorted(members) or 'none'}")
        count[members[name]] += 1
        kind[members[name]] = i
    if (count != 1).any():
        raise Refusal(
            f"material: {np.sum(count == 0)} elements have no material and {np.sum(count > 1)} have more than one; "
            f"name each of the subdomains {sorted(members)} once"
        )
    return [*material.values()], kind


def densities(mesh: Any, material: AnyMaterial | Mapping[str, AnyMaterial]) -> np.ndarray:
    """Density of each element of one mesh (n_element,) [kg/m3]; raises Refusal as `element_materials` does."""
    kinds, kind = element_materials(mesh, material)
    return np.array([material_kind.rho for material_kind in kinds])[kind]


def element_tensors(mesh: Any, material: AnyMaterial | Mapping[str, AnyMaterial], name: str) -> np.ndarray:
    """A tensor (n_element, 3, ...) of the material at the centre of each element of one mesh.

    name : "tensor" [Pa] or "expansion_tensor" [1/K]"""
    kinds, kind = element_materials(mesh, material)
    centres = mesh.p[:, mesh.t].mean(axis=1).T
    kind_values = [getattr(material_kind, name)(centres[kind == i]) for i, material_kind in enumerate(kinds)]
    tensors = np.empty((len(kind), *kind_values[0].shape[1:]))
    for i, tensor in enumerate(kind_values):
        tensors[kind == i] = tensor
    return tensors


def element_constants(
    mesh: Any, material: AnyMaterial | Mapping[str, AnyMaterial]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lame's constants [Pa] and density [kg/m3] of each element of isotropic materials, three arrays (n_element,)."""
    kinds, kind = element_materials(mesh, material)
    values = np.array(
        [[*material_kind.lame, material_kind.rho] for material_kind in kinds if isinstance(material_kind, Material)]
    )
    return values[kind, 0], values[kind, 1], values[kind, 2]


def reduced_elements(mesh: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Nodes (n, 8), mean gradient (n, 3, 8) [1/m] and volume (n,) [m3] of the linear elements of a mesh; n goes through
    all 27-node ones eight times, through 8-node ones once.

    The elements are those of a first-order mesh, or eight in each 27-node one. The gradient is the mean over the
    element and the mass lumped: what explicit programs and many published models have, softer than the 27-node element.
    The fourth, (n, 8, 8) [m], times the shear modulus and a unit matrix (3, 3), holds hourglass modes
    Raises  Refusal for a mesh of other elements
    Source  Flanagan and Belytschko, IJNME 17 (1981) 679"""
    nodes = connectivity(mesh)
    if nodes.shape[1] == 10:
        raise Refusal('material: elements = "linear_reduced" needs hexahedra, and the mesh has tetrahedra')
    reference = np.asarray(mesh.elem().doflocs).reshape(-1, 3)
    side = 2 if nodes.shape[1] == 27 else 1  # linear elements along an edge of one of the mesh
    corners = [(np.array(at) + (1 + SIGNS) / 2) / side for at in product(range(side), repeat=3)]
    local = [[int(np.abs(reference - corner).max(axis=1).argmin()) for corner in eight] for eight in corners]
    cells = np.concatenate([nodes[:, eight] for eight in local])
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
    hourglass_stiffness = 8 * HOURGLASS * volume * (mean**2).sum(axis=(1, 2))
    return cells, mean, volume, np.einsum("e,ehI,ehJ->eIJ", hourglass_stiffness, shape, shape)


def _slopes(at: np.ndarray) -> np.ndarray:
    """(3, 8) derivatives of the trilinear functions at a point of [-1, 1]^3."""
    v = 1 + SIGNS * at
    return np.array([SIGNS[:, i] * v[:, (i + 1) % 3] * v[:, (i + 2) % 3] for i in range(3)]) / 8
