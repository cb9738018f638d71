"""Stress from displacement: at all nodes, and at a place as rows over the displacements.

Inside an element the stress is taken where that of a displacement of second order is most accurate, at 2 x 2 x 2 Gauss
points of a hexahedron and at four points of a tetrahedron, and extrapolated to its nodes by the polynomial through
these points. At a node the elements that meet there are averaged, those of each body and material alone: stress may
jump from one material to another.
Source  Barlow, IJNME 10 (1976) 243; Hinton and Campbell, IJNME 8 (1974) 461"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from tribodyn.fem.assembly import Materials, Piece, materials_of, pieces
from tribodyn.fem.elasticity import element_materials, element_tensors, formulation, strain_operators, strain_points
from tribodyn.fem.elements import connectivity, coordinates
from tribodyn.fem.material import AnyMaterial
from tribodyn.geometry.element_library import skfem
from tribodyn.refusal import Refusal

COMPONENTS = ("xx", "yy", "zz", "yz", "xz", "xy")
"""Order of the components of a stress along an axis of length 6."""
ROWS, COLUMNS = (["xyz".index(name[side]) for name in COMPONENTS] for side in (0, 1))  # of these in a tensor (3, 3)


@dataclass(frozen=True)
class NodalStress:
    """Stress of the nodes; a node where materials of a body meet stands there once for each of them.

    node : (n,) numbers; material : (n,) number of the material among those of all bodies, body by body
    tensor : (n, 6, ...) [Pa], in the order of COMPONENTS; further axes are those of the displacement"""

    node: np.ndarray
    material: np.ndarray
    tensor: np.ndarray


def solids(mesh: Any, material: Any) -> Iterator[tuple[Piece, Materials, AnyMaterial, np.ndarray]]:
    """Yield every material of every body: its piece, what that is made of, itself, and the elements (n,) of it."""
    for piece, material_of_piece in materials_of(mesh, material):
        kinds, kind_of = element_materials(piece.mesh, material_of_piece)
        for number, kind in enumerate(kinds):
            yield piece, material_of_piece, kind, np.flatnonzero(kind_of == number)


def nodal_stress(mesh: Any, material: Any, u: np.ndarray, temperature: np.ndarray | None = None) -> NodalStress:
    """Stress at all nodes of a mesh or an assembly.

    material : as for fem.elasticity.assemble; u : (n_node, 3, ...) displacement [m], such as Fourier coefficients
    temperature : (n_node,) change of temperature [K], whose free expansion carries no stress; it belongs to the first
        entry of the last axis of u where that has one, such as the static coefficient"""
    shape = u.shape[2:]
    flat = u.reshape(*u.shape[:2], -1)
    results = []
    for number, (piece, material_of_piece, _, elements) in enumerate(solids(mesh, material)):
        if len(elements):
            node, tensor = _averaged(piece, material_of_piece, elements, flat, temperature)
            results.append((node, np.full(len(node), number), tensor))
    node, number_of, tensor = (np.concatenate(parts) for parts in zip(*results, strict=True))
    return NodalStress(node, number_of, tensor.reshape(len(node), 6, *shape))


def _averaged(
    piece: Piece, material: Materials, elements: np.ndarray, u: np.ndarray, temperature: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n,) of some elements of one material, and their mean stress (n, 6, k)."""
    tensors = element_tensors(piece.mesh, material, "tensor")
    expansion = None if temperature is None else element_tensors(piece.mesh, material, "expansion_tensor")
    n_node, width = piece.mesh.doflocs.shape[1], 6 * u.shape[2]
    total, count = np.zeros((n_node, width)), np.zeros(n_node)
    for numbers, nodes, N, gradient, enhancement, extrapolation in _recovery_points(piece.mesh, material, elements):
        slope = np.einsum("eqia,eajk->eqijk", gradient, u[nodes + piece.node], optimize=True)
        if enhancement is not None:
            slope += np.einsum("eqijal,ealk->eqijk", enhancement, u[nodes + piece.node], optimize=True)
        if temperature is not None and expansion is not None:
            heat = temperature[nodes + piece.node] @ N.T
            slope[..., 0] -= heat[..., None, None] * expansion[numbers, None]
        stress = np.einsum("eijkl,eqklc->eqijc", tensors[numbers], slope, optimize=True)[:, :, ROWS, COLUMNS]
        at_nodes = np.einsum("aq,eqvc->eavc", extrapolation, stress, optimize=True).reshape(-1, width)
        gather = csr_matrix((np.ones(nodes.size), (nodes.ravel(), np.arange(nodes.size))), (n_node, nodes.size))
        total += gather @ at_nodes
        count += np.bincount(nodes.ravel(), minlength=n_node)
    node = np.flatnonzero(count)
    return node + piece.node, (total[node] / count[node, None]).reshape(len(node), 6, -1)


def _recovery_points(mesh: Any, material: Materials, elements: np.ndarray) -> Iterator[tuple[Any, ...]]:
    """Yield (numbers, nodes, N, grad N, S, E) of some elements at a time.

    numbers (n_e,); nodes (n_e, n_a); N (n_q, n_a) and grad N (n_e, n_q, 3, n_a) [1/m] where stress is taken
    S what the formulation adds to the displacement gradient, as in `strain_operators`, None for nothing
    E (n_a, n_q) from there to the nodes"""
    form = formulation(mesh, material)
    if form == "linear_reduced":
        chosen = np.zeros(mesh.nelements, bool)
        chosen[elements] = True
        for parents, nodes, N, gradient, _ in strain_points(mesh, material):
            used = chosen[parents]
            yield parents[used], nodes[used], N, gradient[used], None, np.ones((nodes.shape[1], 1))
        return
    reference = np.asarray(mesh.elem().doflocs).reshape(-1, 3)
    is_tetrahedron = len(reference) == 10
    order = 2 if is_tetrahedron else 3
    X, _ = skfem.quadrature.get_quadrature(mesh.elem(), order)
    extrapolation = _monomials(reference, is_tetrahedron) @ np.linalg.inv(_monomials(X.T, is_tetrahedron))
    nodes = connectivity(mesh)
    for numbers, N, gradient, _, enhancement in strain_operators(mesh, material, order, 1024, elements):
        heated = np.broadcast_to(N.mean(axis=0), N.shape) if form == "linear_bbar" else N  # as the mean dilatation
        yield numbers, nodes[numbers], heated, gradient, enhancement, extrapolation


def _monomials(points: np.ndarray, is_tetrahedron: bool) -> np.ndarray:
    """1, x, y, z at points (n, 3), of a hexahedron with all their products (n, 8)."""
    if is_tetrahedron:
        return np.column_stack([np.ones(len(points)), points])
    return np.stack([np.prod(points ** np.array(powers), axis=1) for powers in product((0, 1), repeat=3)], axis=1)


@dataclass(frozen=True)
class PartPoint:
    """A point of a part.

    point : (3,) [m]; piece : body that it belongs to; element : of that; nodes, weights : (n_a,) of the element, by
        which a field at the nodes has its value there"""

    point: np.ndarray
    piece: Piece
    element: int
    nodes: np.ndarray
    weights: np.ndarray

    @property
    def nearest(self) -> int:
        """The node next to it."""
        return int(self.nodes[self.weights.argmax()])


def locate(
    mesh: Any, point: Sequence[float], label: str, body: str | None = None, outside: float = 0.1, near: int = 32
) -> PartPoint:
    """The point of a part that is nearest to a point.

    body : of an assembly, that the point is looked for in; any by default
    outside : distance from the part, over the size of an element there, beyond which a point is no place of it
    near : nodes round the point whose elements are searched for it
    Raises  Refusal, naming it by `label`, where the part is not there or the body unknown"""
    target, names = np.asarray(point, float), [each.name for each in getattr(mesh, "bodies", ())]
    if body is not None and body not in names:
        raise Refusal(f"{label}: there is no body '{body}'", cure=f"give one of {', '.join(names)}")
    searched = pieces(mesh) if body is None else [pieces(mesh)[names.index(body)]]
    candidates = [_nearest(piece, target, near) for piece in searched]
    distance, size, place = min(candidates, key=lambda candidate: candidate[0])
    if distance > outside * size:
        x, y, z = 1e3 * place.point
        raise Refusal(
            f"{label}: the point lies {1e3 * distance:.3g} mm outside the part",
            cure=f"give a point of it, such as the nearest, ({x:.4g}, {y:.4g}, {z:.4g}) mm",
        )
    return place


def _nearest(piece: Piece, target: np.ndarray, count: int) -> tuple[float, float, PartPoint]:
    """Distance [m], size of the element [m], and the place of a piece next to a point."""
    mesh, points = piece.mesh, coordinates(piece.mesh)
    nodes, element = connectivity(mesh), mesh.elem()
    is_tetrahedron = nodes.shape[1] == 10
    _, near = scipy.spatial.cKDTree(points).query(target, min(count, len(points)))
    results = []
    for number in np.flatnonzero(np.isin(nodes, near).any(axis=1)):
        corners = points[nodes[number]]
        X = np.full(3, 0.25 if is_tetrahedron else 0.5)
        for _ in range(20):
            N, dN = _shape(element, X, nodes.shape[1])
            step = np.linalg.solve((dN @ corners).T, target - N @ corners)
            X, before = _inside(X + step, is_tetrahedron), X
            if np.abs(X - before).max() < 1e-12:
                break
        N, _ = _shape(element, X, nodes.shape[1])
        distance = float(np.linalg.norm(N @ corners - target))
        place = PartPoint(N @ corners, piece, int(number), nodes[number] + piece.node, N)
        results.append((distance, float(np.ptp(corners, axis=0).max()), place))
    return min(results, key=lambda candidate: candidate[0])


def _shape(element: Any, X: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions (n,) and their slopes (3, n) at a point of the reference element."""
    values, slopes = zip(*(element.lbasis(X[:, None], a) for a in range(n)), strict=True)
    columns = [np.broadcast_to(s, (3, 1))[:, 0] for s in slopes]
    return np.array([float(np.ravel(v)[0]) for v in values]), np.array(columns).T


def _inside(X: np.ndarray, is_tetrahedron: bool) -> np.ndarray:
    """The point, moved into the reference element where it is outside."""
    X = np.clip(X, 0.0, 1.0)
    return X / X.sum() if is_tetrahedron and X.sum() > 1 else X


def stress_rows(
    mesh: Any, material: Any, place: PartPoint, temperature: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (6, 3 n_node) [Pa/m] whose product with the displacements is the stress at a place, that of `nodal_stress`;
    and the stress (6,) [Pa] of the heated part without displacement; temperature : (n_node,) change [K]."""
    piece, material_of_piece = next(pair for pair in materials_of(mesh, material) if pair[0].node == place.piece.node)
    tensors, expansion = (element_tensors(piece.mesh, material_of_piece, n) for n in ("tensor", "expansion_tensor"))
    kind_of = element_materials(piece.mesh, material_of_piece)[1]
    own = place.nodes - piece.node
    touching = np.isin(connectivity(piece.mesh), own).any(axis=1) & (kind_of == kind_of[place.element])
    points = list(_recovery_points(piece.mesh, material_of_piece, np.flatnonzero(touching)))
    n_node = piece.mesh.doflocs.shape[1]
    count = np.bincount(np.concatenate([nodes.ravel() for _, nodes, *_ in points]), minlength=n_node)
    weight = np.zeros(n_node)
    weight[own] = place.weights / np.maximum(count[own], 1)
    rows, held_back = np.zeros((6, mesh.doflocs.shape[1], 3)), np.zeros(6)
    for numbers, nodes, N, gradient, enhancement, extrapolation in points:
        shares = weight[nodes] @ extrapolation
        C = tensors[numbers][:, ROWS, COLUMNS]
        parts = np.einsum("eq,evkl,eqka->eavl", shares, C, gradient, optimize=True)
        if enhancement is not None:
            parts += np.einsum("eq,evkl,eqklab->eavb", shares, C, enhancement, optimize=True)
        for row in range(6):
            np.add.at(rows[row], nodes + piece.node, parts[:, :, row])
        if temperature is not None:
            heat = shares * (temperature[nodes + piece.node] @ N.T)
            held_back -= np.einsum("eq,evkl,ekl->v", heat, C, expansion[numbers], optimize=True)
    return rows.reshape(6, -1), held_back


def strain_row(mesh: Any, label: str, point: Sequence[float], direction: Sequence[float], length: float) -> np.ndarray:
    """Row (3 n_node,) [1/m] of the mean strain along a gauge: the change of its length over its length.

    point : (3,) its middle [m]; direction : (3,); length : [m]"""
    axis = np.asarray(direction, float) / np.linalg.norm(direction)
    row = np.zeros((mesh.doflocs.shape[1], 3))
    ends = [locate(mesh, np.asarray(point, float) + 0.5 * sign * length * axis, label) for sign in (1.0, -1.0)]
    base = float(axis @ (ends[0].point - ends[1].point))
    for sign, end in zip((1.0, -1.0), ends, strict=True):
        np.add.at(row, end.nodes, sign * end.weights[:, None] * axis / base)
    return row.ravel()
