"""Words of `prove` that serve the fretting rig: prove rig."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

from proof.words import Changes, report_progress
from tribodyn.refusal import Refusal
from tribodyn.workflows.command.word import Flag, Json, Overrides, make_room


def rig(
    work: Literal["fit", "study", "life"],
    scene: str = "rig_thesis",
    *,
    column: Flag = False,
    wear: Flag = False,
    change: Changes = (),
    overrides: Overrides = (),
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """Of the fretting rig: fits of what is not published, and its comparison with the published experiment.

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
    from proof.cases.rig import fit as rig_fit, life as rig_life, study as rig_study, table as rig_table

    if change and work != "life":
        raise Refusal(f"--change is for rig life; for rig {work} use --set")
    if work == "life":
        rows = rig_life.run(scene, overrides, change, report_progress)
        print(json.dumps(rig_life.as_records(rows), indent=2) if as_json else rig_life.as_text(rows))
        return
    if work == "fit":
        fits = rig_fit.run(scene, overrides, column, wear, report_progress)
        print(json.dumps(rig_fit.as_records(fits), indent=2) if as_json else rig_fit.as_text(fits))
        return
    make_room(out)
    table, paths = rig_study.run(scene, overrides, out or Path("results") / "rig_study", report_progress)
    if as_json:
        print(json.dumps({**rig_table.as_records(table), "files": [str(path) for path in paths]}, indent=2))
    else:
        print(rig_table.as_text(table))
        print(*paths, sep="\n")
