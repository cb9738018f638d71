"""The words of the command `tribodyn` on one scene or one result."""

import json
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from tribodyn.extras import MissingPackage
from tribodyn.output_file import printable
from tribodyn.refusal import Refusal, SolveFailed, SolverFailure
from tribodyn.workflows.command.word import QUIET, Flag, Json, Overrides, make_room
from tribodyn.workflows.report import text
from tribodyn.workflows.result import store
from tribodyn.workflows.result.number_format import named_lines
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run.progress import console_progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies import front_door

Formats = Annotated[tuple[str, ...], Parameter(name="--format", negative=(), consume_multiple=True)]
Targets = Annotated[tuple[str, ...], Parameter(name="--to", negative=(), consume_multiple=True)]
Verbose = Annotated[Flag, Parameter(name=("--verbose", "-v"))]
Films = Annotated[tuple[Literal["wear", "cycle"], ...], Parameter(name="--film", negative=(), consume_multiple=True)]


def run(
    scene: str,
    *,
    overrides: Overrides = (),
    accuracy: str | None = None,
    out: Path | None = None,
    resume: Flag = False,
    pictures: Annotated[bool, Parameter(negative="--no-pictures")] = True,
    quiet: QUIET = False,
    verbose: Verbose = False,
    log: Path | None = None,
) -> None:
    """Run a scene and leave its result and pictures in a folder.

    A scene may name Python files beside it: running somebody's scene runs his code.

    Parameters:
        scene: Name of a scene (see `tribodyn cases`) or a .toml file.
        accuracy: Relative error wanted, such as "1 %", or of what is named, "1 % of energy": the scene is run with
            finer and finer settings until the errors of its verdict are below that; exit code 3 where they do not get
            there. Without depth or life in it nothing is worn.
        out: Folder of the result; results/NAME by default.
        resume: Resume an unfinished result in the folder.
        pictures: Draw curves, maps and renders when done.
        quiet: Print nothing but what goes wrong.
        verbose: Print sizes, the seconds of each stage, every number and every file too.
        log: File to which every line of progress is added, with its time."""
    make_room(out)
    progress = console_progress(quiet, log, verbose)
    file = scene_file.read(scene, overrides)
    folder = out or Path("results") / file.name
    path = folder / "result.h5"
    try:
        if accuracy is not None:
            result, bound = front_door.run_to_accuracy(file, accuracy, folder, progress=progress, resume=resume)
        else:
            result, bound = front_door.run(file, folder, progress=progress, resume=resume), None
    except KeyboardInterrupt:
        raise KeyboardInterrupt(_stop_message(path, scene, file.overrides)) from None
    except SolveFailed as failure:
        raise SolveFailed(f"{failure}; what was computed before is kept in {path}") from None
    if not quiet:
        _print(result, verbose)
    if pictures:
        try:
            _draw(result, folder / "pictures", report=progress.detail, complain=progress.say)
            progress.say(f"pictures  {folder / 'pictures'}")
        except MissingPackage as missing:
            progress.say(f"no pictures: {missing}")
    progress.say(f"next      tribodyn report {folder} makes one page of it, tribodyn show {folder} --verbose says all")
    if bound is not None and not bound.is_satisfied:
        raise SolverFailure(f"{bound.sentence}; the result is kept in {path}")


def _stop_message(path: Path, scene: str, overrides: Sequence[str]) -> str:
    if not path.exists():
        return "stopped before anything was computed"
    words = [scene, "--out", str(path.parent), *(word for text in overrides for word in ("--set", text))]
    return f"stopped, {store.load(path).state}, kept in {path}: resume with tribodyn run {shlex.join(words)} --resume"


def plan(scene: str, *, overrides: Overrides = (), picture: Path | None = None, allow_scripts: Flag = False) -> None:
    """Show what a scene will model, and what it will cost, before running it.

    Parameters:
        scene: Name of a scene (see `tribodyn cases`) or a .toml file.
        picture: A .png file to draw the scene in: bodies, contacts in colour, what is held, loads as arrows.
        allow_scripts: Run a Python file or a drawing (.geo) that makes the part."""
    make_room(picture, (".png",))
    planned = front_door.plan(scene, overrides, allow_scripts=allow_scripts)
    print(*map(printable, named_lines(planned.lines())), sep="\n")
    if picture is not None:
        print(front_door.picture(scene, picture, overrides, allow_scripts=allow_scripts))


def _print(result: Result, verbose: bool) -> None:
    lines = [*text.brief(result), *(["", *named_lines(text.lines(result), 38)] if verbose else [])]
    print(*map(printable, lines), sep="\n", flush=True)


def show(result: Path, *, verbose: Verbose = False, as_json: Json = False) -> None:
    """Show what a result holds: its model, response, wear and errors, and what is to be doubted.

    Parameters:
        result: Folder or file of a result.
        verbose: Every number, and what each refinement changed.
        as_json: Print JSON for machines."""
    loaded = store.load(result)
    if as_json:
        print(json.dumps(loaded.summary(), indent=2))
    else:
        _print(loaded, verbose)


def draw(
    result: Path,
    *,
    film: Films = (),
    formats: Formats = (),
    dpi: int | None = None,
    row: int | None = None,
    images: int = 48,
    out: Path | None = None,
) -> None:
    """Draw the pictures of a result again, or films of it.

    Parameters:
        result: Folder or file of a result.
        film: A film instead of pictures: of the contact over wear, or of the part and the status of its pairs over one
            cycle; can be both.
        formats: Of pictures png (default), pdf or svg, of films mp4 (default) or gif; can be repeated.
        dpi: Dots per inch: of a picture 200, of a film of 12.8 by 7.2 inches 100 by default.
        row: Wear row, or point of a response that does not wear, whose cycle is filmed; by default that whose contact
            works most.
        images: Images of a film, at the most.
        out: Folder of pictures and films; pictures/ beside the result by default."""
    make_room(out)
    if dpi is not None and not 20 <= dpi <= 2400:
        raise Refusal(f"--dpi {dpi}: give 20 to 2400 dots per inch")
    loaded, folder = store.load(result), out or store.result_file(result).parent / "pictures"
    if not film:
        _draw(loaded, folder, formats or ("png",), dpi or 200)
    settings = loaded.scene.pictures
    for over in film:
        from tribodyn.workflows.pictures import film as films

        factors = settings.deformation_scale, settings.wear_scale
        paths = films.film(loaded, folder, over, row, formats or ("mp4",), images, dpi or 100, *factors)
        print(*paths, sep="\n")


def _draw(
    result: Result,
    folder: Path,
    formats: Sequence[str] = ("png",),
    dpi: int | None = None,
    report: Callable[[str], None] = print,
    complain: Callable[[str], None] = print,
) -> None:
    written, missing = front_door.draw(result, folder, formats, dpi)
    if missing:
        complain(missing)
    for path in written:
        report(str(path))


def report(*result: Path, out: Path | None = None) -> None:
    """Write one HTML file that shows results and opens anywhere, without a network.

    Parameters:
        result: Folders or files of results; several are shown side by side, with differences from the first.
        out: The .html file; report.html beside the first result by default."""
    if not result:
        raise Refusal("report: give the folder or file of a result")
    make_room(out, (".html",))
    print(front_door.report(result, out or store.result_file(result[0]).parent / "report.html"))


def export(
    result: Path, *, to: Targets, out: Path | None = None, mesh_ending: str = ".xdmf", allow_scripts: Flag = False
) -> None:
    """Write a result in the formats of other programs.

    Parameters:
        result: Folder or file of a result.
        to: Formats, one or several: vtk (series for ParaView), csv, mat, uff (tables and curves), mesh (worn part with
            its fields), npz, matlab (reduced matrices).
        out: Folder, in which each format gets a folder of its own; export/ beside the result by default.
        mesh_ending: Format of the mesh by its ending, such as .vtu, .exo, .msh or .bdf.
        allow_scripts: Run Python files and drawings (.geo) that the scene of the result names, to make its matrices
            again."""
    make_room(out)
    folder = out or store.result_file(result).parent / "export"
    for written in front_door.export(result, to, folder, mesh_ending, allow_scripts=allow_scripts):
        print(printable(written))
