"""What a result holds before anything is solved: provenance, sizes, patch and mesh."""

import json
import platform
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from tribodyn.fem.assembly import pieces
from tribodyn.fem.part import Part
from tribodyn.geometry import mesh as mesh_reader
from tribodyn.geometry.numbering import REFERENCE_POINTS, permutation
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.harmonic_choice import HarmonicChoice
from tribodyn.hbm.threads import usable
from tribodyn.reduction.model import ReductionBasis
from tribodyn.version import package_version
from tribodyn.workflows.result.model_facts import Around, ModelFacts, Stage
from tribodyn.workflows.result.result import PartMesh, Patch, Result
from tribodyn.workflows.run.references import delta_max, free_deflection
from tribodyn.workflows.scene.file_digests import digests
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import MeshScene

# nodes of an element -> points in whose order VTK has them, of which it has the first; VTK's name
VTK_KIND = {
    27: ("hexahedron27", "triquadratic_hexahedron"),
    10: ("tetra10", "quadratic_tetra"),
    8: ("hexahedron27", "hexahedron"),
}
PACKAGES = ("tribodyn", "numpy", "scipy", "numba", "scikit-fem", "gmsh", "meshio", "h5py", "pydantic")
SHOWN = 6  # modes with the contact stuck that a result keeps
SEED = 0  # of every random start vector and probe in the packages used


def described(
    file: SceneFile,
    part: Part | None,
    balance: HarmonicBalance,
    choice: HarmonicChoice | None = None,
    notes: tuple[str, ...] = (),
) -> Result:
    """The result before anything was solved: where it comes from and what is modelled; part None for matrices.

    notes : what of the scene is to be doubted"""
    reduced, i = balance.model, balance.model.interface
    nodes = np.full(i.n_pair, -1) if part is None else part.nodes
    wears = file.scene.wear is not None
    free = free_deflection(balance) if wears else np.full(i.n_pair, np.nan)
    patch = Patch(i.components, nodes, i.points, i.frames, i.area, i.gap, i.faces, free)
    facts = ModelFacts(
        full_dofs=reduced.n_full,
        model_dofs=reduced.system.n_dof,
        contact_pairs=i.n_pair,
        unknowns=balance.n_unknown,
        harmonics=tuple(balance.basis.harmonics),
        open_frequencies=reduced.free_frequency,
        stuck_frequencies=balance.compliance.stuck_frequencies(next(filter(None, balance.basis.harmonics)))[:SHOWN],
        compliance_error=balance.compliance.error,
        prestress_residual=reduced.accuracy().get("prestress_residual"),
        prestress_rotation=reduced.accuracy().get("prestress_rotation"),
        notes=notes,
        places=balance.places,
    )
    if part is not None:
        worst = min(mesh_reader.quality(piece.mesh).scaled_jacobian for piece in pieces(part.mesh))
        facts = replace(facts, elements=int(part.mesh.nelements), nodes=len(part.points), scaled_jacobian=worst)
    origin = reduced.origin
    if isinstance(origin, ReductionBasis):
        facts = replace(
            facts,
            retained_modes=origin.n_modes,
            first_omitted_frequency=origin.first_omitted_frequency,
            factorisation=origin.factorisation,
            interface_modes=origin.n_interface_modes or None,
        )
    if isinstance(file.scene, MeshScene) and file.scene.contacts:
        pairs = {name: slice(0, i.n_pair) for name in file.scene.contacts}  # a single joint has them all
        pairs |= {joint.name: joint.pairs for joint in balance.contact.joints if isinstance(joint.pairs, slice)}
        pairs |= {name: scene_text for name, scene_text in reduced.joints.items() if name in pairs}
        facts = replace(facts, joints=pairs)
    if file.scene.wear is not None:
        depth = delta_max(file.scene, free, i.area)  # none where nothing holds the part without its contact
        facts = replace(facts, delta_max=depth if np.isfinite(depth) else None, wear_split=file.scene.wear.split)
    if isinstance(file.scene, MeshScene) and (wheel := file.scene.wheel) is not None:
        facts = replace(facts, around=Around(wheel.sectors, wheel.engine_order, np.array(wheel.axis)))
    if choice is not None:
        facts = replace(facts, harmonics_error=choice.estimate.error, harmonics_choice=choice.outcome)
    mesh = part_mesh(part) if part is not None and file.scene.pictures.renders else None
    return Result(provenance(file), file.scene, facts, Stage.BUILT, patch=patch, part=mesh)


def provenance(file: SceneFile) -> dict[str, str]:
    """Where a result comes from, as texts."""
    return {
        "scene_name": file.name,
        "scene_text": file.text,
        "overrides": "\n".join(file.overrides),
        "folder": str(file.folder),
        "files": json.dumps(digests(file.scene.model_dump(mode="json"), file.folder)),
        "versions": ", ".join(f"{name} {package_version(name)}" for name in PACKAGES),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "seed": str(SEED),
        "threads": str(usable(file.scene.solver.threads)),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def part_mesh(part: Part) -> PartMesh | None:
    """The mesh of a part in the node order of VTK; None where its bodies are of different elements."""
    fields = []
    for piece in pieces(part.mesh):
        cells = piece.mesh.dofs.element_dofs.T
        reference, kind = VTK_KIND[cells.shape[1]]
        to_vtk = permutation(piece.mesh.elem.doflocs, REFERENCE_POINTS[reference][: cells.shape[1]])
        fields.append((kind, piece.node + cells[:, to_vtk]))
    if len({kind for kind, _ in fields}) > 1:
        return None
    return PartMesh(fields[0][0], part.points, np.concatenate([cells for _, cells in fields]))
