"""Words of `prove` that serve the fretting rig: prove rig."""

from pathlib import Path
from typing import Literal

from proof.words import report_progress
from tribodyn.workflows.command.word import Flag, Overrides, make_room


def rig(
    work: Literal["fit", "study"],
    scene: str = "rig_thesis",
    *,
    column: Flag = False,
    wear: Flag = False,
    overrides: Overrides = (),
    out: Path | None = None,
) -> None:
    """Of the fretting rig: fits of what is not published, and its comparison with the published experiment.

    Parameters
    ----------
    work
        fit looks for joint springs, platform height and damping that give published numbers, and says how well these
        determine them; study holds every published number and trend against ours, wear to the loss of the preload for
        three mating heights included.
    scene
        Name of a scene of this rig or a .toml file.
    column
        fit: the section of the column too, minutes.
    wear
        fit: the wear coefficient too, from a whole wear run, minutes.
    out
        study: folder of table and pictures; results/rig_study by default."""
    from proof.cases.rig import cases, figures, fit as rig_fit, model, table as rig_table
    from tribodyn.workflows.scene.scene_file import read_scene

    if work == "fit":
        print(rig_fit.as_text(rig_fit.run(scene, overrides, column, wear, report_progress)))
        return
    make_room(out)
    file, folder = read_scene(scene, overrides), out or Path("results") / "rig_study"
    model.check(file)
    study = cases.compute(file, report_progress)
    text, path = rig_table.as_text(rig_table.table(study)), folder / "comparison.md"
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    print(text, path, *figures.draw(study, folder), sep="\n")
