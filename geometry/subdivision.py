"""Cut every element of a mesh into eight; the shape and the groups stay the same.

A piece lies in its parent as a piece of the parent's own reference cell, so that curved elements keep their shape: the
refined mesh bounds the same body to rounding."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from tribodyn.geometry.element_library import skfem
from tribodyn.refusal import Refusal

Groups = dict[str, np.ndarray]


def subdivide(mesh: Any, node_sets: Mapping[str, np.ndarray], times: int = 1) -> tuple[Any, Groups]:
    """The mesh with elements of half the size, once or several times; a node keeps its number.

    mesh : skfem MeshHex2 or MeshTet2; node_sets : name -> node numbers
    Returns mesh, boundaries and subdomains likewise refined, and the node sets: a new node belongs to a set where the
        edge, face or element that it lies on did, with all its nodes"""
    for _ in range(times):
        mesh, node_sets = _once(mesh, node_sets)
    return mesh, dict(node_sets)


def first_order(mesh: Any, node_sets: Mapping[str, np.ndarray], name: str) -> tuple[Any, Groups]:
    """A mesh of hexahedra with straight edges as one of 8-node ones (MeshHex1); a corner keeps its number.

    Raises  Refusal, which names the body, for tetrahedra or curved elements"""
    if not isinstance(mesh, skfem.MeshHex2):
        raise Refusal(f"linear elements need hexahedra, and body '{name}' has tetrahedra: elements = \"quadratic\"")
    n, points = mesh.nvertices, np.asarray(mesh.doflocs)
    middle = points[:, mesh.edges].mean(axis=1)
    off = np.abs(points[:, mesh.dofs.edge_dofs[0]] - middle).max(axis=0)
    if (off > 1e-6 * np.linalg.norm(np.ptp(points[:, mesh.edges], axis=1), axis=0)).any():
        raise Refusal(f"linear elements need straight edges, '{name}' has curved ones: elements = \"quadratic\"")
    plain: Any = skfem.MeshHex(points[:, :n].copy(), mesh.t, sort_t=False)
    plain = plain.with_boundaries(mesh.boundaries or {}).with_subdomains(mesh.subdomains or {})
    return plain, {key: np.asarray(of)[np.asarray(of) < n] for key, of in node_sets.items()}


def _once(mesh: Any, node_sets: Mapping[str, np.ndarray]) -> tuple[Any, Groups]:
    hexahedra = isinstance(mesh, skfem.MeshHex2)
    n_vertex = int(mesh.t.max()) + 1
    plain: Any = (skfem.MeshHex if hexahedra else skfem.MeshTet)(mesh.doflocs[:, :n_vertex], mesh.t, sort_t=False)
    cells = plain.refined().t  # its vertices are counted as the nodes of second order: edges, facets, middles
    nodes = np.asarray(mesh.dofs.element_dofs)
    parent = _containing(cells, nodes, mesh.doflocs.shape[1])
    if not hexahedra:  # the pieces of a tetrahedron come in both hands
        at = mesh.elem.doflocs[(nodes[:, parent][None] == cells[:, None]).argmax(axis=1)]
        mirrored = np.linalg.det(np.moveaxis(at[1:] - at[0], 1, 0)) < 0
        cells[2:, mirrored] = cells[:1:-1, mirrored]
    linear: Any = (skfem.MeshHex if hexahedra else skfem.MeshTet)(np.asarray(mesh.doflocs), cells, sort_t=False)
    fine: Any = (skfem.MeshHex2 if hexahedra else skfem.MeshTet2).from_mesh(linear)
    points = _node_positions(mesh, nodes, fine, cells, parent)
    boundaries = {name: _pieces(mesh, fine, np.asarray(ids)) for name, ids in (mesh.boundaries or {}).items()}
    subdomains = {
        name: np.flatnonzero(np.isin(parent, np.asarray(ids))) for name, ids in (mesh.subdomains or {}).items()
    }
    fine = replace(fine, doflocs=points).with_boundaries(boundaries).with_subdomains(subdomains)
    return fine, {name: _filled(mesh, nodes, fine, parent, np.asarray(of)) for name, of in node_sets.items()}


def _incidence(groups: np.ndarray, n_node: int) -> csr_matrix:
    """(n_group, n_node) ones where a group (k, n_group) has a node."""
    k, n = groups.shape
    return csr_matrix((np.ones(k * n), (np.tile(np.arange(n), k), groups.ravel())), shape=(n, n_node))


def _containing(cells: np.ndarray, nodes: np.ndarray, n_node: int) -> np.ndarray:
    """(n_cell,) the element that all corners of a piece belong to."""
    shared = (_incidence(cells, n_node) @ _incidence(nodes, n_node).T).tocoo()
    is_contained = shared.data == len(cells)
    parent = np.full(cells.shape[1], -1)
    parent[shared.row[is_contained]] = shared.col[is_contained]
    assert (parent >= 0).all()
    return parent


def _node_positions(mesh: Any, nodes: np.ndarray, fine: Any, cells: np.ndarray, parent: np.ndarray) -> np.ndarray:
    """(3, n_node) nodes of the pieces, where the shape functions of their parents bring them."""
    element = mesh.elem()
    linear: Any = skfem.ElementHex1() if isinstance(mesh, skfem.MeshHex2) else skfem.ElementTetP1()
    local = (nodes[:, parent][None] == cells[:, None]).argmax(axis=1)  # (corner, piece) local node of the parent
    kinds, kind = np.unique(local, axis=1, return_inverse=True)
    weights = np.stack([_values(linear, element.doflocs.T, a) for a in range(len(cells))])  # (corner, node)
    points, fine_dofs = np.empty_like(fine.doflocs), np.asarray(fine.dofs.element_dofs)
    for i, corners in enumerate(kinds.T):
        at = element.doflocs[corners].T @ weights  # (3, node) in the parent
        N = np.stack([_values(element, at, a) for a in range(len(nodes))])
        cells_of_kind = np.flatnonzero(kind.ravel() == i)
        points[:, fine_dofs[:, cells_of_kind]] = np.einsum(
            "xap,an->xnp", mesh.doflocs[:, nodes[:, parent[cells_of_kind]]], N
        )
    return points


def _values(element: Any, at: np.ndarray, i: int) -> np.ndarray:
    return np.broadcast_to(np.asarray(element.lbasis(at, i)[0], dtype=float), at.shape[1])


def _all_nodes(mesh: Any, facets: np.ndarray) -> np.ndarray:
    """(k, n_facet) nodes of facets: corners, mid-sides, middles."""
    parts = [mesh.facets[:, facets], mesh.dofs.edge_dofs[0][mesh.f2e[:, facets]]]
    if isinstance(mesh, skfem.MeshHex2):
        parts.append(mesh.dofs.facet_dofs[:, facets])
    return np.vstack(parts)


def _pieces(mesh: Any, fine: Any, facets: np.ndarray) -> np.ndarray:
    """The facets of the refined mesh that some facets are cut into."""
    n = mesh.doflocs.shape[1]
    shared = (_incidence(fine.facets, n) @ _incidence(_all_nodes(mesh, facets), n).T).tocoo()
    return np.unique(shared.row[shared.data == len(fine.facets)])


def _filled(mesh: Any, nodes: np.ndarray, fine: Any, parent: np.ndarray, members: np.ndarray) -> np.ndarray:
    """A node set of the mesh on the refined one."""
    n = mesh.doflocs.shape[1]
    is_member, is_refined_member = np.zeros(n, dtype=bool), np.zeros(fine.doflocs.shape[1], dtype=bool)
    is_member[members] = True
    is_refined_member[members] = True
    is_refined_member[fine.dofs.element_dofs[:, is_member[nodes].all(axis=0)[parent]]] = True
    all_facets = np.arange(mesh.facets.shape[1])
    facets = all_facets[is_member[_all_nodes(mesh, all_facets)].all(axis=0)]
    if len(facets):
        is_refined_member[fine.dofs.get_facet_dofs(_pieces(mesh, fine, facets)).flatten()] = True
    middle = mesh.dofs.edge_dofs[0]
    edges = np.flatnonzero(is_member[mesh.edges].all(axis=0) & is_member[middle])
    halves = np.hstack([np.vstack([end[edges], middle[edges]]) for end in mesh.edges])
    halved_edges = np.sort(halves, axis=0)
    key = np.sort(fine.edges, axis=0)
    inner = np.flatnonzero(
        np.isin(key[0].astype(np.int64) * n + key[1], halved_edges[0].astype(np.int64) * n + halved_edges[1])
    )
    is_refined_member[fine.dofs.edge_dofs[0][inner]] = True
    return np.flatnonzero(is_refined_member)
