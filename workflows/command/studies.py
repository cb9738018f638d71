"""Words of the command `tribodyn` that measure cost and accuracy, follow a number, or fit numbers to measured ones."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from tribodyn.workflows.command.words import PICTURE, Flag, Json, Overrides, aside, make_room, quantity

Settings = Annotated[tuple[str, ...], Parameter(name="--setting", negative=(), consume_multiple=False)]


def trade(
    scene: str,
    *,
    setting: Settings = (),
    overrides: Overrides = (),
    most: int = 99,
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """Measure what each setting costs and what it is worth, against where it tends to on the same scene.

    Parameters
    ----------
    scene
        Name of a scene or a .toml file.
    setting
        Setting to measure, can be repeated; the others of an earlier table stay. All by default.
    most
        Values of each setting, the finest ones.
    out
        Table to write (.json), its plot beside it (.png); results/NAME/trade.json by default.
    as_json
        Print JSON for machines.
    """
    if most < 1:
        raise ValueError(f"--most {most}: a setting needs one value at least")
    from tribodyn.workflows.api import whole_scenes
    from tribodyn.workflows.errors import choice, trade, trade_picture, trade_table

    make_room(out, (".json",))
    path = out or Path("results") / Path(scene).stem / "trade.json"
    earlier = trade_table.load(path) if setting and path.exists() else None

    def keep(table: trade_table.Trade) -> None:
        trade_table.save(table, path)

    found = whole_scenes.trade(
        scene, setting, most=most, overrides=overrides, progress=aside, keep=keep, earlier=earlier
    )
    trade_picture.picture(found).savefig(path.with_suffix(".png"))
    if as_json:
        print(json.dumps(trade.as_records(found), indent=2))
    else:
        print(trade.as_text(found))
        print(*choice.advice(found), path, path.with_suffix(".png"), sep="\n")


def converge(
    scene: str, *, overrides: Overrides = (), most: float = 99, out: Path | None = None, as_json: Json = False
) -> None:
    """Refine the contact grid and the mesh until the answers settle, and say which grid a per cent needs.

    Parameters
    ----------
    scene
        Name of a scene with a study of its grids.
    most
        Finest grid, in nodes along the patch.
    out
        Folder of the plots; results/NAME by default.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.api import whole_scenes
    from tribodyn.workflows.errors import converge as study

    make_room(out)
    found = whole_scenes.converge(scene, most=most, overrides=overrides, progress=aside)
    folder = out or Path("results") / found[0].scene
    folder.mkdir(parents=True, exist_ok=True)
    pictures = [folder / f"converge_{one.scene}_{one.ladder}.png" for one in found]
    for one, path in zip(found, pictures, strict=True):
        study.picture(one).savefig(path, dpi=110)
    if as_json:
        print(json.dumps(study.as_records(found), indent=2))
    else:
        print(study.as_text(found), *pictures, sep="\n")


def track(
    scene: str,
    *,
    against: Literal["load", "gap", "stiffness", "friction", "wear"],
    start: Annotated[str, Parameter(name="--from")],
    stop: Annotated[str, Parameter(name="--to")],
    fold: int | None = None,
    points: int | None = None,
    worn: Path | None = None,
    overrides: Overrides = (),
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """Follow the resonance peak, or a fold of the response, while load, gap, stiffness, friction or wear changes.

    Parameters
    ----------
    scene
        Name of a scene (see `tribodyn list`) or a .toml file.
    against
        What changes: a factor on the harmonic loads, an opening added to every gap, a factor on the contact springs or
        on the friction coefficients, or the share of the depth of a worn result.
    start
        Value to begin at, such as 1 or, for the gap, 0um.
    stop
        Value to end at.
    fold
        Number of the fold to follow, 1 for that of the highest frequency; the peak by default.
    points
        Values of the peak (21), or the most that a line of folds may have (500).
    worn
        Folder of the result whose last depth is a wear of one.
    out
        Folder of track.csv and track.png; results/NAME by default.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.api import whole_scenes
    from tribodyn.workflows.run.progress import Progress, console_progress
    from tribodyn.workflows.scene import scene_file
    from tribodyn.workflows.studies.curves import tracking

    make_room(out)
    unit = tracking.UNITS[against]
    ends = quantity("--from", start, unit), quantity("--to", stop, unit)
    file = scene_file.read(scene, overrides)
    progress = Progress() if as_json else console_progress()
    found = whole_scenes.track(file, against, *ends, fold=fold, points=points, worn=worn, progress=progress)
    folder = out or Path("results") / file.name
    folder.mkdir(parents=True, exist_ok=True)
    tracking.write(found, folder / "track.csv")
    tracking.picture(found).savefig(folder / "track.png")
    if as_json:
        print(json.dumps(found.record(), indent=2))
    else:
        for value, hertz, amplitude in zip(found.value, found.frequency, found.amplitude, strict=True):
            print(f"{found.name} {f'{value:.6g} {found.unit}':14} {hertz:12.6g} Hz {amplitude:12.6g} m")
        print(f"{found.what}: {found.end}", folder / "track.csv", folder / "track.png", sep="\n")


def identify(
    scene: str,
    task: Path,
    *,
    posterior: Flag = False,
    trials: int = 100,
    seed: int = 0,
    out: Path | None = None,
    overrides: Overrides = (),
    as_json: Json = False,
) -> None:
    """Fit named numbers of a scene to measured ones, within bounds, and say how well these determine them.

    Parameters
    ----------
    scene
        Name of a scene or a .toml file; nothing is written into it.
    task
        File with the numbers that are looked for and those that were measured, as cases/rig/rig.fit.toml.
    posterior
        Sample what the measured numbers, each with its error, leave of the others, instead of the best fit.
    trials
        Runs of the scene that the posterior may take.
    seed
        Of the posterior's samples.
    out
        Picture of the posterior.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.api import whole_scenes

    if posterior:
        make_room(out, PICTURE)
        known = whole_scenes.posterior(scene, task, trials=trials, seed=seed, overrides=overrides, progress=aside)
        if out is not None:
            known.plot().savefig(out)
        print(json.dumps(known.record(), indent=2) if as_json else "\n".join(known.lines()))
        return
    if out is not None:
        raise ValueError("--out is the picture of a posterior: give --posterior too")
    found, changes = whole_scenes.fit(scene, task, overrides=overrides, progress=aside)
    if as_json:
        print(json.dumps({**found.record(), "set": changes}, indent=2))
    else:
        print(found.report(), "", "to go on with what was found:", *(f'  --set "{c}"' for c in changes), sep="\n")


COMMANDS = (trade, converge, track, identify)
