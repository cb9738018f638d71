"""Words of the command `tribodyn` that make films."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from tribodyn.workflows.command.words import make_room

Overs = Annotated[tuple[Literal["wear", "cycle"], ...], Parameter(name="--over", negative=(), consume_multiple=True)]
Formats = Annotated[tuple[str, ...], Parameter(name="--format", negative=(), consume_multiple=True)]


def animate(
    result: Path,
    *,
    over: Overs = ("wear", "cycle"),
    row: int | None = None,
    formats: Formats = ("mp4",),
    images: int = 48,
    dpi: int = 100,
    out: Path | None = None,
) -> None:
    """Make films of a result: its contact over wear, its part and the status of its pairs over one cycle.

    Parameters
    ----------
    result
        Folder or file of a result.
    over
        wear or cycle, or both.
    row
        Wear row, or point of a response that does not wear, whose cycle is shown; by default that whose contact works
        most.
    formats
        mp4 or gif, or both.
    images
        Images of a film, at the most.
    dpi
        Dots per inch of a film of 12.8 by 7.2 inches.
    out
        Folder of the films; pictures/ beside the result by default.
    """
    from tribodyn.workflows.studies import scenes

    make_room(out)
    loaded, folder = scenes.load(result), out or scenes.result_file(result).parent / "pictures"
    for what in over:
        for path in scenes.animate(loaded, folder, what, row=row, formats=formats, images=images, dpi=dpi):
            print(path)


COMMANDS = (animate,)
