"""From the mesh of a file to bodies that scikit-fem can compute: one mesh of one kind for each, with its groups.

Every element first gets all nodes that a full second-order element has: in its edges, its quadrilateral faces and its
middle. A mesh of hexahedra alone or tetrahedra alone stays as it is. Where kinds mix, each element is cut into
tetrahedra that use these nodes and no others: the cuts of neighbours meet, because every quadrilateral is cut through
its corner of the lowest number.
Source  Dompierre, Labbe, Vallet, Camarero, How to subdivide pyramids, prisms and hexahedra into tetrahedra, 1999"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from tribodyn.geometry.element_library import skfem
from tribodyn.geometry.numbering import REFERENCE_POINTS, permutation
from tribodyn.geometry.sources.full_elements import Full, Pieces, cut_face, full, supports, tetrahedra, uncut
from tribodyn.geometry.sources.raw_mesh import HEXA, TETRA, VOLUMES, Cells, RawMesh
from tribodyn.refusal import Refusal

Groups = dict[str, np.ndarray]


@dataclass(frozen=True)
class SolidBody:
    """mesh : scikit-fem's MeshHex2 or MeshTet2 [m], its boundaries and subdomains named as in the file
    node_sets : group of any kind -> its nodes, sorted columns of mesh.doflocs
    node_of : (n_point,) node that each point of the file is, -1 where it is none of this body
    cut : whether its elements were cut into tetrahedra because kinds mix
    unmatched : surface groups with faces that are not faces of the volume mesh; they become no boundaries
    added : nodes (k,) that are not in the file, and the nodes (k, m) that each interpolates, by kind of place"""

    mesh: Any
    node_sets: Groups
    node_of: np.ndarray
    cut: bool
    unmatched: tuple[str, ...] = ()
    added: tuple[tuple[np.ndarray, np.ndarray], ...] = ()


def bodies(raw: RawMesh) -> dict[str, np.ndarray]:
    """The bodies of a file and their elements: parts that share no node, named by the group that holds them.

    Parts that one group holds together, as four bolts, are one body; a part that several groups share out, as a blade
    of two materials, bears their names joined by +."""
    piece = _pieces(raw)
    n_piece = int(piece.max()) + 1
    size = np.bincount(piece)
    chosen: dict[int, str] = {}
    inside: dict[int, list[str]] = {}
    named = raw.bodies or sorted(raw.volumes, key=lambda name: len(raw.volumes[name]))
    for name in named:
        counts = np.bincount(piece[raw.volumes[name]], minlength=n_piece)
        for i in np.flatnonzero(counts).tolist():
            if counts[i] == size[i]:
                chosen.setdefault(i, name)
            else:
                inside.setdefault(i, []).append(name)
    if not raw.bodies:  # a group of all elements identifies no part where there are several
        chosen = {i: name for i, name in chosen.items() if len(raw.volumes[name]) < len(piece) or n_piece == 1}
    nameless = [i for i in range(n_piece) if i not in chosen and i not in inside]
    for count, i in enumerate(nameless, 1):
        chosen[i] = "body" if n_piece == 1 else f"body{count}"
    for i, names in inside.items():
        chosen.setdefault(i, "+".join(sorted(names)))
    parts_of: dict[str, list[int]] = {}
    for i in range(n_piece):
        parts_of.setdefault(chosen[i], []).append(i)
    return {name: np.flatnonzero(np.isin(piece, parts)) for name, parts in parts_of.items()}


def _pieces(raw: RawMesh) -> np.ndarray:
    """For each element the number of the connected part that it belongs to, counted in the order of the file."""
    first = np.concatenate([cells.nodes[:, 0] for cells in raw.cells])
    rows = np.concatenate([np.repeat(cells.nodes[:, 0], cells.nodes.shape[1]) for cells in raw.cells])
    columns = np.concatenate([cells.nodes.ravel() for cells in raw.cells])
    n = len(raw.points)
    _, label = connected_components(coo_matrix((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(n, n)))
    _, labels, number = np.unique(label[first], return_index=True, return_inverse=True)
    rank = np.empty(len(labels), dtype=int)
    rank[labels.argsort()] = np.arange(len(labels))
    return np.asarray(rank[number])


def build(raw: RawMesh, elements: np.ndarray | None = None) -> SolidBody:
    """One body out of elements of a file, all of them by default."""
    far = np.abs(raw.points).max(initial=0.0)
    if not far < 1e12:
        raise Refusal(f"a node lies at {far:g}: correct its coordinates, or the unit of the file")
    cells, number = _chosen(raw, elements)
    fulls = [full(block, raw.points) for block in cells]
    kinds = {id(VOLUMES[block.kind][0]) for block in cells}
    cut = kinds not in ({id(HEXA)}, {id(TETRA)})
    hexahedra = kinds == {id(HEXA)}
    pieces = [tetrahedra(filled) if cut else uncut(filled) for filled in fulls]
    rows = np.vstack(
        [np.take_along_axis(filled.rows[p.parent], p.local, 1) for filled, p in zip(fulls, pieces, strict=True)]
    )
    points = np.vstack([filled.points[p.parent[:, None], p.local] for filled, p in zip(fulls, pieces, strict=True)])
    mesh, node_of = _mesh(rows, points, hexahedra, len(raw.points))
    part_of = np.concatenate([number[b][p.parent] for b, p in enumerate(pieces)])  # element number of each piece

    facets_of = {name: _facets(mesh, node_of, parts) for name, parts in raw.faces.items()}
    unmatched = tuple(name for name, ids in facets_of.items() if ids is None)
    boundaries = {name: ids for name, ids in facets_of.items() if ids is not None and len(ids)}
    volumes = {name: np.flatnonzero(np.isin(part_of, members)) for name, members in raw.volumes.items()}
    subdomains = {name: members for name, members in volumes.items() if len(members)}
    node_sets = {name: np.unique(mesh.dofs.element_dofs[:, members]) for name, members in subdomains.items()}
    node_sets |= {name: np.unique(mesh.dofs.get_facet_dofs(ids).flatten()) for name, ids in boundaries.items()}
    added = _added(mesh, fulls, pieces)
    for name, members in raw.nodes.items():
        mine = node_of[members]
        mine = mine[mine >= 0]
        if not len(mine) or name in node_sets:
            continue
        node_sets[name] = np.unique(np.concatenate([mine, _implied(mine, added, mesh.doflocs.shape[1])]))
        if name in raw.skins and len(skin := _skin(mesh, node_sets[name])):
            boundaries[name] = skin
    named = mesh.with_boundaries(boundaries).with_subdomains(subdomains)
    return SolidBody(named, node_sets, node_of, cut, unmatched, added)


def _chosen(raw: RawMesh, elements: np.ndarray | None) -> tuple[list[Cells], list[np.ndarray]]:
    """Blocks cut down to some elements, and the numbers of these."""
    blocks, numbers, start = [], [], 0
    chosen_numbers = None if elements is None else np.asarray(elements)
    for block in raw.cells:
        number = np.arange(start, start + len(block.nodes))
        start += len(block.nodes)
        keep = np.arange(len(number)) if chosen_numbers is None else np.flatnonzero(np.isin(number, chosen_numbers))
        if len(keep):
            blocks.append(Cells(block.kind, block.nodes[keep], block.labels[keep]))
            numbers.append(number[keep])
    return blocks, numbers


def _mesh(rows: np.ndarray, points: np.ndarray, hexahedra: bool, n_point: int) -> tuple[Any, np.ndarray]:
    """scikit-fem's mesh, and for each point of the file its node number or -1.

    rows : (n, 27 or 10) points of the file, -1 where there is none, in the order of meshio; points : (n, k, 3)"""
    first, second = (skfem.MeshHex1, skfem.MeshHex2) if hexahedra else (skfem.MeshTet1, skfem.MeshTet2)
    n_corner = first.elem.refdom.nnodes
    order = permutation(REFERENCE_POINTS["hexahedron27" if hexahedra else "tetra10"], second.elem().doflocs)
    rows, points = rows[:, order], points[:, order]
    vertices, connectivity = np.unique(rows[:, :n_corner].T, return_inverse=True)
    corners = np.empty((len(vertices), 3))
    corners[connectivity.reshape(n_corner, -1)] = points[:, :n_corner].transpose(1, 0, 2)
    straight = first(corners.T.copy(), connectivity.reshape(n_corner, -1))
    dofs = skfem.Dofs(straight, second.elem())
    locations = np.empty((3, dofs.N))
    locations[:, dofs.element_dofs] = points.transpose(2, 1, 0)
    node_of = np.full(n_point, -1)
    from_file = rows.T >= 0
    node_of[rows.T[from_file]] = dofs.element_dofs[from_file]
    return second(locations, straight.t), node_of


def _facets(mesh: Any, node_of: np.ndarray, parts: Iterable[np.ndarray]) -> np.ndarray | None:
    """Facets by their corners, rows of the file (k, 3) or (k, 4); facets of other bodies are left out.

    Returns None where some are no faces of this mesh, though they touch it. The three lowest nodes tell facets apart.
    """
    n_corner = mesh.facets.shape[0]
    corners = [np.empty((0, n_corner), dtype=int)]
    for part in parts:
        if n_corner == 3 and part.shape[1] == 4:
            part = cut_face(part)
        nodes = node_of[part]
        is_inside = (nodes >= 0).any(axis=1)
        if (nodes[is_inside] < 0).any() or (is_inside.any() and part.shape[1] != n_corner):
            return None
        corners.append(nodes[is_inside])
    facet_corners = np.vstack([nodes for nodes in corners if nodes.shape[1] == n_corner])

    def key(nodes: np.ndarray) -> np.ndarray:
        low = np.sort(nodes, axis=1)[:, :3].astype(np.int64)
        return np.asarray((low[:, 0] * mesh.nvertices + low[:, 1]) * mesh.nvertices + low[:, 2])

    keys, target_keys = key(mesh.facets.T), key(facet_corners)
    order = keys.argsort()
    at = order[np.searchsorted(keys, target_keys, sorter=order).clip(max=len(keys) - 1)]
    return np.unique(at) if (keys[at] == target_keys).all() else None


def _added(mesh: Any, fulls: Sequence[Full], pieces: Sequence[Pieces]) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """The nodes that were added to the file, and the nodes that each interpolates.

    These are the two ends of an edge, the corners and edges of a face, the whole hexahedron"""
    order = permutation(REFERENCE_POINTS["tetra10" if mesh.t.shape[0] == 4 else "hexahedron27"], mesh.elem().doflocs)
    start, tables = 0, []
    for elements, piece in zip(fulls, pieces, strict=True):
        dofs = mesh.dofs.element_dofs[:, start : start + len(piece.parent)].T
        start += len(piece.parent)
        nodes = np.empty(elements.rows.shape, dtype=int)
        nodes[piece.parent[:, None], piece.local[:, order]] = dofs
        for place, support in enumerate(supports(elements.solid)):
            is_added = elements.rows[:, place] < 0
            if is_added.any():
                added_nodes, first = np.unique(nodes[is_added, place], return_index=True)
                tables.append((added_nodes, nodes[is_added][first][:, _between(elements, support)]))
    return tuple(tables)


def _implied(members: np.ndarray, added: Sequence[tuple[np.ndarray, np.ndarray]], n_node: int) -> np.ndarray:
    """The added nodes that belong to a set: those that interpolate nodes of it alone."""
    inside = np.zeros(n_node, dtype=bool)
    inside[members] = True
    return np.concatenate([np.empty(0, dtype=int), *(new_nodes[inside[ends].all(axis=1)] for new_nodes, ends in added)])


def _between(elements: Full, support: tuple[int, ...]) -> list[int]:
    """Places in a full element of the nodes of the file that an added node interpolates."""
    roles = supports(elements.solid)
    in_file = np.all(elements.rows >= 0, axis=0).tolist()
    return [i for i, role in enumerate(roles) if in_file[i] and set(role) <= set(support) and role != support]


def _skin(mesh: Any, members: np.ndarray) -> np.ndarray:
    """Facets of the boundary whose corners and edge nodes all belong to a set."""
    inside = np.zeros(mesh.doflocs.shape[1], dtype=bool)
    inside[members] = True
    outer = np.flatnonzero(mesh.f2t[1] < 0)
    nodes = np.vstack([mesh.facets[:, outer], mesh.dofs.edge_dofs[0][mesh.f2e[:, outer]]])
    return np.asarray(outer[inside[nodes].all(axis=0)])
