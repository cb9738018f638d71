"""The word of the command `tribodyn` that shows the static forces on the bodies of a scene."""

from __future__ import annotations

import json

from tribodyn.workflows.command.words import Json, Overrides


def forces(scene: str, *, overrides: Overrides = (), as_json: Json = False) -> None:
    """Show the static forces on every body of a scene, joint by joint, and whether they balance.

    At rest under the static loads, centrifugal force included; harmonic loads are away.

    Parameters
    ----------
    scene
        Name of a scene with a mesh, or a .toml file.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.scene import scene_file
    from tribodyn.workflows.studies import forces as study

    found = study.study(scene_file.read(scene, overrides))
    if as_json:
        print(json.dumps(study.record(found), indent=2))
    else:
        print("\n".join(study.lines(found)))


COMMANDS = (forces,)
