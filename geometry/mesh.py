"""A mesh file -> scikit-fem's mesh with its groups, and what it is worth.

scikit-fem's own loader refuses 20-node hexahedra and loses the surface groups of second-order meshes, so the groups
are carried over here. A node number is a column of `mesh.doflocs`, everywhere in tribodyn.
"""

from __future__ import annotations

from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import skfem
from skfem.quadrature import get_quadrature

from tribodyn.geometry.numbering import REFERENCE_POINTS, permutation, serendipity_to_lagrange

Groups = dict[str, np.ndarray]

_VOLUME_CELLS = ("hexahedron27", "hexahedron20", "tetra10")
_FIRST_ORDER = ("hexahedron", "tetra", "wedge", "pyramid")


def read(path: str | Path) -> tuple[Any, Groups]:
    """Read a second-order mesh of hexahedra or tetrahedra with all its physical groups.

    path : a Gmsh .msh file (4.1) or what else meshio reads with cell sets; coordinates in metres. 20-node hexahedra
        become 27-node ones of the same shape
    Returns mesh : skfem MeshHex2 or MeshTet2; surface groups are its boundaries, volume groups its subdomains;
        node_sets : every group of any dimension, name -> sorted node numbers, edge, face and middle nodes included
    Raises ValueError: no such file, one that is no mesh, first-order or mixed volume elements, a group that is not
        part of the volume mesh, an inverted element
    """
    file = _file(Path(path))
    cell_type = _volume_cell_type(file, path)
    blocks = [i for i, block in enumerate(file.cells) if block.type == cell_type]
    cells = np.vstack([file.cells[i].data for i in blocks])
    mesh, node_of = _second_order_mesh(cell_type, file.points, cells)

    sets = {name: parts for name, parts in file.cell_sets.items() if not name.startswith("gmsh:")}
    first_cell = dict(zip(blocks, np.cumsum([0] + [len(file.cells[i]) for i in blocks]), strict=False))
    boundaries: Groups = {}
    subdomains: Groups = {}
    node_sets: Groups = {}
    for name, parts in sets.items():
        members = {i: np.asarray(ids, dtype=int) for i, ids in enumerate(parts) if ids is not None and len(ids)}
        dimension = {file.cells[i].dim for i in members}
        if dimension == {3}:
            subdomains[name] = np.sort(np.concatenate([ids + first_cell[i] for i, ids in members.items()]))
            node_sets[name] = np.unique(mesh.dofs.element_dofs[:, subdomains[name]])
        elif dimension == {2}:
            corners = [node_of[file.cells[i].data[ids]][:, : mesh.facets.shape[0]] for i, ids in members.items()]
            boundaries[name] = _facets(mesh, np.vstack(corners), name)
            node_sets[name] = np.unique(mesh.dofs.get_facet_dofs(boundaries[name]).flatten())
        elif dimension:
            nodes = [node_of[file.cells[i].data[ids]].ravel() for i, ids in members.items()]
            node_sets[name] = np.unique(np.concatenate(nodes))
            if node_sets[name][0] < 0:
                raise ValueError(f"group '{name}' has nodes outside the volume mesh: embed its points in a volume")
    mesh = mesh.with_boundaries(boundaries).with_subdomains(subdomains)
    quality(mesh)
    return mesh, node_sets


@dataclass(frozen=True)
class Quality:
    """What a mesh is worth.

    scaled_jacobian : smallest over all elements and points; 1 is a box (or a regular tetrahedron), 0 is degenerate
    worst_element : the element where it is found
    volume : volume of the mesh [m3]
    """

    scaled_jacobian: float
    worst_element: int
    volume: float


def quality(mesh: Any) -> Quality:
    """Measure a mesh at its nodes and quadrature points.

    mesh : skfem MeshHex2 or MeshTet2
    Raises ValueError: an element is inverted or degenerate somewhere
    Source  scaled Jacobian: Knupp, 2000; for tetrahedra normalised to 1 for the regular one
    """
    points, weights = get_quadrature(mesh.elem.refdom, 5)
    at = np.hstack([mesh.elem.doflocs.T, points])
    jacobian = np.moveaxis(mesh.mapping().DF(at), (0, 1), (-2, -1))  # (element, point, 3, 3)
    determinant = np.linalg.det(jacobian)
    determinant *= np.sign(determinant.sum()) or 1.0  # scikit-fem's own meshes are numbered in a mirror throughout
    edges = np.linalg.norm(jacobian, axis=-2)
    if mesh.elem.refdom.nnodes == 4:
        a, b, c = np.moveaxis(jacobian, -1, 0)
        ab, ac, bc = (np.linalg.norm(d, axis=-1) for d in (b - a, c - a, c - b))
        la, lb, lc = np.moveaxis(edges, -1, 0)
        corner_products = np.stack([la * lb * lc, la * ab * ac, lb * ab * bc, lc * ac * bc])
        full = corner_products.max(axis=0) / np.sqrt(2.0)
    else:
        full = edges.prod(axis=-1)
    scaled = np.divide(determinant, full, out=np.zeros_like(full), where=full > 0)
    element, _ = np.unravel_index(scaled.argmin(), scaled.shape)
    lowest = float(scaled.min())
    if not lowest > 0.0:
        centre = ", ".join(f"{x:.4g}" for x in mesh.p[:, mesh.t[:, element]].mean(axis=1))
        inverted = int((~(scaled > 0.0)).any(axis=1).sum())
        raise ValueError(
            f"{inverted} of {mesh.nelements} mesh elements are inverted or degenerate, the worst at ({centre}) m: "
            "refine the mesh there or soften the shape"
        )
    volume = float((determinant[:, -len(weights) :] @ weights).sum())
    return Quality(scaled_jacobian=lowest, worst_element=int(element), volume=volume)


def _file(path: Path) -> meshio.Mesh:
    """What meshio reads; what its readers print about formats that they try in vain is not shown."""
    if not path.is_file():
        raise ValueError(f"mesh file '{path}' does not exist: build the part first or correct the path")
    # meshio.read tries other formats called .msh first
    read = meshio.gmsh.read if path.suffix == ".msh" else meshio.read
    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            return read(path)
    except (Exception, SystemExit) as problem:  # the readers raise what they meet, and where none fits meshio exits
        said = "" if isinstance(problem, SystemExit) else " ".join(str(problem).split())
        reason = f" ({said})" if said else ""
        raise ValueError(f"mesh file '{path}' cannot be read{reason}: write it as a Gmsh file, MSH 4.1") from None


def _volume_cell_type(file: meshio.Mesh, path: str | Path) -> str:
    present = sorted({block.type for block in file.cells if block.dim == 3})
    if len(present) == 1 and present[0] in _VOLUME_CELLS:
        return present[0]
    if set(present) & set(_FIRST_ORDER):
        raise ValueError(f"mesh file '{path}' has elements of first order: write it with elements of second order")
    raise ValueError(
        f"mesh file '{path}' has volume elements {', '.join(present) or 'of no kind'}: "
        f"give it one kind out of {', '.join(_VOLUME_CELLS)}"
    )


def _second_order_mesh(cell_type: str, points: np.ndarray, cells: np.ndarray) -> tuple[Any, np.ndarray]:
    """Build skfem's mesh, and for each point of the file its node number or -1."""
    first, second = (
        (skfem.MeshTet1, skfem.MeshTet2) if cell_type == "tetra10" else (skfem.MeshHex1, skfem.MeshHex2)
    )
    n_corner = first.elem.refdom.nnodes
    positions = points[cells]
    if cell_type == "hexahedron20":
        positions = serendipity_to_lagrange(positions)
        cell_type = "hexahedron27"
    order = permutation(REFERENCE_POINTS[cell_type], second.elem().doflocs)

    vertices, connectivity = np.unique(cells[:, order[:n_corner]].T, return_inverse=True)
    straight = first(points[vertices].T.copy(), connectivity.reshape(n_corner, -1))
    dofs = skfem.Dofs(straight, second.elem())
    locations = np.empty((3, dofs.N))
    locations[:, dofs.element_dofs] = positions[:, order].transpose(2, 1, 0)
    node_of = np.full(len(points), -1)
    from_file = order < cells.shape[1]
    node_of[cells[:, order[from_file]].T] = dofs.element_dofs[from_file]
    return second(locations, straight.t), node_of


def _facets(mesh: Any, corners: np.ndarray, name: str) -> np.ndarray:
    """Find facets by their corner nodes, (n, 3) or (n, 4); the three lowest numbers tell a facet apart."""

    def key(nodes: np.ndarray) -> np.ndarray:
        low = np.sort(nodes, axis=1)[:, :3].astype(np.int64)
        return (low[:, 0] * mesh.nvertices + low[:, 1]) * mesh.nvertices + low[:, 2]

    keys = key(mesh.facets.T)
    order = keys.argsort()
    wanted = key(corners)
    found = order[np.searchsorted(keys, wanted, sorter=order).clip(max=len(keys) - 1)]
    if (corners < 0).any() or (keys[found] != wanted).any():
        raise ValueError(f"surface group '{name}' is not made of faces of the volume mesh: mesh both together")
    return np.unique(found)
