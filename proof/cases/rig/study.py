"""The fretting rig beside the published experiment and simulation: ./tribodyn prove rig study."""

from collections.abc import Callable, Sequence
from pathlib import Path

from proof.cases.rig import cases as rig_cases, figures as rig_figures, model as rig_model, table as rig_table
from tribodyn.workflows.scene.scene_file import read_scene


def run(
    scene: str, overrides: Sequence[str], folder: Path, tell: Callable[[str], None]
) -> tuple[rig_table.Table, list[Path]]:
    """Compute the study of the rig of a scene with changes, and write its table and pictures into a folder.

    tell : called with a sentence on what is under way"""
    file = read_scene(scene, overrides)
    rig_model.check(file)
    study = rig_cases.compute(file, tell)
    table = rig_table.table(study)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "comparison.md"
    path.write_text(rig_table.as_text(table), encoding="utf-8")
    return table, [path, *rig_figures.draw(study, folder)]
