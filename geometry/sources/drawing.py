"""Drawings in Gmsh's language (.geo) -> tetrahedra of second order."""

from __future__ import annotations

from pathlib import Path

from tribodyn.geometry.gmsh_session import session
from tribodyn.geometry.sources import msh
from tribodyn.geometry.sources.cad import one_line
from tribodyn.geometry.sources.raw_mesh import RawMesh
from tribodyn.refusal import Refusal


def read(path: Path) -> RawMesh:
    """Mesh a drawing in Gmsh's language, which has its own sizes. Raises Refusal: it cannot be meshed."""
    with session() as gmsh:
        try:
            gmsh.open(str(path))
            gmsh.model.mesh.generate(3)
            gmsh.model.mesh.setOrder(2)
        except Exception as problem:  # gmsh raises this and nothing finer
            raise Refusal(f"drawing '{path}' cannot be meshed ({one_line(problem)}): correct it in Gmsh") from None
        return msh.from_gmsh(gmsh)
