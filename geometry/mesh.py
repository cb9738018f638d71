"""One mesh of a file with its groups, its extent, volume and worst element; a node is a column of `mesh.doflocs`."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.geometry.element_library import skfem
from tribodyn.geometry.sources import foreign_file as sources, solid_body
from tribodyn.geometry.sources.cad import Sizes
from tribodyn.geometry.sources.deck import Deck
from tribodyn.refusal import Refusal

Groups = dict[str, np.ndarray]


def read(path: str | Path, sizes: Sizes | None = None) -> tuple[Any, Groups]:
    """Read a mesh of one body, or several seen as one, with all its groups.

    path : a mesh file that `sources.read` knows; coordinates in metres. Elements become 27-node hexahedra or 10-node
        tetrahedra: of the same shape where they are of one kind, cut into tetrahedra where kinds mix
    sizes : of the elements of a CAD file, in its unit
    Returns mesh : skfem MeshHex2 or MeshTet2; surface groups are its boundaries, volume groups its subdomains;
        node_sets : every group of any dimension, name -> node numbers, edge, face and middle nodes included
    Raises Refusal: no such file, one that is no mesh, a group outside the volume mesh, an inverted element"""
    mesh, node_sets, _ = read_with_notes(path, sizes)
    return mesh, node_sets


def read_with_notes(path: str | Path, sizes: Sizes | None = None) -> tuple[Any, Groups, tuple[str, ...]]:
    """The same as `read`, with notes on conversions of the file and on its unused content."""
    raw = sources.read_raw(path, sizes=sizes)
    body = solid_body.build(raw)
    lost = sources.missing_groups(raw, {"": body})
    if lost and raw.deck == Deck() and Path(path).suffix.lower() == ".msh":
        raise Refusal(f"mesh file '{path}' has {lost[0]}")
    quality(body.mesh)
    kinds = [f.name for f in fields(Deck) if getattr(raw.deck, f.name)]
    deck_note = [f"its {', '.join(kinds)}: bring it as [decks.NAME] to use them"] if kinds else []
    unused = [f"not used: {clause}" for clause in (*raw.unused, *lost, *deck_note)]
    return (
        body.mesh,
        body.node_sets,
        (*sources.order_notes(raw), *sources.conversion_notes(raw, {"the mesh": body}), *unused),
    )


@dataclass(frozen=True)
class Quality:
    """What a mesh is worth.

    scaled_jacobian : smallest over all elements and points; 1 is a box (or a regular tetrahedron), 0 is degenerate
    worst_element : the element where it is found
    volume : volume of the mesh [m3]"""

    scaled_jacobian: float
    worst_element: int
    volume: float


def quality(mesh: Any) -> Quality:
    """Measure a mesh at its nodes and quadrature points.

    mesh : skfem MeshHex2 or MeshTet2
    Raises Refusal: an element is inverted or degenerate somewhere
    Source  scaled Jacobian: Knupp, 2000; for tetrahedra normalised to 1 for the regular one"""
    points, weights = skfem.quadrature.get_quadrature(mesh.elem.refdom, 5)
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
        raise Refusal(
            f"{inverted} of {mesh.nelements} mesh elements are inverted or degenerate, the worst at ({centre}) "
            "in the unit of the mesh: choose another element size there or soften the shape"
        )
    volume = float((determinant[:, -len(weights) :] @ weights).sum())
    return Quality(scaled_jacobian=lowest, worst_element=int(element), volume=volume)


@dataclass(frozen=True)
class MeshFacts:
    """low, high : (3,) corners of the box around it [m]; volume [m3]; mass [kg], None without a density
    centre : (3,) of its mass, or of its volume without a density [m]
    scaled_jacobian, worst_centre : of the worst element, see geometry.mesh.quality; (3,) [m]"""

    low: np.ndarray
    high: np.ndarray
    volume: float
    centre: np.ndarray
    scaled_jacobian: float
    worst_centre: np.ndarray
    mass: float | None = None


def facts(mesh: Any, density: np.ndarray | None = None) -> MeshFacts:
    """Measure a mesh. mesh : skfem MeshHex2 or MeshTet2; density : (n_element,) [kg/m3]

    Raises  Refusal: an element is inverted or degenerate"""
    worst_quality = quality(mesh)
    X, w = skfem.quadrature.get_quadrature(mesh.elem.refdom, 5)
    mapping = mesh.mapping()
    weight = np.abs(mapping.detDF(X)) * w
    x = mapping.F(X)
    volume = float(weight.sum())
    worst = mesh.p[:, mesh.t[:, worst_quality.worst_element]].mean(axis=1)
    heavy = weight if density is None else weight * density[:, None]
    total = float(heavy.sum())
    centre = np.einsum("ieq,eq->i", x, heavy) / total
    mass = None if density is None else total
    points = mesh.doflocs
    return MeshFacts(points.min(axis=1), points.max(axis=1), volume, centre, worst_quality.scaled_jacobian, worst, mass)


def area(mesh: Any, facets: np.ndarray) -> float:
    """Area of some facets [m2]."""
    X, w = skfem.quadrature.get_quadrature(mesh.brefdom, 4)
    return float((np.abs(mesh.mapping().detDG(X, find=np.asarray(facets))) @ w).sum()) if len(facets) else 0.0
