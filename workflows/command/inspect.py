"""The word of the command `tribodyn` that says what a file or a scene holds before it is computed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tribodyn.workflows.command.words import PICTURE, Json, Overrides, make_room, print_lines, quantity


def inspect(
    what: str,
    *,
    unit: str = "m",
    young: str | None = None,
    poisson: float = 0.3,
    density: str | None = None,
    modes: int = 0,
    picture: Annotated[Path | None, Parameter(name="--picture")] = None,
    overrides: Overrides = (),
    as_json: Json = False,
) -> None:
    """Say what a mesh, a deck, a CAD file or a scene holds: size, mass, bodies, groups, worst element, gaps, checks.

    Parameters
    ----------
    what
        A file of a mesh, a deck or a CAD program, a scene's name, or a .toml file.
    unit
        Unit of length of a file: m, mm, cm, um, in, ft.
    young
        Young's modulus of a file that gives no material, such as 210GPa.
    poisson
        Poisson's ratio likewise.
    density
        Density likewise, such as "7860 kg/m3".
    modes
        How many natural frequencies to compute, free of contact.
    picture
        Image file to draw the groups into, in colour.
    as_json
        Print JSON for machines.
    """
    from tribodyn.fem.material import Material
    from tribodyn.workflows.api import whole_scenes

    make_room(picture, PICTURE)
    if modes < 0:
        raise ValueError(f"--modes {modes}: give a number of modes, 0 for none")
    if (young is None) != (density is None):
        raise ValueError("--young and --density go together: give both or none")
    material = None
    if young is not None and density is not None:
        material = Material(quantity("--young", young, "Pa"), poisson, quantity("--density", density, "kg/m3"))
    found = whole_scenes.inspect(what, unit=unit, material=material, modes=modes, overrides=overrides)
    if picture is not None:
        from tribodyn.workflows.pictures import groups

        groups.draw(found.solids, picture)
    if as_json:
        print(json.dumps(found.record(), indent=2))
    else:
        print_lines(found.lines())
        if picture is not None:
            print(picture)


COMMANDS = (inspect,)
