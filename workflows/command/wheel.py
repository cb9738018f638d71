"""The word of the command `tribodyn` that shows the modes of a wheel."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tribodyn.workflows.command.words import Json, Overrides, Start, Stop, make_room, quantity

Orders = Annotated[tuple[int, ...], Parameter(name="--order", negative=(), consume_multiple=True)]
Formats = Annotated[tuple[str, ...], Parameter(name="--format", negative=(), consume_multiple=True)]


def wheel(
    scene: str,
    *,
    slow: Start = None,
    fast: Stop = None,
    order: Orders = (),
    families: int = 4,
    speeds: int = 7,
    overrides: Overrides = (),
    formats: Formats = ("png",),
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """Show the modes of a wheel: nodal diameters, and SAFE and Campbell diagrams of a range of speeds.

    Contact free and stuck, at the scene's speed; the Campbell diagram has the modes at each speed.

    Parameters
    ----------
    scene
        Name of a scene with a [wheel], or a .toml file.
    slow
        Lowest speed of the SAFE diagram, such as 3000rpm.
    fast
        Highest speed of the SAFE diagram, and of the Campbell diagram; no such diagrams by default.
    order
        Engine orders of the Campbell diagram; that of the scene by default.
    families
        Modes of each nodal diameter.
    speeds
        Speeds of the Campbell diagram, from rest to the highest.
    formats
        png, pdf or svg, can be repeated.
    out
        Folder of tables and pictures; results/NAME by default.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.scene import scene_file
    from tribodyn.workflows.studies.wheels import modes as wheel_modes

    make_room(out)
    if slow is not None and fast is None:
        raise ValueError("--from: give --to, the highest speed, too")
    ends = [None if text is None else quantity(name, text, "Hz") for name, text in (("--from", slow), ("--to", fast))]
    file = scene_file.read(scene, overrides)
    found = wheel_modes.study(file, ends[0], ends[1], order, families, speeds)
    written = wheel_modes.write(found, out or Path("results") / file.name, formats)
    if as_json:
        print(json.dumps({**found.record(), "files": [str(path) for path in written]}, indent=2))
        return
    for line in (*found.lines(), *written):
        print(line)


def flutter(
    scene: str,
    *,
    start: Start = None,
    stop: Stop = None,
    points: int = 40,
    overrides: Overrides = (),
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """Tell which waves of a wheel flutter in the flow of the scene, and at which amplitude friction limits them.

    Parameters
    ----------
    scene
        Name of a scene with [wheel] and [flow], or a .toml file; its harmonic loads play no part.
    start
        Amplitude of the response from which limit cycles are looked for, such as 1um; none by default.
    stop
        Amplitude up to which they are looked for.
    points
        Points of the backbone between these amplitudes.
    out
        Folder of flutter.csv and flutter.png; results/NAME by default.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.scene import scene_file
    from tribodyn.workflows.studies.wheels import flutter as study

    make_room(out)
    low = None if start is None else quantity("--from", start, "m")
    high = None if stop is None else quantity("--to", stop, "m")
    file = scene_file.read(scene, overrides)
    found = study.study(file, low, high, points)
    folder = out or Path("results") / file.name
    folder.mkdir(parents=True, exist_ok=True)
    study.write(found, table := folder / "flutter.csv")
    study.picture(found).savefig(drawing := folder / "flutter.png")
    if as_json:
        print(json.dumps(found.record(), indent=2))
        return
    print(*found.lines(), table, drawing, sep="\n")


COMMANDS = (wheel, flutter)
