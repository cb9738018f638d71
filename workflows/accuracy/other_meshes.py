"""The same scene on other meshes and with more modes: what a verdict solves beside it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tribodyn.geometry import parts
from tribodyn.geometry.sources import cad
from tribodyn.workflows.scene.body import Geometry
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import PartScene
from tribodyn.workflows.scene.structure import BodyTable, DeckTable, StructureScene

FINER = 3 / 2  # elements along every edge over those of the scene
STILL_FINER = 2.0  # the same, where with FINER a row of contact elements stays a single one
COARSER = (2 / 3, 1 / 2)
MOST_FINER = (100_000, 3000)  # DOFs of a finer mesh that a verdict solves, and unknowns of its balance
MOST_HALVED = 200_000  # DOFs of a mesh of halved elements that a verdict solves
A_FINER_MESH = "a finer mesh"
HALF = 0.5  # size of halved elements
TWICE_AS_MANY = 0.25  # of twice as many modes, whose error falls with the square of their number

Mesh = Geometry | BodyTable | DeckTable


class Given(ValueError):
    """A mesh that cannot be made again."""


@dataclass(frozen=True)
class Other:
    """The scene with another mesh or reduction.

    size : element size over that of the scene, or what stands for it: the error is taken to grow with it
    how : what it is; along : what of the discretisation it changes: errors of one kind are the same error seen twice
    instead : a finer mesh to take where this one leaves the contact grid as it is in a direction; None where there is
        none or it is too large
    """

    file: SceneFile
    size: float
    how: str
    along: str
    instead: Other | None = None


def around(file: SceneFile, n_dof: int, unknowns: int) -> list[Other]:
    """The scene on a coarser and on a finer mesh; none if the finer one is too large for a verdict.

    n_dof, unknowns : of the scene's own mesh and of a balance solve on it
    """
    if not _affordable(FINER, n_dof, unknowns):
        return []
    try:
        coarser_one, finer = _remeshed(file, COARSER[0], "a coarser mesh"), _remeshed(file, FINER, A_FINER_MESH)
        if _affordable(STILL_FINER, n_dof, unknowns):
            finer = replace(finer, instead=_remeshed(file, STILL_FINER, A_FINER_MESH))
        return [coarser_one, finer]
    except ValueError:
        return []


def _affordable(share: float, n_dof: int, unknowns: int) -> bool:
    """Whether a verdict solves a mesh with a share of the elements along every edge."""
    return share**3 * n_dof <= MOST_FINER[0] and share**2 * unknowns <= MOST_FINER[1]


def coarser(file: SceneFile, n_dof: int) -> list[Other]:
    """The scene on coarser meshes, or with elements of half the size where its mesh is given.

    A difference can vanish by chance where an answer does not settle from one side: two coarser meshes tell. Edges of a
    part with a single element, which no mesh has fewer of, get more of them.
    n_dof : of the scene's own mesh
    Raises  ValueError where there is no other mesh, or halved elements are too many for a verdict
    """
    tables = _meshed(file)
    try:
        found = {
            other.file.overrides: other for other in (_remeshed(file, share, "a coarser mesh") for share in COARSER)
        }
    except Given:
        if 8 * n_dof > MOST_HALVED:
            raise ValueError(
                f"the mesh is given, and its elements halved would have some {8 * n_dof:.2g} DOFs, beyond the "
                f"{MOST_HALVED:.2g} that a verdict solves: compare with a run on another mesh"
            ) from None
        return [Other(file.changed(*_halved(tables)), HALF, "halved elements", "most edges")]
    single = tuple(text for key, table in tables.items() for text in _more_of_single_ones(key, table))
    short = [Other(file.changed(*single), HALF, "more elements along short edges", "short edges")] if single else []
    return [*found.values(), *short]


def refined(file: SceneFile, share: float) -> SceneFile:
    """The scene with more elements along every edge: a share of its own, or twice as many where its mesh is given.

    Unchanged where it has no mesh
    """
    try:
        return _remeshed(file, share, A_FINER_MESH).file
    except Given:
        return file.changed(*_halved(_meshed(file)))
    except ValueError:
        return file


def with_more_modes(file: SceneFile) -> Other | None:
    """The scene with twice as many modes retained, None where it has no such number."""
    reduction = getattr(file.scene, "reduction", None)
    if reduction is None or not (reduction.modes or reduction.cutoff):
        return None
    key, value = ("modes", reduction.modes) if reduction.modes else ("cutoff", reduction.cutoff)
    return Other(file.changed(f"reduction.{key}={2 * value!r}"), TWICE_AS_MANY, "twice as many modes", "modes")


def _remeshed(file: SceneFile, share: float, how: str) -> Other:
    """The scene with a share of its elements along every edge; raises ValueError without a mesh, Given if given."""
    new = [_rescaled(key, table, file.folder, share) for key, table in _meshed(file).items()]
    texts = tuple(text for more, _ in new for text in more)
    return Other(file.changed(*texts), float(np.mean([size for _, size in new])), how, "most edges")


def _halved(tables: dict[str, Mesh]) -> Iterator[str]:
    """Overrides that cut every element into eight."""
    yield from (f"{key}.halved={table.halved + 1}" for key, table in tables.items())


def _meshed(file: SceneFile) -> dict[str, Mesh]:
    """The tables of a scene that give a mesh, by their keys; raises ValueError without one."""
    scene = file.scene
    if isinstance(scene, PartScene | StructureScene) and scene.geometry is not None:
        return {"geometry": scene.geometry}
    if not isinstance(scene, StructureScene):
        raise ValueError("matrices come without a mesh")
    tables: dict[str, Mesh] = {f"bodies.{name}": body for name, body in scene.bodies.items()}
    return tables | {f"decks.{name}": deck for name, deck in scene.decks.items()}


def _rescaled(key: str, table: Mesh, folder: Path, share: float) -> tuple[list[str], float]:
    """Overrides that give a body a share of its elements along every edge, and the mean size of those over its own.

    Raises  Given where there are none
    """
    if not isinstance(table, DeckTable) and table.part_name is not None:
        part = parts.load(table.part_name)
        own = part.Parameters(**table.parameters)
        counts = parts.rescaled(part, own, share)
        if not counts:
            raise Given(f"the part of [{key}] lists no counts of elements in MESH")
        size = float(np.mean([getattr(own, name) / count for name, count in counts.items()]))
        return [f"{key}.{name}={count}" for name, count in counts.items()], size
    if not isinstance(table, BodyTable) or Path(str(table.mesh)).suffix.lower() not in cad.ENDINGS:
        raise Given(f"the mesh of [{key}] is given")
    own_size = table.size or table.unit * cad.default_size(folder / str(table.mesh))
    faces = ", ".join(f'"{name}" = {face / share:.6g}' for name, face in table.face_sizes.items())
    return [f"{key}.size={own_size / share:.6g}", *([f"{key}.face_sizes={{{faces}}}"] if faces else [])], 1 / share


def _more_of_single_ones(key: str, table: Mesh) -> list[str]:
    """Overrides that give a part more elements where no mesh of it has fewer."""
    if isinstance(table, DeckTable) or table.part_name is None:
        return []
    part = parts.load(table.part_name)
    own = part.Parameters(**table.parameters)
    fewer, more = (parts.rescaled(part, own, share) for share in (COARSER[0], FINER))
    return [f"{key}.{name}={count}" for name, count in more.items() if name not in fewer]
