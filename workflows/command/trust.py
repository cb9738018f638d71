"""The words of the command `tribodyn` that measure how far its own words can be trusted."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from tribodyn.workflows.command.words import Json, aside, make_room


def scoreboard(
    *, scenes: int = 40, seed: int = 1, seconds: float = 60.0, out: Path = Path("scoreboard"), as_json: Json = False
) -> None:
    """Hold verdicts and promises on scenes drawn at random against references that are finer in every knob.

    Exit code 3 where a true error is above the stated one. Rows are kept: the same command goes on where it was ended.

    Parameters
    ----------
    scenes
        How many are drawn. 0: none, all rows of the seed that are kept are counted again.
    seed
        Of the draw.
    seconds
        Processor seconds that the run of a scene may take, and its reference again.
    out
        Folder of the rows, the table and the histogram.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.api import whole_scenes
    from tribodyn.workflows.benchmarks import scoreboard_table as table

    make_room(out)
    rows = whole_scenes.scoreboard(scenes, out, seed=seed, seconds=seconds, progress=aside)
    print(json.dumps([asdict(row) for row in rows], indent=2) if as_json else table.summary(rows))
    broken = sum(one.broken for row in rows for one in (*row.judged, *row.promise))
    if broken:
        raise RuntimeError(f"{broken} promises are broken, see {out / 'scoreboard.csv'}")


def faults(*, tree: Path = Path(), seconds: float = 20.0, out: Path = Path("faults"), as_json: Json = False) -> None:
    """Plant faults in the sources, one at a time: what each changes in results, and which test or setting sees it.

    Parameters
    ----------
    tree
        Root of a clone of the repository.
    seconds
        Processor seconds for the tests of one fault, and again for the judge of extremes.
    out
        Folder of the rows and the table. Rows are kept: the same command goes on where it was ended.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.benchmarks import planted_faults

    make_room(out)
    rows = planted_faults.run(tree.resolve(), out.resolve(), aside, seconds)
    text = planted_faults.as_markdown(rows)
    (out / "faults.md").write_text(text, encoding="utf-8")
    print(json.dumps([asdict(row) for row in rows], indent=2) if as_json else text)


COMMANDS = (scoreboard, faults)
