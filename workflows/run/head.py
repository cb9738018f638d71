"""The head of every run: sizes, mass, bodies, worst element, gaps, what is not used, what looks wrong by a thousand."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tribodyn.fem.assembly import Assembly, materials_of
from tribodyn.fem.elasticity import densities
from tribodyn.fem.material import Material
from tribodyn.fem.part import Part
from tribodyn.geometry import mesh as mesh_reader
from tribodyn.geometry.facts import facts
from tribodyn.geometry.sources import cad
from tribodyn.workflows.run import bodies, oddities, part_reduction
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import PartScene
from tribodyn.workflows.scene.structure import StructureScene


def lines(file: SceneFile, model: Model) -> Iterator[str]:
    """Sentences on the structure of a scene; none for one of matrices."""
    part = model.part
    if part is None:
        return
    scene = file.mesh_scene
    names = [body.name for body in part.mesh.bodies] if isinstance(part.mesh, Assembly) else [""]
    material = part_reduction.material(scene, part.mesh)
    found, plain, counts = [], {}, []
    for name, (piece, own) in zip(names, materials_of(part.mesh, material), strict=True):
        found.append(facts(piece.mesh, densities(piece.mesh, own)))
        if isinstance(own, Material):
            plain[name or file.name] = own
        kind = "hexahedra" if piece.mesh.t.shape[0] == 8 else "tetrahedra"
        counts.append(f"{name}: {piece.mesh.nelements} {kind}" if name else f"{piece.mesh.nelements} {kind}")
    size = np.max([one.high for one in found], axis=0) - np.min([one.low for one in found], axis=0)
    masses = [one.mass or 0.0 for one in found]
    centre = np.average([one.centre for one in found], axis=0, weights=masses)
    yield f"size {_mm(size, ' x ')} mm, mass {sum(masses):.4g} kg, centre ({_mm(centre)}) mm; {'; '.join(counts)}"
    worst = min(found, key=lambda one: one.scaled_jacobian)
    yield f"worst element: scaled Jacobian {worst.scaled_jacobian:.3g} at ({_mm(worst.worst_centre)}) mm"
    for name, pairs in part.pairs.items():
        gap = np.asarray(part.interface.gap)[pairs]
        if gap.size:
            yield f"gap of {name}: {1e6 * gap.min():.4g} to {1e6 * gap.max():.4g} um"
    yield from notes(file, part)
    remarks = [*oddities.odd_sizes(size, "scale the mesh to metres"), *oddities.odd_materials(plain)]
    if model.reduced.per_harmonic is None:
        reduced = model.reduced
        remarks += oddities.odd_deflection(
            scene, reduced.system, lambda q: part.largest(reduced.reconstruct(q)), float(np.linalg.norm(size))
        )
    yield from (f"look again: {remark}" for remark in remarks)


def notes(file: SceneFile, part: Part) -> Iterator[str]:
    """What was done to the files of a scene, and what of them is not used."""
    scene = file.mesh_scene
    if isinstance(part.mesh, Assembly):
        yield from (note for body in part.mesh.bodies for note in body.notes)
    if isinstance(scene, StructureScene):
        for deck in bodies.of_decks(scene, file.folder).values():
            yield from deck.notes
    elif isinstance(scene, PartScene) and scene.geometry.mesh is not None:
        path = file.folder / scene.geometry.mesh
        if Path(path).suffix.lower() not in cad.ENDINGS:  # which would be meshed again, and loses nothing
            yield from mesh_reader.read_with_notes(path)[2]


def _mm(point: np.ndarray, between: str = ", ") -> str:
    return between.join(f"{1e3 * c:.4g}" for c in point)
