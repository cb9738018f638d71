"""The command `tribodyn`: thin words around scene, pipeline, store and pictures."""

from __future__ import annotations

import json
import math
import shlex
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import cyclopts
from cyclopts import Parameter

from workflows import cli_studies, scene_file
from workflows.cli_studies import Overrides, aside

if TYPE_CHECKING:
    from workflows.result import Result

BAD_INPUT, FAILED_SOLVE, INTERRUPTED = 2, 3, 130

app = cyclopts.App(
    name="tribodyn",
    help="From geometry to worn surface: vibration, friction and fretting wear of jointed parts.",
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,
)
for command in cli_studies.COMMANDS:
    app.command(command)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command and leave with its exit code: 2 after bad input, 3 after a failed solve, 130 after Ctrl-C."""
    # a shell without job control starts background jobs with Ctrl-C ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        app(arguments, exit_on_error=False, print_error=False)
    except KeyboardInterrupt as stop:
        _leave(INTERRUPTED, str(stop) or "stopped")
    except cyclopts.CycloptsError as error:
        _leave(BAD_INPUT, " ".join(str(error).split()))
    except (ValueError, OSError) as error:
        _leave(BAD_INPUT, str(error))
    except (RuntimeError, MemoryError) as error:
        _leave(FAILED_SOLVE, str(error) or "the memory of this machine is not enough for this scene")


def _leave(code: int, sentence: str) -> None:
    one_line = " ".join(sentence.split()).rstrip(".")
    print(f"tribodyn: {one_line}{'' if one_line.endswith('?') else '.'}", file=sys.stderr)
    sys.exit(code)


@app.command
def run(
    scene: str,
    *,
    overrides: Overrides = (),
    accuracy: str | None = None,
    table: Path | None = None,
    out: Path | None = None,
    resume: Annotated[bool, Parameter(negative=())] = False,
    pictures: Annotated[bool, Parameter(negative="--no-pictures")] = True,
) -> None:
    """Run a scene and leave its result and pictures in a folder.

    Parameters
    ----------
    scene
        Name of a scene (see `tribodyn list`) or a .toml file.
    accuracy
        Relative error wanted, of as much as can be promised, such as "1 %", or of what is named, "1 % of energy": the
        cheapest settings that promise it are taken; without depth or life in it nothing is worn. "1 % of life given
        harmonics" leaves a knob as the scene has it, and its error out.
    table
        The trade to go by; results/NAME/trade.json or the one that comes with the program unless told.
    out
        Folder of the result; results/NAME unless told.
    resume
        Go on from an unfinished result in the folder.
    pictures
        Draw curves, maps and renders when done.
    """
    from workflows import pipeline
    from workflows.accuracy import tuned
    from workflows.progress import console_progress

    progress = console_progress()
    if accuracy is None:
        file = scene_file.read(scene, overrides)
    else:
        file, promise = tuned(scene, overrides, accuracy, table)
        progress.say(promise.sentence)
    folder = out or Path("results") / file.name
    path = folder / "result.h5"
    earlier = _earlier(path, file) if resume else None
    if earlier is not None and pipeline.is_complete(earlier, file.scene):
        progress.say(f"{path} is complete already")
        result = earlier
    else:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            result = pipeline.run(file, folder, progress, earlier)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(_kept(path, scene, file.overrides)) from None
        except pipeline.SolveFailed as failure:
            raise pipeline.SolveFailed(f"{failure}; what was computed before is kept in {path}") from None
    _print_summary(result)
    progress.say(f"result: {path}")
    if pictures:
        _draw(result, folder / "pictures")


def _earlier(path: Path, file: scene_file.SceneFile) -> Result | None:
    """The unfinished result to go on from, None where there is none yet."""
    from workflows import pipeline, store

    if not path.exists():
        return None
    result = store.load(path)
    key = pipeline.same_problem(scene_file.from_json(result.provenance["scene"]), file.scene)
    if key:
        raise ValueError(f"{path} is the result of another scene, {key} differs: run its scene, or without --resume")
    return result


def _kept(path: Path, scene: str, overrides: Sequence[str]) -> str:
    from workflows import store

    if not path.exists():
        return "stopped before anything was computed"
    words = [scene, "--out", str(path.parent), *(word for text in overrides for word in ("--set", text))]
    return f"stopped, {store.load(path).state}, kept in {path}: go on with tribodyn run {shlex.join(words)} --resume"


@app.command(name="list")
def list_() -> None:
    """List the scenes that come with the program."""
    for name in scene_file.names():
        print(f"{name:12} {scene_file.title(name)}")


@app.command
def bench(
    *,
    quick: Annotated[bool, Parameter(negative=())] = False,
    scaling: Annotated[bool, Parameter(negative=())] = False,
    out: Path = Path("scaling.png"),
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> None:
    """Measure the solver beside the dense algorithm of the thesis on the beam scene (tables 7.1 to 7.3).

    Parameters
    ----------
    quick
        Harmonics 0+1 and 0+3 on one thread, in under a minute; with --scaling up to 13 x 13 contact nodes.
    scaling
        Time and memory of one response at 0+3 from 5 x 5 to 31 x 31 contact nodes instead, with a plot.
    out
        File of that plot.
    as_json
        Print JSON for machines.
    """
    from workflows import bench as benchmark

    if scaling:
        _scaling(quick, out, as_json)
        return
    rows = benchmark.run(quick, aside)
    print(json.dumps(benchmark.as_records(rows), indent=2) if as_json else benchmark.as_text(rows))


def _scaling(quick: bool, out: Path, as_json: bool) -> None:
    from workflows import scaling as measured
    from workflows.progress import Progress, console_progress

    progress = Progress() if as_json else console_progress()
    rows = measured.run(measured.QUICK if quick else measured.FULL, progress.say)
    measured.picture(rows).savefig(out)
    if as_json:
        print(json.dumps({**measured.as_records(rows), "picture": str(out)}, indent=2))
    else:
        print(measured.as_text(rows))
        print(out)


@app.command
def show(result: Path, *, as_json: Annotated[bool, Parameter(name="--json", negative=())] = False) -> None:
    """Say what a result holds.

    Parameters
    ----------
    result
        Folder or file of a result.
    as_json
        Print JSON for machines.
    """
    from workflows import store, summary

    loaded = store.load(_result_file(result))
    if as_json:
        print(json.dumps(summary.summary(loaded), indent=2))
    else:
        _print_summary(loaded)


@app.command
def render(result: Path, *, out: Path | None = None) -> None:
    """Draw the pictures of a result again.

    Parameters
    ----------
    result
        Folder or file of a result.
    out
        Folder of the pictures; beside the result unless told.
    """
    from workflows import store

    path = _result_file(result)
    _draw(store.load(path), out or path.parent / "pictures")


@app.command
def verify(
    result: Path,
    *,
    at: str | None = None,
    row: int | None = None,
    steps: int | None = None,
    overrides: Overrides = (),
    out: Path | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> None:
    """Check a result against direct time integration of the same model with the same contact law.

    Parameters
    ----------
    result
        Folder or file of a result.
    at
        Frequency such as 410Hz; the peak of the response, or the frequency of the row, unless told.
    row
        Wear row whose depth the contact has; unworn unless told.
    steps
        Time steps per period; 256 or 32 for each harmonic unless told.
    out
        Folder of the picture; beside the result unless told.
    as_json
        Print JSON for machines.
    """
    from workflows import pipeline, store, verification
    from workflows.progress import Progress, console_progress

    path = _result_file(result)
    omega = None if at is None else 2 * math.pi * _option("--at", at, "Hz")
    progress = Progress() if as_json else console_progress()
    found = verification.compare(store.load(path), omega, row, overrides, steps, progress)
    folder = out or path.parent / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    picture = folder / f"verify_{found.hertz:.6g}Hz{'' if row is None else f'_row{row}'}.png"
    verification.picture(found).savefig(picture)
    if as_json:
        print(json.dumps({**found.record(), "picture": str(picture)}, indent=2))
    else:
        _print_lines(found.lines())
        print(picture)
    if found.found.outcome != "converged":
        raise pipeline.SolveFailed(f"the time integration found no periodic motion: {found.found.outcome}")


@app.command
def backbone(
    scene: str,
    *,
    start: Annotated[str, Parameter(name="--from")],
    stop: Annotated[str, Parameter(name="--to")],
    mode: int = 0,
    points: int = 40,
    overrides: Overrides = (),
    out: Path | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> None:
    """Follow a nonlinear mode: frequency and damping against amplitude, as a table and a plot.

    Parameters
    ----------
    scene
        Name of a scene (see `tribodyn list`) or a .toml file; its harmonic loads play no part.
    start
        Amplitude of the response to begin at, such as 1um.
    stop
        Amplitude to end at, such as 1mm.
    mode
        Number of the mode about the static equilibrium, from 0.
    points
        Points on an easy way; there are more where the backbone bends.
    out
        Folder of backbone.csv and backbone.png; results/NAME unless told.
    as_json
        Print JSON for machines.
    """
    from workflows import modes
    from workflows.progress import Progress, console_progress

    file = scene_file.read(scene, overrides)
    ends = _option("--from", start, "m"), _option("--to", stop, "m")
    found = modes.follow(file, *ends, mode, points, Progress() if as_json else console_progress())
    folder = out or Path("results") / file.name
    folder.mkdir(parents=True, exist_ok=True)
    modes.write(found, folder / "backbone.csv")
    modes.picture(found).savefig(folder / "backbone.png")
    if as_json:
        print(json.dumps(modes.record(found), indent=2))
    else:
        hertz, damping = found.omega / (2 * math.pi), 100 * found.damping
        _print_lines(
            [
                ("at rest", f"{found.reference_omega / (2 * math.pi):.6g} Hz"),
                ("frequency", f"{hertz[0]:.6g} -> {hertz[-1]:.6g} Hz"),
                ("damping", f"{damping[0]:.4g} -> {damping[-1]:.4g} %, largest {damping.max():.4g} %"),
                ("end", found.end),
            ]
        )
        print(folder / "backbone.csv", folder / "backbone.png", sep="\n")


@app.command
def plan(scene: str, *, overrides: Overrides = ()) -> None:
    """Say what a scene will model, and what it will cost, before running it.

    Parameters
    ----------
    scene
        Name of a scene (see `tribodyn list`) or a .toml file.
    """
    from workflows import planning

    _print_lines(planning.plan(scene_file.read(scene, overrides)).lines())


@app.command
def leaf(
    work: Literal["fit", "check", "study", "accuracy"],
    *,
    out: Path | None = None,
    resume: Annotated[bool, Parameter(negative=())] = False,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> None:
    """What only the leaf seal has: the fit of its dimensions, its parameter study, its accuracy.

    Parameters
    ----------
    work
        fit looks for the dimensions that give the published frequency ratios, check shows those of the scene; study
        runs some thirty configurations; accuracy holds 1 to 9 harmonics against time integration.
    out
        Folder of tables and pictures; results/leaf_study or results/leaf_accuracy unless told.
    resume
        Let a study go on with what is complete in its folder.
    as_json
        Print JSON for machines.
    """
    from workflows import leaf_accuracy, leaf_fit, leaf_study

    folder = out or Path("results") / f"leaf_{work}"
    if resume and work != "study":
        raise ValueError(f"--resume is for leaf study, leaf {work} has nothing to go on with: run it without")
    if work == "study":
        leaf_study.run(folder, resume, as_json)
    elif work == "accuracy":
        leaf_accuracy.run(folder, as_json)
    else:
        leaf_fit.run(work == "check", as_json)


@app.command
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
        Highest speed of a Campbell diagram, such as 6000rpm; no diagram unless told.
    out
        Folder of tables and pictures; results/blade_study unless told.
    """
    from workflows import blade_mistuning, blade_study

    highest = None if speed is None else _option("--speed", speed, "Hz")
    folder = out or Path("results") / f"blade_{work}"
    if work == "mistuned":
        written = blade_mistuning.run(scene, overrides, folder)
    else:
        written = blade_study.run(scene, overrides, folder, highest, aside, blade_study.Extent())
    for path in written:
        print(path)


def _option(name: str, text: str, unit: str) -> float:
    from workflows.units import to_si

    try:
        return to_si(text, unit)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _result_file(path: Path) -> Path:
    return path / "result.h5" if path.is_dir() else path


def _print_summary(result: Result) -> None:
    from workflows import summary

    _print_lines(summary.lines(result))


def _print_lines(lines: list[tuple[str, str]]) -> None:
    for name, value in lines:
        print(f"{name:14} {value}")


def _draw(result: Result, folder: Path) -> None:
    """Draw what the scene of a result wants drawn; curves come first, they need no system libraries."""
    from workflows import plots

    wanted = scene_file.from_json(result.provenance["scene"]).pictures
    folder.mkdir(parents=True, exist_ok=True)
    written = plots.draw(result, folder) if wanted.plots else []
    if wanted.renders:
        from workflows import render as renders

        try:
            written += renders.draw(result, folder, wanted.deformation_scale, wanted.wear_scale)
        except renders.RenderingUnavailable as missing:
            print(f"no renders: {missing}")
    for path in written:
        print(path)


if __name__ == "__main__":
    main()
