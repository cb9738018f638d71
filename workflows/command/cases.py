"""Words of the command `tribodyn` that serve one of the thesis's scenes alone: leaf, blade, rig."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

from tribodyn.workflows.command.words import Changes, Flag, Json, Overrides, aside, make_room, quantity


def leaf(
    work: Literal["fit", "check", "study", "accuracy"],
    *,
    out: Path | None = None,
    resume: Flag = False,
    as_json: Json = False,
) -> None:
    """What only the leaf seal has: the fit of its dimensions, its parameter study, its accuracy.

    Parameters
    ----------
    work
        fit looks for the dimensions that give the published frequency ratios, check shows those of the scene; study
        runs some thirty configurations; accuracy holds 1 to 9 harmonics against time integration.
    out
        Folder of tables and pictures; results/leaf_study or results/leaf_accuracy by default.
    resume
        Resume a study with what is complete in its folder.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.cases.leaf_seal import accuracy as leaf_accuracy
    from tribodyn.workflows.cases.leaf_seal import fit as leaf_fit
    from tribodyn.workflows.cases.leaf_seal import study as leaf_study

    make_room(out)
    folder = out or Path("results") / f"leaf_{work}"
    if resume and work != "study":
        raise ValueError(f"--resume is for leaf study, leaf {work} has nothing to go on with: run it without")
    if work == "study":
        leaf_study.run(folder, resume, as_json)
    elif work == "accuracy":
        leaf_accuracy.run(folder, as_json)
    else:
        leaf_fit.run(work == "check", as_json)


def blade(
    work: Literal["study", "mistuned"],
    scene: str = "blade",
    *,
    overrides: Overrides = (),
    speed: str | None = None,
    out: Path | None = None,
) -> None:
    """What only a bladed disk has: figures 4.11 to 4.17 and table 4.4 of the thesis beside ours.

    Parameters
    ----------
    work
        study draws nodal diameters, responses to engine orders and to rising forces, and wear for several wear steps;
        mistuned solves all blades of a small wheel at once, their stiffnesses a few per cent apart.
    scene
        Name of a scene with a [wheel] or a .toml file.
    speed
        Highest speed of a Campbell diagram, such as 6000rpm; no diagram by default.
    out
        Folder of tables and pictures; results/blade_study by default.
    """
    from tribodyn.workflows.cases.blade import mistuning as blade_mistuning
    from tribodyn.workflows.cases.blade import study as blade_study

    highest = None if speed is None else quantity("--speed", speed, "Hz")
    make_room(out)
    folder = out or Path("results") / f"blade_{work}"
    if work == "mistuned":
        written = blade_mistuning.run(scene, overrides, folder)
    else:
        written = blade_study.run(scene, overrides, folder, highest, aside, blade_study.Extent())
    for path in written:
        print(path)


def rig(
    work: Literal["fit", "study", "life"],
    scene: str = "rig",
    *,
    column: Flag = False,
    wear: Flag = False,
    change: Changes = (),
    overrides: Overrides = (),
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """What only the fretting rig has: fits of what is not published, and its comparison with the published experiment.

    Parameters
    ----------
    work
        fit looks for joint springs, platform height and damping that give published numbers, and says how well these
        determine them; study holds every published number and trend against ours, wear to the loss of the preload for
        three mating heights included; life wears the rig with one thing changed at a time.
    scene
        Name of a scene of this rig or a .toml file.
    column
        fit: the section of the column too, minutes.
    wear
        fit: the wear coefficient too, from a whole wear run, minutes.
    change
        life: what to change, such as "damping.modal=1 %" or several joined by ";", can be repeated; what the published
        text leaves open by default.
    out
        study: folder of table and pictures; results/rig_study by default.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.cases.rig import fit as rig_fit
    from tribodyn.workflows.cases.rig import life as rig_life
    from tribodyn.workflows.cases.rig import study as rig_study
    from tribodyn.workflows.cases.rig import table as rig_table

    if change and work != "life":
        raise ValueError(f"--change is for rig life; for rig {work} use --set")
    if work == "life":
        rows = rig_life.run(scene, overrides, change, aside)
        print(json.dumps(rig_life.as_records(rows), indent=2) if as_json else rig_life.as_text(rows))
        return
    if work == "fit":
        fits = rig_fit.run(scene, overrides, column, wear, aside)
        print(json.dumps(rig_fit.as_records(fits), indent=2) if as_json else rig_fit.as_text(fits))
        return
    make_room(out)
    table, paths = rig_study.run(scene, overrides, out or Path("results") / "rig_study", aside)
    if as_json:
        print(json.dumps({**rig_table.as_records(table), "files": [str(path) for path in paths]}, indent=2))
    else:
        print(rig_table.as_text(table))
        print(*paths, sep="\n")


COMMANDS = (leaf, blade, rig)
