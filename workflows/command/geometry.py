"""The words `tribodyn geometry ...`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from tribodyn.geometry.drawing import mesh_drawing
from tribodyn.workflows.command.word import word
from tribodyn.workflows.command.words import make_room, quantity
from tribodyn.workflows.studies.surfaces import asperities

Numbers = Annotated[tuple[str, ...], Parameter(name="--set", negative=(), consume_multiple=False)]
app = App(name="geometry")
app.command(word(asperities, "geometry asperities", into="asked"))


@app.command
def mesh(drawing: Path, *, numbers: Numbers = (), out: Path | None = None) -> None:
    """Mesh a drawing in Gmsh's language.

    Parameters
    ----------
    drawing
        A .geo file with physical groups and elements of second order (Mesh.ElementOrder = 2).
    numbers
        Value of a name that the drawing introduces with DefineConstant, such as size=0.005; can be repeated.
    out
        Mesh file to write (.msh); beside the drawing by default.
    """
    make_room(out, (".msh",))
    path = out or drawing.with_suffix(".msh")
    print(f"{path}: {mesh_drawing(drawing, path, dict(map(_number, numbers)))} elements")


def _number(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ValueError(f'--set expects name=number, got "{text}"')
    return name.strip(), quantity(f"--set {name.strip()}", value.strip(), "")
