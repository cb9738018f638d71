"""A drawing in Gmsh's own language (.geo) -> a mesh file with its groups."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tribodyn.geometry.gmsh_session import save, session


def mesh_drawing(drawing: str | Path, path: str | Path, numbers: Mapping[str, float] | None = None) -> int:
    """Mesh a drawing in three dimensions and write what its physical groups hold.

    drawing : a .geo file; path : the .msh file to write
    numbers : values of names that the drawing introduces with DefineConstant, which they replace
    Returns the number of volume elements
    Raises  ValueError: no such file, a name that the drawing does not have, text that Gmsh cannot read, no volume
    """
    drawing = Path(drawing)
    if not drawing.is_file():
        raise ValueError(f'there is no drawing "{drawing}"')
    with session() as gmsh:
        if numbers and (unknown := sorted(set(numbers) - _constants(gmsh, drawing))):
            raise ValueError(
                f'{drawing} has no number "{unknown[0]}": introduce it with DefineConstant[{unknown[0]} = 1];'
            )
        for name, value in (numbers or {}).items():
            gmsh.parser.setNumber(name, [value])
        _merge(gmsh, drawing)
        try:
            gmsh.model.mesh.generate(3)
        except Exception as error:  # gmsh raises this and nothing finer
            raise ValueError(f"{drawing} cannot be meshed: {error}") from None
        elements = sum(len(tags) for tags in gmsh.model.mesh.getElements(3)[1])
        if not elements:
            raise ValueError(f"{drawing} has no volume: a part needs one, in a physical group")
        save(gmsh, path)
    return elements


def _constants(gmsh: Any, drawing: Path) -> set[str]:
    """Names of the numbers that a drawing introduces."""
    _merge(gmsh, drawing)
    names = set(gmsh.parser.getNames())
    gmsh.clear()
    gmsh.parser.clear()
    return names


def _merge(gmsh: Any, drawing: Path) -> None:
    try:
        gmsh.merge(str(drawing))
    except Exception as error:  # gmsh raises this and nothing finer
        raise ValueError(f"{drawing} cannot be read by Gmsh: {error}") from None
