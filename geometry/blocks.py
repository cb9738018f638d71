"""Bodies of 27-node hexahedra from boxes of cells that are mapped into space.

A block is a graded box in (u, v, w) with a mapping into space; blocks of a body that meet node to node are joined.
Elements, sides and points are named, and the result is written by Gmsh with those names as physical groups.
Positions along an edge are graded towards one end or both."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import scipy
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tribodyn.geometry.gmsh_session import save, session
from tribodyn.geometry.numbering import REFERENCE_POINTS, permutation
from tribodyn.refusal import Refusal

SIDES = ("u-", "u+", "v-", "v+", "w-", "w+")
_JOIN = 1e-3  # nodes nearer than this fraction of the smallest node distance are one node


@dataclass(frozen=True)
class Block:
    """A box of cells.

    u, v, w : vertex positions along the three axes, each increasing; second-order nodes lie half-way between them
    volume : name of the physical volume the cells belong to
    sides : which of SIDES are named, side -> name of the physical surface
    mapping : (n, 3) positions in (u, v, w) -> (n, 3) positions in space [m]; None leaves them"""

    u: np.ndarray
    v: np.ndarray
    w: np.ndarray
    volume: str
    sides: Mapping[str, str] = field(default_factory=dict)
    mapping: Callable[[np.ndarray], np.ndarray] | None = None


@dataclass(frozen=True)
class JoinedBlocks:
    """Joined cells with their names; node numbers count within the body.

    nodes : (n, 3) [m]
    cells : (m, 27) in the order of meshio
    volumes : name -> cell numbers
    surfaces : name -> (k, 9) nodes of its faces
    points : name -> node numbers"""

    nodes: np.ndarray
    cells: np.ndarray
    volumes: Mapping[str, np.ndarray]
    surfaces: Mapping[str, np.ndarray]
    points: Mapping[str, np.ndarray]


def body(blocks: Sequence[Block], points: Mapping[str, Sequence[float] | np.ndarray] | None = None) -> JoinedBlocks:
    """Join blocks where their nodes coincide, and name nodes by their place.

    points : name -> position (3,) or positions (k, 3) of nodes [m]
    Raises Refusal: the blocks do not meet, a mapping folds cells, or no node lies at a named point"""
    nodes: list[np.ndarray] = []
    cells: list[np.ndarray] = []
    cell_volumes: list[str] = []
    faces: dict[str, list[np.ndarray]] = {}
    n_node = 0
    for block in blocks:
        positions, numbers = _lattice(block)
        numbers = numbers + n_node
        n_node += len(positions)
        nodes.append(positions)
        cells.append(_cells(positions, numbers, n_node - len(positions)))
        cell_volumes += [block.volume] * len(cells[-1])
        for side, name in block.sides.items():
            faces.setdefault(name, []).append(_faces(numbers, side))

    all_nodes, all_cells = np.vstack(nodes), np.vstack(cells)
    corners = all_nodes[all_cells[:, :8]]
    spacing = float(np.linalg.norm(corners[:, [1, 3, 4]] - corners[:, :1], axis=2).min() / 2)  # the smallest
    node_of, joined = _join(all_nodes, _JOIN * spacing)
    all_cells = node_of[all_cells]
    _check_cells(all_cells, len(joined))
    names = np.array(cell_volumes)
    return JoinedBlocks(
        nodes=joined,
        cells=all_cells,
        volumes={str(name): np.flatnonzero(names == name) for name in np.unique(names)},
        surfaces={name: node_of[np.vstack(parts)] for name, parts in faces.items()},
        points={name: _nodes_at(joined, at, name, _JOIN * spacing) for name, at in (points or {}).items()},
    )


def write(path: str | Path, *bodies: JoinedBlocks) -> None:
    """Write bodies, which stay apart even where they touch, as one second-order Gmsh mesh.

    path : the .msh file. Equal names in several bodies make one physical group
    Raises Refusal: one name is used for groups of different dimension"""
    starts = np.cumsum([0] + [len(b.nodes) for b in bodies])
    cells = np.vstack([b.cells + start for b, start in zip(bodies, starts, strict=False)])
    cell_starts = np.cumsum([0] + [len(b.cells) for b in bodies])
    volumes = _union([(b.volumes, start) for b, start in zip(bodies, cell_starts, strict=False)])
    surfaces = _union([(b.surfaces, start) for b, start in zip(bodies, starts, strict=False)])
    points = _union([(b.points, start) for b, start in zip(bodies, starts, strict=False)])
    names = [*volumes, *surfaces, *points]
    if len(set(names)) < len(names):
        twice = sorted({name for name in names if names.count(name) > 1})
        raise Refusal(f"{', '.join(twice)} names groups of different dimension: choose different names")

    with session() as gmsh:
        mesh = gmsh.model.mesh
        hexahedron = mesh.getElementType("Hexahedron", 2)
        local = np.array(mesh.getElementProperties(hexahedron)[4]).reshape(-1, 3)
        cells = cells[:, permutation(REFERENCE_POINTS["hexahedron27"], (local + 1) / 2)]
        coordinates = np.vstack([b.nodes for b in bodies])
        first_volume = True
        groups = (
            (3, hexahedron, {name: cells[ids] for name, ids in volumes.items()}),
            (2, mesh.getElementType("Quadrangle", 2), surfaces),
            (0, mesh.getElementType("Point", 1), points),
        )
        for dimension, element, members in groups:
            for name, connectivity in members.items():
                entity = gmsh.model.addDiscreteEntity(dimension)
                if first_volume:
                    mesh.addNodes(3, entity, np.arange(1, len(coordinates) + 1), coordinates.ravel())
                    first_volume = False
                mesh.addElementsByType(entity, element, [], connectivity.ravel() + 1)
                gmsh.model.addPhysicalGroup(dimension, [entity], name=name)
        save(gmsh, path)


def _lattice(block: Block) -> tuple[np.ndarray, np.ndarray]:
    """Node positions (n, 3) of a block and their numbers on the lattice of second-order nodes."""
    lines = []
    for axis, vertices in (("u", block.u), ("v", block.v), ("w", block.w)):
        vertices = np.asarray(vertices, dtype=float)
        if vertices.ndim != 1 or len(vertices) < 2 or (np.diff(vertices) <= 0).any():
            raise Refusal(f"{axis} of a block in '{block.volume}' does not increase: give positions in order")
        line = np.empty(2 * len(vertices) - 1)
        line[::2] = vertices
        line[1::2] = (vertices[1:] + vertices[:-1]) / 2
        lines.append(line)
    reference = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    positions = reference.reshape(-1, 3)
    if block.mapping is not None:
        positions = block.mapping(positions)
    return positions, np.arange(len(positions)).reshape(reference.shape[:3])


def _cells(positions: np.ndarray, numbers: np.ndarray, offset: int) -> np.ndarray:
    """Connectivity (m, 27); a mapping that mirrors is undone by reversing u."""
    u, v, w = ((n - 1) // 2 for n in numbers.shape)

    def connect(local: np.ndarray) -> np.ndarray:
        steps = (2 * local).astype(int)
        return np.stack(
            [numbers[a : a + 2 * u - 1 : 2, b : b + 2 * v - 1 : 2, c : c + 2 * w - 1 : 2].ravel() for a, b, c in steps],
            axis=1,
        )

    local = REFERENCE_POINTS["hexahedron27"]
    cells = connect(local)
    origin, a, b, c = positions[cells[:, [0, 1, 3, 4]] - offset].transpose(1, 0, 2)
    handed = np.einsum("ij,ij->i", np.cross(a - origin, b - origin), c - origin)
    if (handed < 0).all():
        cells = connect(np.column_stack([1 - local[:, 0], local[:, 1:]]))
    return cells


def _faces(numbers: np.ndarray, side: str) -> np.ndarray:
    """Nine-node faces (k, 9) on one side of the lattice."""
    if side not in SIDES:
        raise Refusal(f"a block has no side '{side}': the sides are {', '.join(SIDES)}")
    plane = np.take(numbers, 0 if side[1] == "-" else -1, axis="uvw".index(side[0]))
    m, n = ((k - 1) // 2 for k in plane.shape)
    steps = (2 * REFERENCE_POINTS["quad9"]).astype(int)
    return np.stack([plane[a : a + 2 * m - 1 : 2, b : b + 2 * n - 1 : 2].ravel() for a, b in steps], axis=1)


def _join(nodes: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Number coincident nodes once; returns the new number of each old node, and the nodes kept."""
    pairs = scipy.spatial.cKDTree(nodes).query_pairs(tolerance, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(nodes), len(nodes)))
    _, label = connected_components(graph, directed=False)
    _, first, node_of = np.unique(label, return_index=True, return_inverse=True)
    return node_of, nodes[first]


def _check_cells(cells: np.ndarray, n_node: int) -> None:
    ordered = np.sort(cells, axis=1)
    if (ordered[:, 1:] == ordered[:, :-1]).any():
        raise Refusal("a block's mapping collapses cells: keep its positions apart")
    rows = np.repeat(cells[:, 0], 26)
    graph = coo_array((np.ones(len(rows)), (rows, cells[:, 1:].ravel())), shape=(n_node, n_node))
    n_part, _ = connected_components(graph, directed=False)
    if n_part > 1:
        raise Refusal(f"the blocks of one body fall into {n_part} pieces: let their grids meet node to node")


def _nodes_at(nodes: np.ndarray, positions: Sequence[float] | np.ndarray, name: str, tolerance: float) -> np.ndarray:
    distance, numbers = scipy.spatial.cKDTree(nodes).query(np.atleast_2d(np.asarray(positions, dtype=float)))
    if distance.max() > tolerance:
        at = ", ".join(f"{x:.6g}" for x in np.atleast_2d(positions)[distance.argmax()])
        raise Refusal(f"no mesh node lies at point '{name}' ({at}) m: place a grid line there")
    return numbers


def _union(groups: Sequence[tuple[Mapping[str, np.ndarray], int]]) -> dict[str, np.ndarray]:
    names = dict.fromkeys(name for members, _ in groups for name in members)
    return {name: np.concatenate([m[name] + start for m, start in groups if name in m]) for name in names}


def towards_ends(start: float, end: float, n_elements: int, grading: float = 1.0) -> np.ndarray:
    """Split a line symmetrically, element lengths in geometric progression from both ends to the middle.

    grading : length of a middle element over that of an end element; above 1 is finer towards the ends
    Returns (n_elements + 1,) increasing positions [m], first and last exactly start and end"""
    from_end = np.minimum(np.arange(n_elements), np.arange(n_elements)[::-1])
    return _positions(start, end, grading ** (from_end / max(from_end.max(), 1)))


def towards_start(start: float, end: float, n_elements: int, grading: float = 1.0) -> np.ndarray:
    """Split a line, element lengths in geometric progression.

    grading : length of the last element over that of the first; above 1 is finer towards the start
    Returns (n_elements + 1,) increasing positions [m], first and last exactly start and end"""
    return _positions(start, end, grading ** (np.arange(n_elements) / max(n_elements - 1, 1)))


def towards_end(start: float, end: float, n_elements: int, grading: float = 1.0) -> np.ndarray:
    """Mirror image of `towards_start`: grading is the length of the first element over that of the last."""
    return towards_start(start, end, n_elements, 1.0 / grading)


def _positions(start: float, end: float, lengths: np.ndarray) -> np.ndarray:
    fraction = np.concatenate([[0.0], np.cumsum(lengths) / lengths.sum()])
    positions = start + (end - start) * fraction
    positions[-1] = end
    return positions
