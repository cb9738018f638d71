"""Contact of two faces whose meshes do not match: weighted relative displacements at points of the first face.

At point A with weight function phi_A the relative displacement is a weighted mean over the two faces,
x_A = (1 / a_A) integral of phi_A (u_1 - u_2), a_A = integral of phi_A > 0. The functions sum to one, so that a
constant pressure acts on both bodies as its consistent nodal forces. On a whole nine-node facet phi are its shape
functions, on a whole six-node one the linear functions of its sides: they keep the first and second moments of the
face. Where a facet is covered in part, or with vertices only, phi are the linear functions of its corners, which are
positive wherever it is cut.
Source  Puso and Laursen, Computer Methods in Applied Mechanics and Engineering 193, 2004"""

from collections.abc import Sequence

import numpy as np
import scipy
from scipy.sparse import coo_matrix, csr_matrix

from tribodyn.fem.interface import COMPONENTS, ContactInterface, checked_components, contact_frames
from tribodyn.fem.matching import Mismatch
from tribodyn.fem.mortar import MORTAR, Side, shared_surface
from tribodyn.fem.surface import NINE_NODE_QUADS, side_functions, side_polygons, tabulate


def mortar_halves(
    first_side: Side, second_side: Side, t1: Sequence[float] | None, components: Sequence[str], reach: float,
    vertices_only: bool = False,
) -> tuple[ContactInterface, csr_matrix]:  # fmt: skip
    """Both halves of a contact, as `ContactFaces.halves` gives them, with the gap of the geometry.

    t1, components, vertices_only : as of `ContactFaces`
    reach : farthest distance along the normal at which the faces still meet [m]
    Raises  Mismatch where they do not meet"""
    shared = shared_surface(first_side, second_side, reach)
    if not len(shared.weight):
        raise Mismatch(describe_separation(first_side, second_side, reach))
    n = first_side.corners
    is_full = (shared.covered >= MORTAR.full) & (not vertices_only)
    frames = contact_frames(shared.normal, t1)
    picked = [COMPONENTS.index(c) for c in checked_components(components)]

    carriers = _carriers(first_side, is_full)
    nodes = np.unique(np.concatenate(carriers))
    place = {int(node): at for at, node in enumerate(nodes)}
    area, gap = np.zeros((2, len(nodes)))
    directions, middle = np.zeros((len(nodes), 3, 3)), np.zeros((len(nodes), 3))
    first: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    second: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for i, j, g in shared.each():
        xi = shared.xi[:, g]
        phi = side_functions(xi) if len(carriers[i]) == 3 and is_full[i] else tabulate(len(carriers[i]), xi)[0]
        phi = phi * shared.weight[g]
        at = np.array([place[int(node)] for node in carriers[i]])
        np.add.at(area, at, phi.sum(axis=1))
        np.add.at(gap, at, phi @ shared.gap[g])
        np.add.at(middle, at, phi @ (tabulate(len(first_side.nodes[i]), xi)[0].T @ first_side.points[i]))
        np.add.at(directions, at, np.einsum("ag,gcx->acx", phi, frames[g]))
        for parts, facet, xi, frame in (
            (first, first_side.nodes[i], shared.xi[:, g], frames[g][:, picked]),
            (second, second_side.nodes[j], shared.eta[:, g], frames[g][:, picked] @ second_side.turn),
        ):
            N = tabulate(len(facet), xi)[0]
            rows = phi @ np.einsum("gcx,kg->gckx", frame, N).reshape(len(xi[0]), -1)
            lines = at[:, None, None, None] * len(picked) + np.arange(len(picked))[None, :, None, None]
            columns = facet[None, None, :, None] * 3 + np.arange(3)
            shape = (len(at), len(picked), len(facet), 3)
            parts.append((rows, np.broadcast_to(lines, shape).ravel(), np.broadcast_to(columns, shape).ravel()))

    carries = area > MORTAR.negligible * _least_area(first_side, carriers, nodes)
    area, gap, directions = area[carries], gap[carries] / area[carries], directions[carries]
    gap[np.abs(gap) < MORTAR.rounding * first_side.length] = 0.0
    n_dof = 3 * first_side.n_node
    B_1, B_2 = (_map(parts, carries, area, len(picked), n_dof) for parts in (first, second))
    position = np.cumsum(carries) - 1
    polygons = [
        facet[quad]
        for i, facet in enumerate(first_side.nodes)
        if shared.covered[i] > 0 and not (n == 3 and is_full[i])
        for quad in (NINE_NODE_QUADS if is_full[i] and len(facet) == 9 else [np.arange(n)])
    ]
    if n == 3 and is_full.any():
        polygons += list(side_polygons(first_side.nodes[is_full, :3], first_side.nodes[is_full, 3:]))
    at_points = np.array([[place[int(node)] for node in polygon] for polygon in polygons], dtype=int).reshape(-1, n)
    faces = position[at_points[carries[at_points].all(axis=1)]]
    all_nodes, first_place = np.unique(first_side.nodes.ravel(), return_index=True)
    points = first_side.points.reshape(-1, 3)[first_place[np.searchsorted(all_nodes, nodes[carries])]]
    # of a node whose facets are covered by less than half: the middle of what it carries, not beyond the second face
    at_edge = ~np.isin(nodes[carries], first_side.nodes[shared.covered > 0.5])
    points = np.where(at_edge[:, None], middle[carries] / area[:, None], points)
    interface = ContactInterface(
        components=tuple(components),
        points=points,
        frames=_mean_frames(directions),
        area=area,
        gap=gap,
        B=B_1,
        faces=faces,
    )
    return interface, B_2


def describe_separation(first_side: Side, second_side: Side, reach: float) -> str:
    """Why two sides do not meet, in a sentence."""
    distance, other = scipy.spatial.cKDTree(second_side.centre).query(first_side.centre)
    nearest = int(distance.argmin())
    facing = float(first_side.normal[nearest] @ second_side.normal[other[nearest]])
    if distance.min() <= reach + first_side.length and facing > 0:
        return "the two faces look the same way: give faces that look at each other"
    between = second_side.centre[other[nearest]] - first_side.centre[nearest]
    inside = float(between @ first_side.normal[nearest])
    lateral = float(np.linalg.norm(between - inside * first_side.normal[nearest]))
    facet = float(np.linalg.norm(first_side.points[nearest] - first_side.centre[nearest], axis=1).max())
    if facing < 0 and inside < -reach and lateral < facet:
        return (
            f"the bodies overlap: the second face lies about {-inside:.3g} m inside the first body, farther than the "
            f"{reach:.3g} m where opposite faces are searched for; move a body, or give reach"
        )
    return (
        f"the two faces do not meet: they are about {distance.min():.3g} m apart, farther than the "
        f"reach of {reach:.3g} m; move a body, or give reach"
    )


def _carriers(side: Side, is_full: np.ndarray) -> list[np.ndarray]:
    """The nodes of each facet that carry its pairs: of a whole one all nine or the three at sides, else its corners."""
    n = side.corners
    of_whole = slice(None) if n == 4 else slice(3, 6)
    return [nodes[of_whole] if full else nodes[:n] for nodes, full in zip(side.nodes, is_full.tolist(), strict=True)]


def _least_area(side: Side, carriers: list[np.ndarray], nodes: np.ndarray) -> np.ndarray:
    """Least area of each point if all its facets were covered, to within their distortion [m2]."""
    n = side.corners
    corner = side.points[:, :n]
    size = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, -1] - corner[:, 0]), axis=1)
    total = np.zeros(len(nodes))
    count = [len(of) for of in carriers]
    np.add.at(total, np.searchsorted(nodes, np.concatenate(carriers)), np.repeat(size / 36, count))
    return total


def _map(
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
    carries: np.ndarray,
    area: np.ndarray,
    n_comp: int,
    n_dof: int,
) -> csr_matrix:
    """Rows of the kept points over all DOFs, means over their areas."""
    values = np.concatenate([rows.ravel() for rows, _, _ in parts])
    lines, columns = (np.concatenate([item[k] for item in parts]) for k in (1, 2))
    full = csr_matrix(coo_matrix((values, (lines, columns)), shape=(len(carries) * n_comp, n_dof)))
    rows = csr_matrix(full[np.repeat(carries, n_comp)])
    rows.data /= np.repeat(np.repeat(area, n_comp), np.diff(rows.indptr))
    rows.data[np.abs(rows.data) < 1e-14] = 0.0  # rounding must not make a DOF a master
    rows.eliminate_zeros()
    return rows


def _mean_frames(directions: np.ndarray) -> np.ndarray:
    """Right-handed frames nearest to mean directions (n, 3, 3), the normal kept."""
    normal = directions[:, 2] / np.linalg.norm(directions[:, 2], axis=1, keepdims=True)
    first = directions[:, 0] - np.einsum("nx,nx->n", directions[:, 0], normal)[:, None] * normal
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normal, first), normal], axis=1)
