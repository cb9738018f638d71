"""The command `tribodyn`: thin words around scene, pipeline, store and pictures."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import cyclopts
from cyclopts import Parameter

from tribodyn.version import __version__
from tribodyn.workflows.command import exits, found
from tribodyn.workflows.command.words import Flag, Json, Overrides, make_room, print_lines, quantity
from tribodyn.workflows.scene import scene_file

if TYPE_CHECKING:
    from tribodyn.workflows.result.result import Result

Formats = Annotated[tuple[str, ...], Parameter(name="--format", negative=(), consume_multiple=True)]

app = cyclopts.App(
    name="tribodyn",
    help="From geometry to worn surface: vibration, friction and fretting wear of jointed parts.",
    version=__version__,
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,
)
for command in found.commands():
    app.command(command)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command and leave with its exit code, see workflows.exits."""
    exits.guard(lambda: _run(arguments))


def _run(arguments: Sequence[str] | None) -> None:
    try:
        app(arguments, exit_on_error=False, print_error=False)
    except cyclopts.UnknownCommandError as error:  # it names eight of them at the most
        asked = str(error).partition(" Available commands:")[0].rstrip(". ")
        known = ", ".join(sorted(word for word in app if not word.startswith("-")))
        raise ValueError(f"{asked}{'' if asked.endswith('?') else '.'} Available commands: {known}") from None


@app.command
def run(
    scene: str,
    *,
    overrides: Overrides = (),
    accuracy: str | None = None,
    out: Path | None = None,
    resume: Flag = False,
    pictures: Annotated[bool, Parameter(negative="--no-pictures")] = True,
    quiet: Flag = False,
    log: Path | None = None,
) -> None:
    """Run a scene and leave its result and pictures in a folder.

    A scene may name Python files beside it: running somebody's scene runs his code.

    Parameters
    ----------
    scene
        Name of a scene (see `tribodyn list`) or a .toml file.
    accuracy
        Relative error wanted, such as "1 %", or of what is named, "1 % of energy": the scene is run with finer and
        finer settings until the errors of its verdict are below that; exit code 3 where they do not get there. Without
        depth or life in it nothing is worn. "1 % of life given harmonics" leaves a setting as the scene has it, and
        its error out.
    out
        Folder of the result; results/NAME by default.
    resume
        Resume an unfinished result in the folder.
    pictures
        Draw curves, maps and renders when done.
    quiet
        Print nothing but what goes wrong.
    log
        File to which every line of progress is added, with its time.
    """
    from tribodyn.workflows.run.failure import SolveFailed
    from tribodyn.workflows.run.progress import console_progress
    from tribodyn.workflows.studies import scenes

    make_room(out)
    progress = console_progress(quiet, log)
    file = scene_file.read(scene, overrides)
    folder = out or Path("results") / file.name
    path = folder / "result.h5"
    try:
        if accuracy is not None:
            result, bound = scenes.run_to_accuracy(file, accuracy, folder, progress=progress, resume=resume)
        else:
            result, bound = scenes.run(file, folder, progress=progress, resume=resume), None
    except KeyboardInterrupt:
        raise KeyboardInterrupt(_kept(path, scene, file.overrides)) from None
    except SolveFailed as failure:
        raise SolveFailed(f"{failure}; what was computed before is kept in {path}") from None
    if not quiet:
        _print_summary(result)
    progress.say(f"result: {path}")
    if pictures:
        _draw(result, folder / "pictures", tell=progress.say)
    if bound is not None and not bound.met:
        raise RuntimeError(f"{bound.sentence}; the result is kept in {path}")


def _kept(path: Path, scene: str, overrides: Sequence[str]) -> str:
    from tribodyn.workflows.result import store

    if not path.exists():
        return "stopped before anything was computed"
    words = [scene, "--out", str(path.parent), *(word for text in overrides for word in ("--set", text))]
    return f"stopped, {store.load(path).state}, kept in {path}: resume with tribodyn run {shlex.join(words)} --resume"


@app.command(name="list")
def list_() -> None:
    """List the scenes that come with the program."""
    for name in scene_file.names():
        print(f"{name:12} {scene_file.title(name)}")


@app.command
def show(result: Path, *, as_json: Json = False) -> None:
    """Say what a result holds.

    Parameters
    ----------
    result
        Folder or file of a result.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.studies import scenes

    loaded = scenes.load(result)
    if as_json:
        print(json.dumps(loaded.summary(), indent=2))
    else:
        _print_summary(loaded)


@app.command
def render(result: Path, *, out: Path | None = None, formats: Formats = ("png",), dpi: int = 200) -> None:
    """Draw the pictures of a result again.

    Parameters
    ----------
    result
        Folder or file of a result.
    out
        Folder of the pictures; beside the result by default.
    formats
        png, pdf or svg, can be repeated.
    dpi
        Dots per inch of png.
    """
    from tribodyn.workflows.studies import scenes

    make_room(out)
    if not 20 <= dpi <= 2400:
        raise ValueError(f"--dpi {dpi}: give 20 to 2400 dots per inch")
    _draw(scenes.load(result), out or scenes.result_file(result).parent / "pictures", formats, dpi)


@app.command
def verify(
    result: Path,
    *,
    at: str | None = None,
    row: int | None = None,
    states: int | None = None,
    wear: Flag = False,
    steps: int | None = None,
    overrides: Overrides = (),
    out: Path | None = None,
    as_json: Json = False,
) -> None:
    """Check a result against direct time integration of the same model with the same contact law.

    Parameters
    ----------
    result
        Folder or file of a result.
    at
        Frequency such as 410Hz; the peak of the response, or the frequency of the row, by default.
    row
        Wear row whose depth the contact has; unworn by default.
    states
        So many worn states of a wear run, spread over its cycles, one line each.
    wear
        Wear the contact along the motion in time, at the frequencies of the run, and hold its life against the run's.
    steps
        Time steps per period; 256 or 32 for each harmonic by default.
    out
        Folder of the picture; beside the result by default.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.api import whole_scenes
    from tribodyn.workflows.run.failure import SolveFailed
    from tribodyn.workflows.run.progress import Progress, console_progress
    from tribodyn.workflows.studies import scenes, verification, worn_in_time, worn_states

    make_room(out)
    if sum((states is not None, wear, at is not None or row is not None)) > 1:
        raise ValueError("expected one of --states, --wear, and --at with --row")
    hertz = None if at is None else quantity("--at", at, "Hz")
    progress = Progress() if as_json else console_progress()
    folder = out or scenes.result_file(result).parent / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    if states is not None:
        held = scenes.load(result)
        along = whole_scenes.verify_wear(held, states, steps=steps, overrides=overrides, progress=progress)
        picture = folder / "verify_states.png"
        worn_states.picture(held, along).savefig(picture)
        if as_json:
            print(json.dumps({"states": [state.record() for state in along], "picture": str(picture)}, indent=2))
        else:
            print("\n".join([worn_states.HEADER, *(state.line() for state in along), str(picture)]))
        return
    if wear:
        table = folder / "wear_in_time.csv"
        life = whole_scenes.wear_in_time(result, table, steps=steps, overrides=overrides, progress=progress)
        picture = folder / "wear_in_time.png"
        worn_in_time.picture(life).savefig(picture)
        if as_json:
            print(json.dumps({**life.record(), "picture": str(picture), "table": str(table)}, indent=2))
        else:
            print("\n".join([*life.lines(), str(table), str(picture)]))
        return
    found = whole_scenes.verify(result, hertz, row=row, steps=steps, overrides=overrides, progress=progress)
    picture = folder / f"verify_{found.hertz:.6g}Hz{'' if row is None else f'_row{row}'}.png"
    verification.picture(found).savefig(picture)
    if as_json:
        print(json.dumps({**found.record(), "picture": str(picture)}, indent=2))
    else:
        print_lines(found.lines())
        print(picture)
    if not found.found.motion.periodic:
        raise SolveFailed(f"the time integration found no periodic motion: {found.found.outcome}")


@app.command
def plan(scene: str, *, overrides: Overrides = ()) -> None:
    """Say what a scene will model, and what it will cost, before running it.

    Parameters
    ----------
    scene
        Name of a scene (see `tribodyn list`) or a .toml file.
    """
    from tribodyn.workflows.studies import scenes

    print_lines(scenes.plan(scene, overrides).lines())


def _print_summary(result: Result) -> None:
    from tribodyn.workflows.report import text

    print_lines(text.lines(result))


def _draw(
    result: Result,
    folder: Path,
    formats: Sequence[str] = ("png",),
    dpi: int | None = None,
    tell: Callable[[str], None] = print,
) -> None:
    from tribodyn.workflows.studies import scenes

    written, missing = scenes.draw(result, folder, formats, dpi)
    for line in (*([missing] if missing else []), *map(str, written)):
        tell(line)


if __name__ == "__main__":
    main()
