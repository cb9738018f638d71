"""Contact of two faces whose meshes do not match: weighted relative displacements at points of the first face.

At point A with weight function phi_A the relative displacement is the mean of that of the two faces,
x_A = (1 / a_A) integral of phi_A (u_1 - u_2), a_A = integral of phi_A > 0. The functions sum to one, so that a
constant pressure acts on both bodies as its consistent nodal forces. On a whole nine-node facet phi are its shape
functions, on a whole six-node one the linear functions of its sides: they keep the first and second moments of the
face. Where a facet is covered in part, or with vertices only, phi are the linear functions of its corners, which are
positive wherever it is cut.
Source  Puso and Laursen, Computer Methods in Applied Mechanics and Engineering 193, 2004
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from scipy.sparse import coo_matrix, csr_matrix

from tribodyn.fem.interface import COMPONENTS, ContactInterface, checked_components, contact_frames
from tribodyn.fem.matching import Mismatch
from tribodyn.fem.mortar import MORTAR, Side, shared_surface
from tribodyn.fem.surface import NINE_NODE_QUADS, side_functions, side_polygons, tabulate


def mortar_halves(
    one: Side,
    two: Side,
    t1: Sequence[float] | None,
    components: Sequence[str],
    reach: float,
    vertices_only: bool = False,
) -> tuple[ContactInterface, csr_matrix]:
    """Both halves of a contact, as `ContactFaces.halves` gives them, with the gap of the geometry.

    t1, components, vertices_only : as of `ContactFaces`
    reach : farthest distance along the normal at which the faces still meet [m]
    Raises  Mismatch where they do not meet
    """
    shared = shared_surface(one, two, reach)
    if not len(shared.weight):
        raise Mismatch(describe_separation(one, two, reach))
    n = one.corners
    whole = (shared.covered >= MORTAR.whole) & (not vertices_only)
    frames = contact_frames(shared.normal, t1)
    picked = [COMPONENTS.index(c) for c in checked_components(components)]

    carriers = _carriers(one, whole)
    nodes = np.unique(np.concatenate(carriers))
    place = {int(node): at for at, node in enumerate(nodes)}
    area, gap = np.zeros((2, len(nodes)))
    directions = np.zeros((len(nodes), 3, 3))
    first: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    second: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for i, j, g in shared.each():
        xi = shared.xi[:, g]
        phi = side_functions(xi) if len(carriers[i]) == 3 and whole[i] else tabulate(len(carriers[i]), xi)[0]
        phi = phi * shared.weight[g]
        at = np.array([place[int(node)] for node in carriers[i]])
        np.add.at(area, at, phi.sum(axis=1))
        np.add.at(gap, at, phi @ shared.gap[g])
        np.add.at(directions, at, np.einsum("ag,gcx->acx", phi, frames[g]))
        for found, of, xi, frame in (
            (first, one.nodes[i], shared.xi[:, g], frames[g][:, picked]),
            (second, two.nodes[j], shared.eta[:, g], frames[g][:, picked] @ two.turn),
        ):
            N = tabulate(len(of), xi)[0]
            rows = phi @ np.einsum("gcx,kg->gckx", frame, N).reshape(len(xi[0]), -1)
            lines = at[:, None, None, None] * len(picked) + np.arange(len(picked))[None, :, None, None]
            columns = of[None, None, :, None] * 3 + np.arange(3)
            shape = (len(at), len(picked), len(of), 3)
            found.append((rows, np.broadcast_to(lines, shape).ravel(), np.broadcast_to(columns, shape).ravel()))

    kept = area > MORTAR.few * _own_area(one, carriers, nodes)
    area, gap, directions = area[kept], gap[kept] / area[kept], directions[kept]
    gap[np.abs(gap) < MORTAR.rounding * one.length] = 0.0
    n_dof = 3 * one.n_node
    B_1, B_2 = (_map(found, kept, area, len(picked), n_dof) for found in (first, second))
    new = np.cumsum(kept) - 1
    polygons = [
        of[quad]
        for i, of in enumerate(one.nodes)
        if shared.covered[i] > 0 and not (n == 3 and whole[i])
        for quad in (NINE_NODE_QUADS if whole[i] and len(of) == 9 else [np.arange(n)])
    ]
    if n == 3 and whole.any():
        polygons += list(side_polygons(one.nodes[whole, :3], one.nodes[whole, 3:]))
    at_points = np.array([[place[int(node)] for node in polygon] for polygon in polygons], dtype=int).reshape(-1, n)
    faces = new[at_points[kept[at_points].all(axis=1)]]
    every, first_place = np.unique(one.nodes.ravel(), return_index=True)
    interface = ContactInterface(
        components=tuple(components),
        points=one.points.reshape(-1, 3)[first_place[np.searchsorted(every, nodes[kept])]],
        frames=_mean_frames(directions),
        area=area,
        gap=gap,
        B=B_1,
        faces=faces,
    )
    return interface, B_2


def describe_separation(one: Side, two: Side, reach: float) -> str:
    """Why two sides do not meet, in a sentence."""
    distance, other = scipy.spatial.cKDTree(two.centre).query(one.centre)
    nearest = int(distance.argmin())
    facing = float(one.normal[nearest] @ two.normal[other[nearest]])
    if distance.min() <= reach + one.length and facing > 0:
        return "the two faces look the same way: give faces that look at each other"
    between = two.centre[other[nearest]] - one.centre[nearest]
    inside = float(between @ one.normal[nearest])
    beside = float(np.linalg.norm(between - inside * one.normal[nearest]))
    facet = float(np.linalg.norm(one.points[nearest] - one.centre[nearest], axis=1).max())
    if facing < 0 and inside < -reach and beside < facet:
        return (
            f"the bodies overlap: the second face lies about {-inside:.3g} m inside the first body, farther than the "
            f"{reach:.3g} m where faces are looked for; move a body, or give reach"
        )
    return (
        f"the two faces do not meet: they are about {distance.min():.3g} m apart, farther than the "
        f"reach of {reach:.3g} m; move a body, or give reach"
    )


def _carriers(one: Side, whole: np.ndarray) -> list[np.ndarray]:
    """The nodes of each facet that carry its pairs: of a whole one all nine or the three at sides, else its corners."""
    n = one.corners
    of_whole = slice(None) if n == 4 else slice(3, 6)
    return [nodes[of_whole] if full else nodes[:n] for nodes, full in zip(one.nodes, whole.tolist(), strict=True)]


def _own_area(one: Side, carriers: list[np.ndarray], nodes: np.ndarray) -> np.ndarray:
    """Least area of each point if all its facets were covered, to within their distortion [m2]."""
    n = one.corners
    corner = one.points[:, :n]
    size = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, -1] - corner[:, 0]), axis=1)
    total = np.zeros(len(nodes))
    count = [len(of) for of in carriers]
    np.add.at(total, np.searchsorted(nodes, np.concatenate(carriers)), np.repeat(size / 36, count))
    return total


def _map(
    found: list[tuple[np.ndarray, np.ndarray, np.ndarray]], kept: np.ndarray, area: np.ndarray, n_comp: int, n_dof: int
) -> csr_matrix:
    """Rows of the kept points over all DOFs, means over their areas."""
    values = np.concatenate([rows.ravel() for rows, _, _ in found])
    lines, columns = (np.concatenate([item[k] for item in found]) for k in (1, 2))
    full = csr_matrix(coo_matrix((values, (lines, columns)), shape=(len(kept) * n_comp, n_dof)))
    rows = csr_matrix(full[np.repeat(kept, n_comp)])
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
