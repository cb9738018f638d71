"""Words of the command `tribodyn` that study a scene: one change at a time, folds in time, mistuning, supports."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tribodyn.workflows.command.words import Changes, Flag, Json, Overrides, aside, make_room, quantity

Films = Annotated[tuple[str, ...], Parameter(name="--format", negative=(), consume_multiple=True)]
Areas = Annotated[tuple[str, ...], Parameter(name="--area", negative=(), consume_multiple=False)]


def vary(
    scene: str,
    *,
    change: Changes,
    fit: Path | None = None,
    overrides: Overrides = (),
    as_json: Json = False,
) -> None:
    """Change one thing of a scene at a time, and say what each change does to its peak, energy, depth and life.

    Parameters
    ----------
    scene
        Name of a scene (see `tribodyn list`) or a .toml file.
    change
        Key to change, such as "damping.modal=2 %", or several joined by ";"; can be repeated.
    fit
        File of a fit, as for `tribodyn identify`, that is done again for every change, such as of a preload.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.studies import variation
    from tribodyn.workflows.studies.fits import fit_file

    if not change:
        raise ValueError('--change: say what is to change, such as --change "damping.modal=2 %"')
    task = None if fit is None else fit_file.read(fit)
    rows = variation.vary(scene, change, overrides, task, aside)
    print(json.dumps(variation.as_records(rows), indent=2) if as_json else variation.as_text(rows))


def folds(scene: str, *, within: str = "2 %", overrides: Overrides = (), as_json: Json = False) -> None:
    """Find the folds of the response by harmonic balance, and where the same branches end in time integration.

    Parameters
    ----------
    scene
        Name of a scene (see `tribodyn list`) or a .toml file.
    within
        Distance to the fold of the balance within which its end in time is looked for.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.api import whole_scenes
    from tribodyn.workflows.run.progress import Progress, console_progress

    bracket = quantity("--within", within, "")
    if not 0 < bracket < 1:
        raise ValueError(f"--within {within}: give a share between 0 and 100 %")
    progress = Progress() if as_json else console_progress()
    found = whole_scenes.folds(scene, bracket, overrides=overrides, progress=progress)
    if as_json:
        print(json.dumps(found.record(), indent=2))
        return
    if not found.folds:
        print(f"no folds: the response {found.branch.end}")
    for row in found.record():
        said = f"balance {row['balance_hz']:.6g} Hz"
        if row["time_hz"] is not None:
            said += f", in time {row['time_hz']:.6g} Hz (known to {100 * row['resolution']:.2g} %): the balance is "
            said += f"{100 * row['difference']:+.3g} % off"
        else:
            said += f": {row['outcome']}"
        print(said)


def mistuned(
    scene: str,
    *,
    stiffness: str | None = None,
    spread: str = "2 %",
    seed: int = 1,
    overrides: Overrides = (),
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """Solve all sectors of a wheel at once, their stiffnesses a little apart, beside sectors alike.

    Parameters
    ----------
    scene
        Name of a scene with a [wheel], or a .toml file.
    stiffness
        Factor on the stiffness of every sector, such as "1.02, 0.99, 1, 0.98"; drawn by default.
    spread
        Standard deviation of the factors that are drawn.
    seed
        Seed of the draw; the same seed gives the same factors.
    out
        Folder of mistuned.csv and mistuned.png; results/NAME by default.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.scene import scene_file
    from tribodyn.workflows.studies.wheels import mistuning as one_wheel

    make_room(out)
    factors = None if stiffness is None else [quantity("--stiffness", one, "") for one in stiffness.split(",")]
    file = scene_file.read(scene, overrides)
    found = one_wheel.respond(file, factors, quantity("--spread", spread, ""), seed)
    folder = out or Path("results") / file.name
    folder.mkdir(parents=True, exist_ok=True)
    one_wheel.write(found, folder / "mistuned.csv")
    one_wheel.picture(found).savefig(folder / "mistuned.png")
    if as_json:
        print(json.dumps(found.record(), indent=2))
        return
    print("factors on the stiffness: " + ", ".join(f"{factor:.4f}" for factor in found.stiffness))
    print(f"largest amplitude over that of sectors alike: {found.amplification:.3f}")
    print(folder / "mistuned.csv", folder / "mistuned.png", sep="\n")


def mistuning(
    scene: str,
    *,
    wear: int | None = None,
    show: int | None = None,
    formats: Films = (),
    workers: int | None = None,
    resume: Flag = False,
    overrides: Overrides = (),
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """Draw patterns of blades that differ, and tell how far they amplify; contact acts on every blade of each.

    Parameters
    ----------
    scene
        Name of a scene with [wheel] and [mistuning], or a .toml file.
    wear
        Number of a pattern whose wheel wears by the scene's [wear] instead.
    show
        Number of a pattern whose wheel is drawn at its highest peak instead, all blades at one instant.
    formats
        gif or mp4, or both: a film of the drawn or worn wheel over one cycle.
    workers
        Processes; as many as there are cores by default.
    resume
        Take the rows that the folder holds of the same patterns.
    out
        Folder of tables and pictures; results/NAME by default.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.pictures.offscreen import RenderingUnavailable
    from tribodyn.workflows.run.progress import Progress, console_progress
    from tribodyn.workflows.scene import scene_file
    from tribodyn.workflows.studies.wheels import mistuned_motion, mistuned_wear, patterns

    make_room(out)
    file = scene_file.read(scene, overrides)
    folder = out or Path("results") / file.name
    for word, number in (("--wear", wear), ("--show", show)):
        if number is not None and number < 1:
            raise ValueError(f"{word} {number}: patterns are counted from 1")
    if show is not None:
        blades = patterns.Blades.of(file)
        state = mistuned_motion.at_peak(blades, show)
        drawn = mistuned_motion.write(blades, [state], folder, formats)
        record, said = {"pattern": show, "amplitude_m": state.heights.tolist()}, [state.label]
        print(json.dumps(record, indent=2) if as_json else "\n".join(map(str, [*said, *drawn])))
        return
    drawn = []
    if wear is not None:
        blades = patterns.Blades.of(file)
        worn = mistuned_wear.study(
            file, wear, lambda row: aside(f"{row.cycles:.4g} cycles, {1e6 * row.depth.max():.4g} um"), blades
        )
        folder.mkdir(parents=True, exist_ok=True)
        try:
            drawn = mistuned_motion.write(blades, mistuned_motion.worn_states(blades, worn), folder, formats)
        except RenderingUnavailable as error:
            aside(str(error))
        mistuned_wear.write(worn, table := folder / "mistuned_wear.csv")
        mistuned_wear.picture(worn).savefig(drawing := folder / "mistuned_wear.png")
        record, said = worn.record(), worn.lines()
    else:
        progress = Progress() if as_json else console_progress()
        found = patterns.run(file, folder, progress, workers, resume)
        table, drawing = folder / "patterns.csv", folder / "mistuning.png"
        if found.complete:
            patterns.picture(found).savefig(drawing)
        record, said = found.record(), found.lines()
    if as_json:
        print(json.dumps(record, indent=2))
        return
    print(*said, table, *([drawing] if drawing.exists() else []), *drawn, sep="\n")


def supports(
    result: Path,
    *,
    area: Areas = (),
    coefficient: str | None = None,
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """Wear by impacts at the supports of a part, springs to the ground whose displacement is observed.

    Parameters
    ----------
    result
        Folder or file of a result.
    area
        Bearing area of a support's seat, such as "left_pin=9.8 mm2"; can be repeated.
    coefficient
        Coefficient of impact wear, such as "2e3 um3/J".
    out
        File of a table over frequency (.csv); beside the result by default.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.studies import scenes
    from tribodyn.workflows.studies import supports as study

    make_room(out, (".csv",))
    areas = {}
    for text in area:
        name, equals, value = text.partition("=")
        if not equals:
            raise ValueError(f'--area {text}: give the name of a spring and its area, such as "left_pin=9.8 mm2"')
        areas[name.strip()] = quantity("--area", value, "m2")
    alpha = None if coefficient is None else quantity("--coefficient", coefficient, "m3/J")
    path = scenes.result_file(result)
    found = study.support_wear(scenes.load(path), areas, alpha)
    table = out or path.parent / "supports.csv"
    study.write(found, table)
    if as_json:
        print(json.dumps(study.record(found), indent=2))
        return
    for row in study.record(found):
        depth = row["depth_m_per_cycle"]
        said = "" if depth is None else f", {depth:.4g} m of depth"
        print(f"{row['support']:16} at most {row['work_J']:.4g} J per cycle{said}, at {row['hz']:.6g} Hz")
    print(table)


COMMANDS = (vary, folds, mistuned, mistuning, supports)
