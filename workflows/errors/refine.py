"""The engine of refinement: a scene with a finer mesh, more modes, more harmonics, more samples or finer wear steps.

Three views use it: the table of changes of a verdict, the rounds to a requested accuracy, and ladders of settings."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from tribodyn.geometry import parts
from tribodyn.geometry.sources import cad, foreign_process
from tribodyn.refusal import Refusal
from tribodyn.workflows.result.verdict import Refinement
from tribodyn.workflows.scene.part_tables import Geometry
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import MeshScene
from tribodyn.workflows.scene.structure_tables import BodyTable, DeckTable
from tribodyn.workflows.scene.wear import WearStepLimit

WEAR_FACTOR = 3.0  # finer wear steps of another round
HALVED = 2.0  # ratio of element sizes where every element of an imported mesh is cut into eight

Mesh = Geometry | BodyTable | DeckTable


class NoMesh(Refusal):
    """A scene whose mesh cannot be refined."""


def overrides_of(file: SceneFile, refinement: str, factor: float) -> tuple[str, ...]:
    """Overrides that refine a scene in one respect; none where it cannot be refined.

    refinement : a Refinement; factor : on elements along every edge and on modes"""
    top = max(file.scene.harmonics.kept, default=1)
    finer_wear = partial(wear, file, WEAR_FACTOR)  # its tolerance decides on the scatter of means in time too
    refinements: dict[str, Callable[[], SceneFile | None]] = {  # of the others there is nothing to refine
        Refinement.HARMONICS: lambda: harmonics(file, range(top + 3)),
        Refinement.MESH: lambda: mesh(file, factor)[0],
        Refinement.MODES: lambda: modes(file, factor),
        Refinement.SAMPLES: lambda: file.changed(f"harmonics.samples={2 * file.scene.harmonics.samples}"),
        Refinement.WEAR_STEPS: finer_wear,
        Refinement.MOTION: finer_wear,
    }
    try:
        finer = refinements.get(refinement, lambda: None)()
    except NoMesh:
        return ()
    return () if finer is None else finer.overrides[len(file.overrides) :]


def mesh(file: SceneFile, ratio: float) -> tuple[SceneFile, float]:
    """The scene with so many times the elements along every edge, and the mean ratio that comes of it.

    Counts are whole numbers that the part accepts; the elements of an imported mesh are cut in halves.

    Raises  NoMesh"""
    scene = file.scene
    if not isinstance(scene, MeshScene):
        raise NoMesh("matrices come without a mesh")
    tables: dict[str, Mesh] = {f"bodies.{name}": body for name, body in scene.bodies.items()}
    tables |= {f"decks.{name}": deck for name, deck in scene.decks.items()}
    if scene.geometry is not None:
        tables = {"geometry": scene.geometry}
    changes, sizes = list[str](), list[float]()
    for key, table in tables.items():
        rescaled = _rescaled(key, table, file.folder, ratio)
        if rescaled is None:
            return file.changed(*(f"{name}.halved={table.halved + 1}" for name, table in tables.items())), HALVED
        changes += rescaled[0]
        sizes.append(rescaled[1])
    return file.changed(*changes), 1 / float(np.mean(sizes))


def modes(file: SceneFile, factor: float) -> SceneFile | None:
    """The scene with so many times its retained modes, or its cutoff; None where it has no such number."""
    reduction = getattr(file.scene, "reduction", None)
    if reduction is None or not (reduction.modes or reduction.cutoff):
        return None
    if reduction.modes:
        return file.changed(f"reduction.modes={round(factor * reduction.modes)}")
    return file.changed(f"reduction.cutoff={factor * reduction.cutoff!r}")


def harmonics(file: SceneFile, numbers: Sequence[int]) -> SceneFile:
    """The scene with harmonics, 0 among them where it keeps it, and samples enough for them."""
    static = 0 in file.scene.harmonics.kept or file.scene.harmonics.automatic
    samples = max(file.scene.harmonics.samples, 16 * max(numbers))
    return file.changed(f"harmonics.kept={[h for h in numbers if h or static]}", f"harmonics.samples={samples}")


def wear(file: SceneFile, factor: float) -> SceneFile:
    """The scene with wear steps finer by a factor, as many more of them allowed."""
    table = file.scene.wear
    if table is None:
        return file
    changes = [f"wear.max_steps={round(2 * factor * table.max_steps)}"]
    for key in table.accuracy_keys:
        value, unit = table.parameters.get(key, table.tolerance), ""
        if key == "step":
            step = table.step or WearStepLimit()
            value, unit = (step.depth or 0.0, " m") if step.share is None else (step.share, "")
        changes.append(f"wear.{key}={value / factor!r}{unit}")
    return file.changed(*changes)


def _rescaled(key: str, table: Mesh, folder: Path, ratio: float) -> tuple[list[str], float] | None:
    """Overrides that give a body so many times its elements along every edge, and their mean size over its own.

    None for a mesh without counts and sizes, as an imported one, whose elements can only be cut"""
    if not isinstance(table, DeckTable) and table.part_name is not None:
        part = parts.load(table.part_name)
        numbers = part.Parameters(**table.parameters)
        counts = parts.rescaled(part, numbers, ratio)
        if not counts:
            return None
        size = float(np.mean([getattr(numbers, name) / count for name, count in counts.items()]))
        return [f"{key}.{name}={count}" for name, count in counts.items()], size
    if not isinstance(table, BodyTable) or Path(str(table.mesh)).suffix.lower() not in cad.ENDINGS:
        return None
    edge = table.size or table.unit * foreign_process.call("cad", "default_size", folder / str(table.mesh))
    faces = ", ".join(f'"{name}" = {face / ratio:.6g}' for name, face in table.face_sizes.items())
    return [f"{key}.size={edge / ratio:.6g}", *([f"{key}.face_sizes={{{faces}}}"] if faces else [])], 1 / ratio
