"""Words of `prove` that serve the shrouded bladed disk: prove blade."""

from pathlib import Path
from typing import Literal

from proof.words import report_progress
from tribodyn.workflows.command.word import Overrides, make_room, quantity


def blade(
    work: Literal["study", "mistuned"],
    scene: str = "blade_thesis",
    *,
    overrides: Overrides = (),
    speed: str | None = None,
    out: Path | None = None,
) -> None:
    """Of the shrouded bladed disk: figures 4.11 to 4.17 and table 4.4 of the thesis beside ours.

    Parameters
    ----------
    work
        study draws nodal diameters, responses to engine orders and to rising forces, and wear for several wear steps;
        mistuned solves all blades of a small wheel at once, their stiffnesses a few per cent apart; `tribodyn mistuned`
        does so for any wheel.
    scene
        Name of a scene with a [wheel] or a .toml file.
    speed
        Highest speed of a Campbell diagram, such as 6000rpm; no diagram by default.
    out
        Folder of tables and pictures; results/blade_study by default."""
    from proof.cases.blade import study as blade_study
    from proof.cases.blade.few_sectors import FEW_SECTORS
    from tribodyn.workflows.studies.wheels.unequal_sectors import mistuned

    highest = None if speed is None else quantity("--speed", speed, "Hz")
    make_room(out)
    folder = out or Path("results") / f"blade_{work}"
    if work == "study":
        written = blade_study.run(scene, overrides, folder, highest, report_progress, blade_study.Extent())
    else:
        result = mistuned(scene, overrides=(*FEW_SECTORS, *overrides))
        written = result.write(folder)
        print(f"largest amplitude over that of blades alike: {result.amplification:.3f}")
    for path in written:
        print(path)
