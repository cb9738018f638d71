"""Any file that holds a mesh or a shape -> its bodies, in metres.

The kind of a file is recognised by its ending, an ANSYS archive under .dat or .inp by its commands; each reader gives a
`RawMesh`, and everything after that is common."""

import importlib
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from tribodyn import text_file
from tribodyn.consent import require_consent
from tribodyn.geometry.sources import cad, foreign_process, solid_body
from tribodyn.geometry.sources.deck import Deck, in_si
from tribodyn.geometry.sources.raw_mesh import COMMON_NAMES, VOLUMES, Cells, RawMesh
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
FOREIGN = ("msh", "meshio_files", "cad", "drawing")  # modules that call parsers of other projects, in a child process
ENDINGS = tuple(READERS)
DISPLACED = "supports with a displacement"
APDL = re.compile(r"(?im)^\s*(/(batch|prep7|com|nopr|title|units)\b|(nblock|eblock|et),)")  # what ANSYS writes


@dataclass(frozen=True)
class Source:
    """What a file holds.

    bodies : name -> body; parts of the file that share no nodes, see `solid.bodies`
    deck : materials, ties, loads and supports that the file gives; empty for a mesh
    points : name -> (3,) reference points that belong to no element [m]
    notes : sentences on conversions of the file; order_notes : on elements of first order, raised to second order
    unused : clauses that name unused content
    refused : name -> clause; content that is not read but would change stiffness, mass, support or load
    formulations : body of 8-node hexahedra whose file names it -> how it computes them, see `fem.elasticity`
    counts : group of nodes -> body -> how many of its nodes the file lists there, before edge nodes were added"""

    bodies: Mapping[str, SolidBody]
    deck: Deck
    points: Mapping[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    order_notes: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    counts: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    refused: Mapping[str, str] = field(default_factory=dict)
    formulations: Mapping[str, str] = field(default_factory=dict)


def read(path: str | Path, unit: str = "m", sizes: cad.Sizes | None = None) -> Source:
    """Read a mesh file, a deck or a CAD file as bodies.

    path : its ending determines the format; unit : of length in the file, "m", "mm", "in", ...
    sizes : of the elements of a CAD file, in its unit
    Raises  Refusal: one sentence that names the file and the cure"""
    raw = read_raw(path, unit, sizes)
    parts = solid_body.bodies(raw)
    built = {name: solid_body.build(raw, elements) for name, elements in parts.items()}
    counts = {
        group: {name: int((body.node_of[rows] >= 0).sum()) for name, body in built.items()}
        for group, rows in raw.nodes.items()
    }
    unused = (*raw.unused, *missing_groups(raw, built))
    forms, mixed = formulations(raw, parts)
    remarks = (*conversion_notes(raw, built), *mixed), order_notes(raw)
    refused = dict(raw.refused)
    if displaced := sum(support.value != 0 for support in raw.deck.supports):
        refused[DISPLACED] = f"{displaced} of its {DISPLACED}, which a scene gives as [prescribed.NAME]"
    return Source(built, raw.deck, raw.points_of_reference, *remarks, unused, counts, refused, forms)


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
        is_archive = ending in (".dat", ".inp") and APDL.search(text_file.open_text(file).read(10_000))
        raw = _raw(file, "ansys" if is_archive else READERS[ending], sizes)
    except (IndexError, KeyError) as problem:
        where = f"near {problem.args[0]!r}" if isinstance(problem, KeyError) else "in the middle of a line"
        raise Refusal(f"mesh file '{path}' cannot be read {where}: it is cut off or broken, write it again") from None
    if not raw.cells:
        raise Refusal(f"mesh file '{path}' has no volume elements: mesh the volume, a surface alone has no mass")
    used = np.concatenate([block.nodes.ravel() for block in raw.cells])
    if used.min() < 0 or used.max() >= len(raw.points) or not np.isfinite(raw.points).all():
        raise Refusal(f"mesh file '{path}' has elements or nodes without a place: it is broken, write it again")
    _refuse_duplicates(raw, path)
    return in_metres(raw, *UNITS[unit])


def _refuse_duplicates(raw: RawMesh, path: str | Path) -> None:
    """Raise Refusal, which names two elements of the same corners: mass and stiffness would count twice."""
    for n_corner in sorted({VOLUMES[cells.kind][0].corners for cells in raw.cells}):
        blocks = [cells for cells in raw.cells if VOLUMES[cells.kind][0].corners == n_corner]
        corners = np.sort(np.vstack([cells.nodes[:, :n_corner] for cells in blocks]), axis=1)
        order = np.lexsort(corners.T)
        equal = np.flatnonzero((corners[order[1:]] == corners[order[:-1]]).all(axis=1))
        if len(equal):
            labels = np.concatenate([cells.labels for cells in blocks])[order[[equal[0], equal[0] + 1]]]
            raise Refusal(
                f"{len(equal)} elements of mesh file '{path}' have the same corners as another, such as "
                f"{labels.min()} and {labels.max()}: take one of each two out, mass and stiffness would count twice"
            )


def _raw(file: Path, reader: str, sizes: cad.Sizes | None) -> RawMesh:
    """What the module of a reader makes of a file."""
    if reader not in FOREIGN:
        raw: RawMesh = importlib.import_module(f"tribodyn.geometry.sources.{reader}").read(file)
        return raw
    if is_script := reader == "drawing":
        require_consent(file)
    options = {} if sizes is None else asdict(sizes)
    fields = foreign_process.call(reader, "content", file, is_script, **options)
    cells, skins = [Cells(*block) for block in fields.pop("cells")], frozenset(fields.pop("skins", ()))
    return RawMesh(cells=cells, skins=skins, **fields)


def in_metres(raw: RawMesh, metre: float, newton: float = 1.0) -> RawMesh:
    """A mesh and its deck in SI units where the file counts in a unit of so many metres and one of so many newton."""
    if metre == 1.0:
        return raw
    points = {name: metre * point for name, point in raw.points_of_reference.items()}
    scaled_deck = in_si(raw.deck, metre, newton)
    return replace(raw, points=metre * raw.points, points_of_reference=points, deck=scaled_deck)


def formulations(raw: RawMesh, parts: Mapping[str, np.ndarray]) -> tuple[dict[str, str], list[str]]:
    """The formulation of each body of 8-node hexahedra alone: that of most of its elements; notes where they differ."""
    of_element = np.array([form for cells in raw.cells for form in cells.formulations or [""] * len(cells.nodes)])
    names = {name: np.unique(of_element[elements], return_counts=True) for name, elements in parts.items()}
    chosen = {name: str(forms[counts.argmax()]) for name, (forms, counts) in names.items() if "" not in forms}
    notes = [
        f"{counts.sum() - counts.max()} of {counts.sum()} hexahedra of {name} have another formulation than the most: "
        f"all are computed as {chosen[name]}"
        for name, (_, counts) in names.items()
        if name in chosen and len(counts) > 1
    ]
    return chosen, notes


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
