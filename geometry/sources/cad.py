"""Shapes of CAD programs (STEP, IGES, BREP) -> tetrahedra of second order.

Solids become bodies under the names that the STEP file gives them. Faces are groups "face N" by their number in the CAD
file. Solids that touch stay apart, each with its own mesh, so that a contact can lie between them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tribodyn.geometry.gmsh_session import session
from tribodyn.geometry.sources import msh
from tribodyn.refusal import Refusal

ENDINGS = (".step", ".stp", ".iges", ".igs", ".brep")
_NO_NAME = "Open CASCADE"  # how its writer calls what has no name


@dataclass(frozen=True)
class Sizes:
    """Element sizes, in the unit of the file. everywhere : None for a tenth of the shape's length
    bodies : name of a solid -> size; faces : number of a face -> size there
    solid : name of the one solid that is meshed, None for all
    elements_per_edge : on the longest edge of the box where no size is asked for
    elements_per_turn : around a full turn of a curved face, down to the least size over `finest`"""

    everywhere: float | None = None
    bodies: Mapping[str, float] = field(default_factory=dict)
    faces: Mapping[int, float] = field(default_factory=dict)
    solid: str | None = None
    elements_per_edge: int = 10
    elements_per_turn: int = 8
    finest: int = 4


def content(path: str, **sizes: Any) -> dict[str, Any]:
    """Mesh a CAD file; see `msh.of_session`. Lengths keep the unit of the file: Gmsh does not convert them.

    sizes : the fields of `Sizes`, its numbers of faces as texts
    Raises  Refusal: a file that cannot be read, has no solid or cannot be meshed, a size for what is not there"""
    faces = {int(number): size for number, size in sizes.pop("faces", {}).items()}
    with session() as gmsh:
        shapes = _solids(gmsh, path)
        return _meshed(gmsh, path, shapes, Sizes(**sizes, faces=faces))


def default_size(path: str) -> float:
    """Size of the elements where none is asked for, in the unit of the file; raises Refusal as `content` does."""
    with session() as gmsh:
        _solids(gmsh, path)
        return _default_size(gmsh.model, Sizes())


def _default_size(model: Any, sizes: Sizes) -> float:
    box = np.array(model.getBoundingBox(-1, -1)).reshape(2, 3)
    return float(np.ptp(box, axis=0).max()) / sizes.elements_per_edge


def _solids(gmsh: Any, path: str) -> dict[str, int]:
    """Import the solids of a file: name -> tag."""
    gmsh.option.setString("Geometry.OCCTargetUnit", "")
    gmsh.option.setNumber("Geometry.OCCImportLabels", 1)
    try:
        gmsh.model.occ.importShapes(path, highestDimOnly=True)
        gmsh.model.occ.synchronize()
    except Exception as problem:
        raise Refusal(f"CAD file '{path}' cannot be read ({one_line(problem)}): export it again as STEP") from None
    tags = [tag for _, tag in gmsh.model.getEntities(3)]
    if not tags:
        raise Refusal(f"CAD file '{path}' has no solid: close its surfaces in the CAD program and export solids")
    names: dict[str, int] = {}
    for tag in tags:
        label = gmsh.model.getEntityName(3, tag).rstrip("/").rpartition("/")[2].strip()
        name = f"solid {tag}" if not label or label.startswith(_NO_NAME) else label
        names[name if name not in names else f"{name} {tag}"] = tag
    return names


def _meshed(gmsh: Any, path: str, shapes: Mapping[str, int], sizes: Sizes) -> dict[str, Any]:
    model = gmsh.model
    faces = {tag for _, tag in model.getEntities(2)}
    for kind, size_table, existing in (("solid", sizes.bodies, shapes), ("face", sizes.faces, faces)):
        for key in size_table:
            if key not in existing:
                listed = ", ".join(map(str, sorted(existing)[:12]))
                raise Refusal(f"CAD file '{path}' has no {kind} {key} to give a size to: it has {listed}")
    if sizes.solid is not None:
        if sizes.solid not in shapes:
            raise Refusal(f"CAD file '{path}' has no solid '{sizes.solid}': it has {', '.join(shapes)}")
        shapes = {sizes.solid: shapes[sizes.solid]}
        model.setVisibility(model.getEntities(), 0)
        model.setVisibility([(3, *shapes.values())], 1, recursive=True)
        gmsh.option.setNumber("Mesh.MeshOnlyVisible", 1)
    everywhere = sizes.everywhere or _default_size(model, sizes)
    for values in ((everywhere,), sizes.bodies.values(), sizes.faces.values()):
        if any(not value > 0 for value in values):
            raise Refusal(f"CAD file '{path}': element sizes must be above zero")
    fields = []

    def constant(size: float, **entities: list[int]) -> None:
        number = model.mesh.field.add("Constant")
        model.mesh.field.setNumber(number, "VIn", size)
        model.mesh.field.setNumber(number, "VOut", everywhere)
        for key, tags in entities.items():
            model.mesh.field.setNumbers(number, key, tags)
        fields.append(number)

    for name, size in sizes.bodies.items():
        surfaces = [tag for _, tag in model.getBoundary([(3, shapes[name])], oriented=False)]
        constant(size, VolumesList=[shapes[name]], SurfacesList=surfaces)
    for face, size in sizes.faces.items():
        constant(size, SurfacesList=[face])
    all_sizes = [everywhere, *sizes.bodies.values(), *sizes.faces.values()]
    gmsh.option.setNumber("Mesh.MeshSizeMax", max(all_sizes))
    gmsh.option.setNumber("Mesh.MeshSizeMin", min(all_sizes) / sizes.finest)
    gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)  # a CAD file gives 0 there, which asks for the least size
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", sizes.elements_per_turn)
    if fields:
        least = model.mesh.field.add("Min")
        model.mesh.field.setNumbers(least, "FieldsList", fields)
        model.mesh.field.setAsBackgroundMesh(least)
    try:
        model.mesh.generate(3)
        model.mesh.setOrder(2)
    except Exception as problem:
        raise Refusal(
            f"CAD file '{path}' cannot be meshed ({one_line(problem)}): heal it or give a smaller size"
        ) from None
    for name, tag in shapes.items():
        model.addPhysicalGroup(3, [tag], name=name)
    note = f"meshed with elements of {everywhere:.4g} in the unit of the file, tetrahedra of second order"
    return msh.of_session(gmsh) | {"notes": [note]}


def one_line(problem: Exception) -> str:
    return " ".join(str(problem).split())
