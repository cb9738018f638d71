"""Select faces of a body by rule: within a box, nearest to a point, by their normal, by their numbers in a CAD file.

Only facets of the boundary are selected."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tribodyn.refusal import Refusal

SMOOTH = np.cos(np.radians(30.0))  # facets that meet at less belong to one face


@dataclass(frozen=True)
class FacetRule:
    """Which facets of the boundary belong to a face: those that satisfy all that is given.

    box : two corners [m], within which all corners of a facet lie; nearest : (3,) point [m] whose nearest smooth face
    is taken; normal : (3,) along which the facets look to `within` [rad]; numbers : of faces of a CAD file"""

    box: tuple[Sequence[float], Sequence[float]] | None = None
    nearest: Sequence[float] | None = None
    normal: Sequence[float] | None = None
    within: float = float(np.radians(5.0))
    numbers: Sequence[int] = ()


def outline(mesh: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Boundary facets (k,), their centres (k, 3) [m] and outward unit normals (k, 3)."""
    facets = np.flatnonzero(mesh.f2t[1] < 0)
    corners = mesh.p[:, mesh.facets[:, facets]]
    centre = corners.mean(axis=1)
    last = corners.shape[1] - 1
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, last] - corners[:, 0], axis=0)
    body = mesh.p[:, mesh.t[:, mesh.f2t[0, facets]]].mean(axis=1)
    normal *= np.sign((normal * (centre - body)).sum(axis=0))
    return facets, centre.T, (normal / np.linalg.norm(normal, axis=0)).T


def select_facets(mesh: Any, rule: FacetRule) -> np.ndarray:
    """Facets that satisfy a rule; raises Refusal where none does, or where the rule is empty."""
    selections = []
    if rule.box is not None:
        selections.append(within_box(mesh, *rule.box))
    if rule.normal is not None:
        selections.append(by_normal(mesh, rule.normal, float(np.degrees(rule.within))))
    if len(rule.numbers):
        selections.append(by_number(mesh, rule.numbers))
    if rule.nearest is not None:
        selections.append(nearest(mesh, rule.nearest, *selections))
    if not selections:
        raise Refusal("a face needs a rule: give box, nearest, normal or cad")
    common = selections[0]
    for other in selections[1:]:
        common = np.intersect1d(common, other)
    return _require_facets(common, mesh, "satisfies all its rules together")


def add_faces(
    mesh: Any, node_sets: Mapping[str, np.ndarray], rules: Mapping[str, FacetRule]
) -> tuple[Any, dict[str, np.ndarray]]:
    """The mesh and its node sets with a face for each rule.

    Raises  Refusal, naming the face, where it picks nothing or has the name of a group that is there"""
    boundaries, sets = dict(mesh.boundaries or {}), dict(node_sets)
    for name, rule in rules.items():
        if name in sets or name in boundaries:
            raise Refusal(f"faces.{name} has the name of a group of the mesh: give it another")
        try:
            boundaries[name] = select_facets(mesh, rule)
        except Refusal as trouble:
            raise Refusal(f"faces.{name}: {trouble}") from None
        sets[name] = np.unique(mesh.dofs.get_facet_dofs(boundaries[name]).flatten())
    return (mesh.with_boundaries(boundaries), sets) if rules else (mesh, sets)


def within_box(mesh: Any, low: Sequence[float], high: Sequence[float]) -> np.ndarray:
    """Boundary facets whose corners all lie in a box [m]; raises Refusal where there are none."""
    facets, _, _ = outline(mesh)
    corners = mesh.p[:, mesh.facets[:, facets]]
    slack = 1e-6 * float(np.ptp(mesh.p, axis=1).max())
    inside = (corners >= np.reshape(low, (3, 1, 1)) - slack) & (corners <= np.reshape(high, (3, 1, 1)) + slack)
    return _require_facets(
        facets[inside.all(axis=(0, 1))], mesh, f"lies within the box {_place(low)} to {_place(high)} m"
    )


def by_normal(mesh: Any, direction: Sequence[float], degrees: float) -> np.ndarray:
    """Boundary facets whose outward normal points along a direction to within an angle; raises Refusal likewise."""
    facets, _, normal = outline(mesh)
    axis = np.asarray(direction, dtype=float)
    if axis.shape != (3,) or not axis.any():
        raise Refusal(f"a normal must be three numbers that are not all zero, got {list(direction)}")
    is_parallel = normal @ (axis / np.linalg.norm(axis)) >= np.cos(np.radians(degrees))
    return _require_facets(facets[is_parallel], mesh, f"faces {_place(axis.tolist())} to within {degrees:g} degrees")


def by_number(mesh: Any, numbers: Sequence[int]) -> np.ndarray:
    """Facets of faces of a CAD file by their numbers; raises Refusal for one that the body has not."""
    boundaries = mesh.boundaries or {}
    face_groups = [name for name in boundaries if name.startswith("face ")]
    for number in numbers:
        if f"face {number}" not in face_groups:
            listed = ", ".join(name.partition(" ")[2] for name in face_groups)
            raise Refusal(f"the body has no face {number} of a CAD file: it has {listed or 'none, being a mesh'}")
    return np.unique(np.concatenate([boundaries[f"face {number}"] for number in numbers]))


def nearest(mesh: Any, point: Sequence[float], *among: np.ndarray) -> np.ndarray:
    """The smooth face nearest to a point [m]: its nearest facet and all that go on from it without an edge.

    among : sets of facets that the nearest one belongs to"""
    facets, _, normal = outline(mesh)
    edges = mesh.f2e[:, facets]
    owner: dict[int, list[int]] = {}
    for i, edges_of_facet in enumerate(edges.T.tolist()):
        for edge in edges_of_facet:
            owner.setdefault(edge, []).append(i)
    distance = _distance(mesh.p[:, mesh.facets[:, facets]], np.asarray(point, dtype=float))
    for allowed in among:
        distance[~np.isin(facets, allowed)] = np.inf
    start = int(distance.argmin())
    smooth_face, queue = {start}, [start]
    while queue:
        i = queue.pop()
        for edge in edges[:, i].tolist():
            for j in owner[edge]:
                if j not in smooth_face and normal[i] @ normal[j] >= SMOOTH:
                    smooth_face.add(j)
                    queue.append(j)
    return np.asarray(np.sort(facets[sorted(smooth_face)]))


def _distance(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Distance (k,) of a point to polygons with corners (3, 3 or 4, k), seen as flat triangles."""
    p = corners - point[:, None, None]
    best = np.full(p.shape[2], np.inf)
    for j in range(1, p.shape[1] - 1):
        a, b, c = p[:, 0], p[:, j], p[:, j + 1]
        normal = np.cross(b - a, c - a, axis=0)
        size = (normal**2).sum(axis=0)
        inside = np.ones(len(best), dtype=bool)
        for start, end in ((a, b), (b, c), (c, a)):
            inside &= (np.cross(start, end, axis=0) * normal).sum(axis=0) >= 0
            edge = end - start
            part = np.clip(-(start * edge).sum(axis=0) / (edge**2).sum(axis=0), 0, 1)
            best = np.minimum(best, np.linalg.norm(start + part * edge, axis=0))
        height = np.abs((a * normal).sum(axis=0)) / np.sqrt(size)
        best = np.where(inside, np.minimum(best, height), best)
    return best


def _place(point: Sequence[float]) -> str:
    return f"({', '.join(f'{float(c):.4g}' for c in point)})"


def _require_facets(facets: np.ndarray, mesh: Any, condition: str) -> np.ndarray:
    if not len(facets):
        low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
        extent = " to ".join(_place(corner) for corner in (low, high))
        raise Refusal(f"no face of the boundary {condition}: the body reaches from {extent} m")
    return facets
