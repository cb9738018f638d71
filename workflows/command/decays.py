"""A free decay in time: tribodyn ring-down."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tribodyn.workflows.command.words import Json, Overrides, make_room, print_lines, quantity


def ring_down(
    scene: str,
    *,
    start: Annotated[str | None, Parameter(name="--from")] = None,
    stop: Annotated[str | None, Parameter(name="--to")] = None,
    mode: int | None = None,
    points: int | None = None,
    periods: int = 400,
    steps: int = 256,
    overrides: Overrides = (),
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """Let a nonlinear mode decay freely in time: frequency and damping from its peaks, beside the backbone.

    Parameters
    ----------
    scene
        Name of a scene (see `tribodyn list`) or a .toml file; its harmonic loads play no part.
    start
        Amplitude of the response at which the decay ends, such as 1um; [backbone] of the scene by default.
    stop
        Amplitude at which it begins, such as 1mm.
    mode
        Number of the mode about the static equilibrium, from 0; 0 or that of [backbone] by default.
    points
        Points of the backbone on an easy way; 40 or those of [backbone] by default.
    periods
        Periods after which the decay ends at the latest.
    steps
        Time steps per period.
    out
        Folder of ring_down.csv and ring_down.png; results/NAME by default.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.run.progress import Progress, console_progress
    from tribodyn.workflows.scene import scene_file
    from tribodyn.workflows.studies import decay, modes

    make_room(out)
    file = scene_file.read(scene, overrides)
    ends = [None if end is None else quantity(name, end, "m") for name, end in (("--from", start), ("--to", stop))]
    asked = modes.way(file, ends[0], ends[1], mode, points)
    found = decay.follow(file, asked, periods, steps, Progress() if as_json else console_progress())
    folder = out or Path("results") / file.name
    folder.mkdir(parents=True, exist_ok=True)
    decay.write(found, folder / "ring_down.csv")
    decay.picture(found).savefig(folder / "ring_down.png")
    said = decay.record(found)
    if as_json:
        print(json.dumps(said, indent=2))
        return
    first, last = said["rows"][0], said["rows"][-1]
    print_lines(
        [
            ("amplitude", f"{first['amplitude_m']:.4g} -> {last['amplitude_m']:.4g} m"),
            ("frequency", f"{first['frequency_hz']:.6g} -> {last['frequency_hz']:.6g} Hz"),
            ("damping", f"{100 * first['damping']:.4g} -> {100 * last['damping']:.4g} %"),
            ("from the backbone", f"frequency at most {_percent(said['largest_frequency_difference'])} off"),
            ("", f"damping at most {_percent(said['largest_damping_difference'])} off"),
        ]
    )
    print(folder / "ring_down.csv", folder / "ring_down.png", sep="\n")


def _percent(share: float | None) -> str:
    return "(no common amplitude)" if share is None else f"{100 * share:.3g} %"


COMMANDS = (ring_down,)
