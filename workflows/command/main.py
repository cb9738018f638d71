"""The command `tribodyn`: its words, each imported when it is used."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import cyclopts

from tribodyn.version import __version__
from tribodyn.workflows.command import exits

WORDS = {  # word -> where it is, its help on the page of all of them
    "cases": ("scenes:cases", "List the scenes that come with the program."),
    "new": ("scenes:new", "Begin a scene from a mesh, a deck or a CAD file."),
    "run": ("scenes:run", "Run a scene and leave its result and pictures in a folder."),
    "inspect": ("scenes:inspect", "Show what a mesh, a deck, a CAD file or a scene holds."),
    "plan": ("scenes:plan", "Show what a scene will model, and what it will cost, before running it."),
    "show": ("scenes:show", "Show what a result holds."),
    "draw": ("scenes:draw", "Draw pictures or films of a result."),
    "verify": ("verify:verify", "Check a result against direct time integration."),
    "report": ("scenes:report", "Write one HTML file that shows results."),
    "export": ("scenes:export", "Write a result in the formats of other programs."),
    "curve": ("curve:app", "Follow curves: backbone, ring-down, folds, track."),
    "wheel": ("wheel:app", "Wheels: modes, flutter, mistuned blades and patterns of them."),
    "study": ("study:app", "Studies: grid, lives, optimise, identify, converge, supports, asperities and more."),
}  # fmt: skip

app = cyclopts.App(
    name="tribodyn",
    help="From geometry to worn surface: vibration, friction and fretting wear of jointed parts.",
    version=__version__,
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,
)
for name, (place, meaning) in WORDS.items():
    app.command(f"tribodyn.workflows.command.{place}", name=name, help=meaning)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command and leave with its exit code, see `exits.guard`."""
    exits.guard(lambda: _run(arguments))


def _run(arguments: Sequence[str] | None) -> None:
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        app(given, exit_on_error=False, print_error=False)
    except cyclopts.UnknownCommandError as error:
        said = str(error).partition(" Available commands:")[0].rstrip(". ")
        raise ValueError(f"{said}{'' if said.endswith('?') else '.'} Available commands: {', '.join(WORDS)}") from None


if __name__ == "__main__":
    main()
