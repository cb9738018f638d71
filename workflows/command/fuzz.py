"""The word of the command `tribodyn` that tries nasty values in a scene."""

from __future__ import annotations

import json

from tribodyn.workflows.command.words import Json, Overrides, aside


def fuzz(
    scene: str,
    *,
    runs: int | None = None,
    seed: int = 0,
    seconds: float = 10.0,
    workers: int = 1,
    overrides: Overrides = (),
    as_json: Json = False,
) -> None:
    """Give every key of a scene thirty nasty values, one at a time, and tell how the runs end.

    Each ends well, is refused, or fails with a sentence; exit code 3 where one does not.

    Parameters
    ----------
    scene
        Name of a scene or a .toml file; make it small with --set, so that a run takes a second.
    runs
        How many pairs of key and value, drawn at random; all of them by default.
    seed
        Of the draw.
    seconds
        Processor seconds that a run may take.
    workers
        Runs at a time.
    as_json
        Print JSON for machines.
    """
    from tribodyn.workflows.api import whole_scenes
    from tribodyn.workflows.benchmarks import fuzz as measured

    tried = whole_scenes.fuzz(
        scene, runs=runs, seed=seed, seconds=seconds, workers=workers, overrides=overrides, progress=aside
    )
    wrong = [one for one in tried if not one.good]
    if as_json:
        print(json.dumps({"ends": measured.counts(tried), "wrong": [one.record() for one in wrong]}, indent=2))
    else:
        for name, ends in measured.counts(tried).items():
            print(f"{name}: " + ", ".join(f"{count} {end}" for end, count in sorted(ends.items())))
        for one in wrong:
            print(f"{one.scene} {one.key}={one.value}: {one.end} after {one.seconds:.1f} s: {one.said[-300:]}")
    if wrong:
        raise RuntimeError(f"{len(wrong)} of {len(tried)} runs did not end as a run may")


COMMANDS = (fuzz,)
