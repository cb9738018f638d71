"""The word of the command `tribodyn` that tries nasty values in a scene."""

from __future__ import annotations

import json
from pathlib import Path

from tribodyn.workflows.command.words import Json, Overrides, aside, make_room


def fuzz(
    scene: str,
    *,
    values: int | None = None,
    runs: int | None = None,
    seed: int = 0,
    seconds: float = 10.0,
    workers: int = 1,
    out: Path | None = None,
    overrides: Overrides = (),
    as_json: Json = False,
) -> None:
    """Give every key of a scene thirty nasty values, one at a time, and tell how the runs end.

    All are read; the scenes that come out of those which reading accepts are run. Each ends well, is refused, or fails
    with a sentence; exit code 3 where one does not.

    Parameters
    ----------
    scene
        Name of a scene or a .toml file; make it small with --set, so that a run takes a second.
    values
        How many pairs of key and value, drawn at random; all of them by default.
    runs
        How many of the scenes that are accepted are run, drawn at random; all of them by default.
    seed
        Of the draws.
    seconds
        Processor seconds that a run may take.
    workers
        Runs at a time.
    out
        Folder that keeps the runs: the same command goes on where it was ended, and runs again what ended wrong.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.api import whole_scenes
    from tribodyn.workflows.benchmarks import fuzz as measured

    make_room(out)
    tried = whole_scenes.fuzz(
        scene,
        values=values,
        runs=runs,
        seed=seed,
        seconds=seconds,
        workers=workers,
        folder=out,
        overrides=overrides,
        progress=aside,
    )
    wrong = [one for one in tried if not one.good and not one.like]
    if as_json:
        print(json.dumps({"counts": measured.counts(tried), "wrong": [one.record() for one in wrong]}, indent=2))
    else:
        print(measured.as_text(tried))
    if wrong:
        raise RuntimeError(f"{len(wrong)} of {sum(not one.like for one in tried)} values did not end as they may")


COMMANDS = (fuzz,)
