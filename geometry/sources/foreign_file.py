"""Any file that holds a mesh or a shape -> its bodies, in metres.

The kind of a file is recognised by its ending; each reader gives a `RawMesh`, and everything after that is common.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tribodyn.geometry.sources import cad, solid_body
from tribodyn.geometry.sources.deck import Deck, in_si
from tribodyn.geometry.sources.raw_mesh import COMMON_NAMES, VOLUMES, RawMesh
from tribodyn.geometry.sources.solid_body import SolidBody
from tribodyn.refusal import Refusal

# unit of length -> [m], and the force [N] that decks in it count in
UNITS = {
    "m": (1.0, 1.0), "cm": (1e-2, 1.0), "mm": (1e-3, 1.0), "um": (1e-6, 1.0),
    "in": (0.0254, 4.4482216152605), "ft": (0.3048, 4.4482216152605),
}  # fmt: skip
# ending -> the module of its reader, which is imported when a file is read
READERS = {
    ".msh": "msh",
    ".inp": "abaqus_cards",
    **dict.fromkeys((".bdf", ".nas", ".dat"), "nastran"),
    ".cdb": "ansys",
    **dict.fromkeys((".vtk", ".vtu", ".med"), "meshio_files"),
    **dict.fromkeys(cad.ENDINGS, "cad"),
    ".geo": "drawing",
}
ENDINGS = tuple(READERS)


@dataclass(frozen=True)
class Source:
    """What a file holds.

    bodies : name -> body; parts of the file that share no nodes, see `solid.bodies`
    deck : materials, ties, loads and supports that the file gives; empty for a mesh
    points : name -> (3,) reference points that belong to no element [m]
    notes : sentences on conversions of the file; order_notes : on elements of first order, raised to second order
    unused : clauses that name unused content
    refused : name -> clause; content that is not read but would change stiffness, mass, support or load
    counts : group of nodes -> body -> how many of its nodes the file lists there, before edge nodes were added
    """

    bodies: Mapping[str, SolidBody]
    deck: Deck
    points: Mapping[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    order_notes: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    counts: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    refused: Mapping[str, str] = field(default_factory=dict)


def read(path: str | Path, unit: str = "m", sizes: cad.Sizes | None = None) -> Source:
    """Read a mesh file, a deck or a CAD file as bodies.

    path : its ending determines the format; unit : of length in the file, "m", "mm", "in", ...
    sizes : of the elements of a CAD file, in its unit
    Raises  Refusal: one sentence that names the file and the cure
    """
    raw = read_raw(path, unit, sizes)
    parts = solid_body.bodies(raw)
    built = {name: solid_body.build(raw, elements) for name, elements in parts.items()}
    counts = {
        group: {name: int((body.node_of[rows] >= 0).sum()) for name, body in built.items()}
        for group, rows in raw.nodes.items()
    }
    unused = (*raw.unused, *missing_groups(raw, built))
    remarks = conversion_notes(raw, built), order_notes(raw)
    return Source(built, raw.deck, raw.points_of_reference, *remarks, unused, counts, raw.refused)


def read_raw(path: str | Path, unit: str = "m", sizes: cad.Sizes | None = None) -> RawMesh:
    """The mesh of a file, lengths in metres. Raises Refusal as `read` does."""
    file = Path(path)
    if unit not in UNITS:
        raise Refusal(f"unit = \"{unit}\" of mesh file '{path}' is no length that is known: give {', '.join(UNITS)}")
    if not file.is_file():
        raise Refusal(f"mesh file '{path}' does not exist: build the part first or correct the path")
    ending = file.suffix.lower()
    if ending not in READERS:
        raise Refusal(
            f"mesh file '{path}' cannot be read, its ending is none of {', '.join(sorted(READERS))}: "
            "write it as a Gmsh file, MSH 4.1"
        )
    if sizes is not None and ending not in cad.ENDINGS:
        raise Refusal(f"mesh file '{path}' is meshed already: element sizes are for CAD files")
    try:
        raw = _reader(ending)(file) if sizes is None else cad.read(file, sizes)
    except (IndexError, KeyError) as problem:
        where = f"near {problem.args[0]!r}" if isinstance(problem, KeyError) else "in the middle of a line"
        raise Refusal(f"mesh file '{path}' cannot be read {where}: it is cut off or broken, write it again") from None
    if not raw.cells:
        raise Refusal(f"mesh file '{path}' has no volume elements: mesh the volume, a surface alone has no mass")
    return in_metres(raw, *UNITS[unit])


def _reader(ending: str) -> Callable[[Path], RawMesh]:
    """The function that reads files of an ending; `read` of its module."""
    module = importlib.import_module(f"tribodyn.geometry.sources.{READERS[ending]}")
    function: Callable[[Path], RawMesh] = module.read
    return function


def in_metres(raw: RawMesh, metre: float, newton: float = 1.0) -> RawMesh:
    """A mesh and its deck in SI units where the file counts in a unit of so many metres and one of so many newton."""
    if metre == 1.0:
        return raw
    points = {name: metre * point for name, point in raw.points_of_reference.items()}
    scaled_deck = in_si(raw.deck, metre, newton)
    return replace(raw, points=metre * raw.points, points_of_reference=points, deck=scaled_deck)


def missing_groups(raw: RawMesh, built: Mapping[str, SolidBody]) -> tuple[str, ...]:
    """A clause for each group of the file that no body has."""
    clauses = []
    for name in raw.faces:
        if any(name in body.unmatched for body in built.values()):
            clauses.append(f"surface group '{name}', which is not made of faces of the volume mesh: mesh both together")
        elif not any(name in (body.mesh.boundaries or {}) for body in built.values()):
            clauses.append(f"surface group '{name}', which has no face on the volume mesh: mesh both together")
    for name, rows in raw.nodes.items():
        outside = int(np.logical_and.reduce([body.node_of[rows] < 0 for body in built.values()]).sum())
        if outside and name not in raw.points_of_reference:
            clauses.append(
                f"{outside} of {len(rows)} nodes of group '{name}', which are nodes outside the volume mesh: "
                "embed its points in a volume"
            )
    return tuple(clauses)


def order_notes(raw: RawMesh) -> tuple[str, ...]:
    """The sentence on elements of first order, where there are some."""
    low = [cells for cells in raw.cells if not VOLUMES[cells.kind][1]]
    count = sum(len(cells.nodes) for cells in low)
    names = " and ".join(sorted({COMMON_NAMES[cells.kind] for cells in low}))
    return (f"{count} {names} of first order are computed as second order, with straight edges",) if low else ()


def conversion_notes(raw: RawMesh, built: Mapping[str, SolidBody]) -> tuple[str, ...]:
    """Sentences on the conversion of a file into bodies."""
    notes = list(raw.notes)
    for name, body in built.items():
        if body.cut:
            notes.append(f"the elements of {name} were cut into {body.mesh.nelements} tetrahedra, as their kinds mix")
    return tuple(notes)
