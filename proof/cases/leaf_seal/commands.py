"""Words of `prove` that serve the leaf seal: prove leaf."""

from pathlib import Path
from typing import Literal

from proof.words import report_progress
from tribodyn.workflows.command.word import make_room


def leaf(work: Literal["fit", "check", "study"], *, out: Path | None = None) -> None:
    """Of the leaf seal: the fit of its dimensions and its parameter study.

    Parameters
    ----------
    work
        fit looks for the dimensions that give the published frequency ratios, check shows those of the scene; study
        runs some thirty configurations.
    out
        study: folder of tables and pictures; results/leaf_study by default."""
    from proof.cases.leaf_seal import fit, study
    from tribodyn.workflows.scene.scene_file import read_scene

    make_room(out)
    if work == "study":
        study.whole(out or Path("results/leaf_study"), lambda line: print(line, flush=True))
    elif work == "check":
        print(fit.as_text(fit.of_scene(read_scene("leaf_seal_thesis").mesh_scene)))
    else:
        print(fit.as_text(fit.search(report_progress)))
