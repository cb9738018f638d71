"""Drawings in Gmsh's language (.geo) -> tetrahedra of second order."""

from typing import Any

from tribodyn.geometry.gmsh_session import session
from tribodyn.geometry.sources import msh
from tribodyn.geometry.sources.cad import one_line
from tribodyn.refusal import Refusal


def content(path: str) -> dict[str, Any]:
    """Mesh a drawing in Gmsh's language, which has its own sizes; see `msh.of_session`.

    Raises  Refusal: it cannot be meshed"""
    with session() as gmsh:
        try:
            gmsh.open(path)
            gmsh.model.mesh.generate(3)
            gmsh.model.mesh.setOrder(2)
        except Exception as problem:  # gmsh raises this and nothing finer
            raise Refusal(f"drawing '{path}' cannot be meshed ({one_line(problem)}): correct it in Gmsh") from None
        return msh.of_session(gmsh)
