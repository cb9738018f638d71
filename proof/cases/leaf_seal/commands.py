"""Words of `prove` that serve the leaf seal: prove leaf."""

import json
import sys
from pathlib import Path
from typing import Literal

from proof.words import report_progress
from tribodyn.refusal import Refusal
from tribodyn.workflows.command.word import Flag, Json, make_room


def leaf(
    work: Literal["fit", "check", "study"],
    *,
    out: Path | None = None,
    resume: Flag = False,
    as_json: Json = False,
) -> None:
    """Of the leaf seal: the fit of its dimensions and its parameter study.

    Parameters
    ----------
    work
        fit looks for the dimensions that give the published frequency ratios, check shows those of the scene; study
        runs some thirty configurations.
    out
        study: folder of tables and pictures; results/leaf_study by default.
    resume
        Resume a study with what is complete in its folder.
    as_json
        Print JSON for machines."""
    from proof.cases.leaf_seal import fit, study
    from tribodyn.workflows.scene.scene_file import read_scene

    make_room(out)
    folder = out or Path("results") / f"leaf_{work}"
    if resume and work != "study":
        raise Refusal(f"--resume is for leaf study, leaf {work} has nothing to resume: run it without")

    def tell(line: str) -> None:
        print(line, file=sys.stderr if as_json else sys.stdout, flush=True)

    if work == "study":
        full = study.whole(folder, resume, tell)
        message, record = full.text(), full.record()
    else:
        item = (
            fit.of_scene(read_scene("leaf_seal_thesis").mesh_scene) if work == "check" else fit.search(report_progress)
        )
        message, record = fit.as_text(item), item.record()
    print(json.dumps(record, indent=2) if as_json else message)
