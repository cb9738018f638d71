"""Sets and surfaces of an Abaqus or CalculiX deck as groups of its mesh."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from tribodyn.geometry.sources.abaqus import (
    CARRIED,
    FACES,
    HEXAHEDRON_27,
    SOLIDS,
    DeckAssembly,
    Node,
    Scope,
    formulation,
    solid_node_count,
)
from tribodyn.geometry.sources.raw_mesh import NOTHING, VOLUMES, Cells, RawMesh
from tribodyn.refusal import Refusal


def raw_of(assembly: DeckAssembly) -> tuple[RawMesh, dict[Node, int], dict[Node, int]]:
    """Mesh, sets and surfaces of a deck, lengths as in the file, the row of each node and the number of each solid.

    Raises  Refusal: an element that names a node that is not there"""
    scopes = {**assembly.instances, "": assembly.top}
    row: dict[Node, int] = {}
    points: list[np.ndarray] = []
    for name, scope in scopes.items():
        turn, shift = assembly.moves.get(name, (np.eye(3), np.zeros(3)))
        if scope.nodes:
            start = len(row)
            row |= {(name, label): start + i for i, label in enumerate(scope.nodes)}
            points.append(np.array(list(scope.nodes.values())) @ turn.T + shift)
    number: dict[Node, int] = {}
    by_kind: dict[str, list[tuple[Node, list[int], str]]] = {}
    other: Counter[str] = Counter()
    for name, scope in scopes.items():
        for label, (kind, nodes) in scope.elements.items():
            count = solid_node_count(kind)
            if count is None:
                other[kind] += 1
                continue
            try:
                by_kind.setdefault(SOLIDS[count], []).append(
                    ((name, label), [row[name, node] for node in nodes[:count]], formulation(kind))
                )
            except KeyError as missing:
                raise Refusal(
                    f"element {label}{f' of {name}' if name else ''} names node {missing.args[0][1]}, which the deck "
                    "has not: the deck is cut off or nodes are missing"
                ) from None
    blocks = []
    for kind, elements in by_kind.items():
        number |= {key: len(number) + i for i, (key, *_) in enumerate(elements)}
        table = np.array([members for _, members, _ in elements])
        table = table[:, HEXAHEDRON_27] if kind == "hexahedron27" else table
        forms = [form for *_, form in elements] if kind == "hexahedron" else ()
        blocks.append(Cells(kind, table, np.array([key[1] for key, *_ in elements]), forms))
    if not blocks:
        return NOTHING, row, number
    refused = {
        kind: f"{count} elements of type {kind}" for kind, count in other.items() if not kind.startswith(CARRIED)
    }
    sets = _Sets(assembly, row, number, blocks)
    sets.collect(scopes)
    labels = np.array([label for _, label in row], dtype=int)
    everything = np.vstack(points) if points else np.empty((0, 3))
    raw = RawMesh(
        everything,
        labels,
        blocks,
        sets.volumes,
        sets.faces,
        sets.nodes,
        bodies=tuple(name for name in assembly.instances if name in sets.volumes),
        skins=frozenset(sets.nodes),
        unused=sets.unused,
        refused=refused,
    )
    return raw, row, number


@dataclass
class _Sets:
    """Sets and surfaces of all scopes, resolved to rows and element numbers."""

    assembly: DeckAssembly
    row: dict[Node, int]
    number: dict[Node, int]
    blocks: Sequence[Cells]
    volumes: dict[str, np.ndarray] = field(default_factory=dict)
    faces: dict[str, list[np.ndarray]] = field(default_factory=dict)
    nodes: dict[str, np.ndarray] = field(default_factory=dict)
    unused: list[str] = field(default_factory=list)

    def collect(self, scopes: dict[str, Scope]) -> None:
        """Resolve the sets of all scopes; a set of an instance is named "instance.set"."""
        for instance in self.assembly.instances:
            solids = [self.number[key] for key in self.number if key[0] == instance]
            if solids:
                self.volumes[instance] = np.array(solids)
        for instance, scope in scopes.items():
            before = f"{instance}." if instance else ""
            for key in scope.elsets:
                self._elset(before + scope.names[key], self._try(self.assembly.elements, key, instance, "element set"))
            for key in scope.nsets:
                self._nset(before + scope.names[key], self._try(self.assembly.nodes, key, instance, "node set"))
            for key, (kind, items) in sorted(scope.surfaces.items(), key=lambda surface: surface[1][0] == "UNION"):
                self._surface(before + scope.names[key], kind, items, instance)

    def _try(self, resolve: Callable[[str, str], list[Node]], key: str, instance: str, label: str) -> list[Node]:
        try:
            return list(resolve(key, instance))
        except KeyError as missing:
            self.unused.append(f"{label} '{key}', which names '{missing.args[0]}' that the deck has not")
            return []

    def _elset(self, name: str, members: Iterable[Node]) -> None:
        members = list(members)
        solid = [self.number[key] for key in members if key in self.number]
        if solid:
            self.volumes.setdefault(name, np.unique(solid))

    def _nset(self, name: str, members: list[Node]) -> None:
        rows = [self.row[key] for key in members if key in self.row]
        if len(rows) < len(members):
            self.unused.append(f"{len(members) - len(rows)} nodes of node set '{name}', which the deck has not")
        if rows:
            self.nodes.setdefault(name, np.unique(rows))

    def _surface(self, name: str, kind: str, items: list[tuple[str, str]], instance: str) -> None:
        if kind == "NODE":
            members = [node for item, _ in items for node in self._try(self.assembly.nodes, item, instance, "surface")]
            self._nset(name, members)
            if any(area not in ("", "1", "1.", "1.0") for _, area in items):
                self.unused.append(f"areas of nodes of surface '{name}', which a contact takes from its faces")
            return
        corners: list[np.ndarray] = []
        if kind == "UNION":
            before = f"{instance}." if instance else ""
            for item in (item for pair in items for item in pair if item):
                united = next((key for key in (*self.faces, *self.nodes) if key.upper() == (before + item).upper()), "")
                if united in self.faces:
                    corners += self.faces[united]
                elif united:
                    self.nodes[name] = np.union1d(self.nodes.get(name, self.nodes[united]), self.nodes[united])
                else:
                    self.unused.append(f"surface '{item}' of the union '{name}', which the deck has not")
            items = []
        for item, face in items:
            members = self._try(self.assembly.elements, item, instance, f"surface '{name}'")
            numbers = np.array([self.number[key] for key in members if key in self.number], dtype=int)
            if len(numbers):
                corners += self._faces(numbers, face, name)
        if corners:
            self.faces[name] = corners

    def _faces(self, numbers: np.ndarray, face: str, name: str) -> list[np.ndarray]:
        corners_of_faces = []
        for nodes, faces in chosen_elements(self.blocks, numbers):
            if face in ("", "SPOS"):
                corners_of_faces += [nodes[:, list(corners)] for corners in faces]
            elif face[0] == "S" and face[1:].isdigit() and 1 <= int(face[1:]) <= len(faces):
                corners_of_faces.append(nodes[:, list(faces[int(face[1:]) - 1])])
            else:
                self.unused.append(f"face {face} of {len(nodes)} elements of surface '{name}', which they have not")
        return free_faces(corners_of_faces, self.blocks) if face in ("", "SPOS") else corners_of_faces


def chosen_elements(
    blocks: Sequence[Cells], numbers: np.ndarray
) -> Iterator[tuple[np.ndarray, tuple[tuple[int, ...], ...]]]:
    """Nodes (k, n) of the elements of these numbers, block by block, and the corners of the faces of their kind."""
    start = 0
    for block in blocks:
        inside = numbers[(numbers >= start) & (numbers < start + len(block.nodes))] - start
        start += len(block.nodes)
        if len(inside):
            yield block.nodes[inside], FACES[VOLUMES[block.kind][0].corners]


def free_faces(parts: list[np.ndarray], blocks: Sequence[Cells]) -> list[np.ndarray]:
    """Those of some faces, corners (k, 3 or 4), that belong to one element of the mesh only."""
    counts: Counter[tuple[int, ...]] = Counter()
    for block in blocks:
        for corners in FACES[VOLUMES[block.kind][0].corners]:
            counts.update(map(tuple, np.sort(block.nodes[:, list(corners)], axis=1).tolist()))
    outer_parts = []
    for part in parts:
        outer = np.array([counts[tuple(key)] == 1 for key in np.sort(part, axis=1).tolist()], dtype=bool)
        if outer.any():
            outer_parts.append(part[outer])
    return outer_parts
