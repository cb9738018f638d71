"""Words of the command `tribodyn` that show a result to others: the page that holds everything."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tribodyn.workflows.command.words import make_room

Results = Annotated[tuple[Path, ...], Parameter(negative=())]


def report(*result: Path, out: Path | None = None) -> None:
    """Write one HTML file that shows results and opens anywhere, without a network.

    Parameters
    ----------
    result
        Folders or files of results; several are shown side by side, with differences from the first.
    out
        The .html file; report.html beside the first result by default.
    """
    from tribodyn.workflows.api import whole_scenes
    from tribodyn.workflows.studies import scenes

    if not result:
        raise ValueError("report: give the folder or file of a result")
    make_room(out, (".html",))
    print(whole_scenes.report(result, out or scenes.result_file(result[0]).parent / "report.html"))


COMMANDS = (report,)
