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
    "verify": ("scenes:verify", "Check a result against direct time integration."),
    "report": ("scenes:report", "Write one HTML file that shows results."),
    "export": ("scenes:export", "Write a result in the formats of other programs."),
    "curve": ("curve:app", "Follow curves: backbone, ring-down, folds, track."),
    "wheel": ("wheel:app", "Wheels: modes, flutter, mistuned blades and patterns of them."),
    "study": ("study:app", "Studies: grid, lives, optimise, identify, vary, converge, trade, supports, forces."),
    "geometry": ("geometry:app", "Geometry: mesh a drawing, find the asperities of measured faces."),
}  # fmt: skip
SUCCESSORS = {
    "animate": "draw RESULT --film wear",
    "asperities": "geometry asperities",
    "backbone": "curve backbone",
    "bench": "prove bench",
    "blade": "prove blade",
    "branches": "prove branches",
    "converge": "study converge",
    "extremes": "prove extremes",
    "faults": "prove faults",
    "flutter": "wheel flutter",
    "folds": "curve folds",
    "forces": "study forces",
    "fuzz": "prove fuzz",
    "identify": "study identify",
    "leaf": "prove leaf",
    "list": "cases",
    "lives": "study lives",
    "mesh": "geometry mesh",
    "mistuned": "wheel mistuned",
    "mistuning": "wheel patterns, wheel pattern-motion or wheel pattern-wear",
    "optimise": "study optimise",
    "render": "draw",
    "rig": "prove rig",
    "ring-down": "curve ring-down",
    "scoreboard": "prove scoreboard",
    "study": "study grid",
    "supports": "study supports",
    "track": "curve track",
    "trade": "study trade",
    "vary": "study vary",
    "wheel": "wheel modes",
}

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
        successor = SUCCESSORS.get(given[0])
        if successor is not None:
            asked = " ".join(given[:2]) if given[0] in WORDS else given[0]
            raise ValueError(f"there is no tribodyn {asked}: its successor is tribodyn {successor}") from None
        said = str(error).partition(" Available commands:")[0].rstrip(". ")
        raise ValueError(f"{said}{'' if said.endswith('?') else '.'} Available commands: {', '.join(WORDS)}") from None


if __name__ == "__main__":
    main()
