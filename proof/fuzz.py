"""Nasty values for every key of a scene: each run ends well, is refused, or fails with a sentence, and in time.

A value that reading the scene refuses needs no run, and of several that make the same scene (`1`, `true` for a switch,
a value that is the key's default) one is run.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from proof.fuzz_runs import ACCEPTED, REFUSED, Case, Command, FuzzEnd, Runs, scene_job
from proof.time_limit import TimeUp, processor_seconds
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene import scene_file

INPUTS = (
    "-1", "0", "1", "1e-300", "1e300", "-1e300", "nan", "inf", "-inf", "3.5", "1000000", "true", '""', '"abc"', "[]",
    "[1]", "[[1]]", "{}", '"1 parsec"', '"-1 mm"', '"1e300 kN"', '"1e-300 s"', '"0 Hz"', '"nan Hz"', '"inf N"',
    '"250 %"', '"1e12 N/um"', '"../x"', "[1, 2, 3, 4, 5, 6, 7]", '["a", "b"]',
)  # fmt: skip
"""TOML values, thirty of them."""

ROWS = "rows.jsonl"  # of a folder that keeps runs

Row = TypeVar("Row", "_Meant", "FuzzEnd")


def keys(scene: str, overrides: Sequence[str] = ()) -> list[str]:
    """Every section and key of a scene, "section.key", those at their defaults included."""
    return sorted(set(names_of(scene_file.read(scene, overrides).scene.model_dump())))


def names_of(table: dict[str, Any], above: str = "") -> Iterator[str]:
    """Every section and key of the tables of a scene."""
    for name, value in table.items():
        is_part = name == "parameters"  # of a part: keys of the table around them
        if not is_part:
            yield f"{above}{name}"
        if isinstance(value, dict):
            yield from names_of(value, above if is_part else f"{above}{name}.")


def cases(scene: str, overrides: Sequence[str], count: int | None = None, seed: int = 0) -> list[Case]:
    """Pairs of a key and a value, all of them or some drawn at random."""
    pairs = [(key, value) for key in keys(scene, overrides) for value in INPUTS]
    if count is None or count >= len(pairs):
        return pairs
    chosen = np.random.default_rng(seed).choice(len(pairs), count, replace=False)
    return [pairs[i] for i in sorted(chosen)]


def fuzz(
    scene: str,
    overrides: Sequence[str] = (),
    values: int | None = None,
    runs: int | None = None,
    seed: int = 0,
    seconds: float = 10.0,
    workers: int = 1,
    say: Callable[[str], None] = lambda sentence: None,
    folder: Path | None = None,
    *,
    command: Command,
) -> list[FuzzEnd]:
    """Try fuzz inputs for the keys of a scene, one at a time: all are read, and the scenes that come out of it are run.

    overrides : that make the scene small, so that a run takes a second; values : how many pairs of key and value, all
    by default; runs : how many of the scenes that are accepted, all by default; both are drawn with `seed`
    seconds : of the processor that a run may take
    folder : keeps the runs; those that it holds are not run again, unless they ended wrong
    command : what `tribodyn` does with the words of a command line; it leaves by SystemExit
    Raises  SceneError for a scene that cannot be read, ValueError where processes cannot be forked, RuntimeError where
        the scene as it is does not end well
    """
    if not hasattr(os, "fork"):
        raise Refusal("this system cannot fork processes, as fuzz does")
    rows = _Rows(folder, scene, overrides)
    refused, scenes, unclear = _read_all(scene, overrides, cases(scene, overrides, values, seed), seconds, say, rows)
    order = np.random.default_rng(seed).permutation(len(scenes))[:runs]
    drawn = [scenes[i][0] for i in sorted(order)] + unclear
    missing = [case for case in drawn if case not in rows.run or not rows.run[case].good]
    runner = Runs((scene_job(scene, overrides),), seconds, workers, command)
    todo = [scene_job(scene, overrides, *case) for case in missing]
    for remaining, outcome in zip(reversed(range(len(missing))), runner.of(todo) if todo else (), strict=True):
        rows.add(outcome)
        if remaining % 20 == 0 or not outcome.good:
            say(f"{scene}: {len(drawn) - remaining} runs of {len(drawn)}, {outcome.key}={outcome.value}: {outcome.end}")
    ends = [*refused, *(rows.run[case] for case in unclear)]
    for who, *repeats in scenes:
        first = rows.run.get(who, FuzzEnd(scene, *who, ACCEPTED, "", 0.0))
        ends += [first, *(replace(first, key=k, value=v, same_as="=".join(who)) for k, v in repeats)]
    return sorted(ends, key=lambda outcome: (outcome.key, INPUTS.index(outcome.value)))


def _read_all(
    scene: str,
    overrides: Sequence[str],
    todo: Sequence[Case],
    seconds: float,
    say: Callable[[str], None],
    rows: _Rows,
) -> tuple[list[FuzzEnd], list[list[Case]], list[Case]]:
    """What reading refuses; the cases of each scene that it accepts; and those where it does neither."""
    refused, unclear = [], []
    meaning: dict[str, list[Case]] = {}
    for number, (key, value) in enumerate(todo):
        if number % 1000 == 999:
            say(f"{scene}: {number + 1} of {len(todo)} values are read, {len(meaning)} scenes come out of them")
        meant = rows.read.get((key, value))
        if meant is None or not (meant.refusal or meant.digest):
            meant = rows.add(_read(scene, overrides, key, value, seconds))
        if meant.refusal:
            refused.append(FuzzEnd(scene, key, value, REFUSED, f"tribodyn: {meant.refusal}", meant.seconds))
        elif meant.digest:
            meaning.setdefault(meant.digest, []).append((key, value))
        else:
            unclear.append((key, value))
    return refused, list(meaning.values()), unclear


@dataclass(frozen=True)
class _Meant:
    """What a scene with a value means: digest of the scene, or the sentence that refuses it; both empty if neither.

    seconds : of the processor
    """

    key: str
    value: str
    digest: str
    refusal: str
    seconds: float


class _Rows:
    """What is known of a scene already; a folder keeps it in a file, whose first line says of which scene."""

    def __init__(self, folder: Path | None, scene: str, overrides: Sequence[str]):
        self._path = None if folder is None else folder / ROWS
        self.read: dict[Case, _Meant] = {}
        self.run: dict[Case, FuzzEnd] = {}
        of = {"scene": scene, "overrides": list(overrides)}
        if self._path is None:
            return
        if not self._path.exists():
            self._write(of)
        first, *lines = (json.loads(line) for line in self._path.read_text(encoding="utf-8").splitlines())
        if first != of:
            raise Refusal(f"{folder} keeps runs of {first['scene']} with other changes: give another folder")
        for line in lines:
            self._take(FuzzEnd(**line) if "end" in line else _Meant(**line))

    def add(self, row: Row) -> Row:
        """Keep a row and give it back."""
        self._take(row)
        if self._path is not None:
            self._write(asdict(row))
        return row

    def _take(self, row: _Meant | FuzzEnd) -> None:
        if isinstance(row, FuzzEnd):
            self.run[row.key, row.value] = row
        else:
            self.read[row.key, row.value] = row

    def _write(self, line: dict[str, Any]) -> None:
        assert self._path is not None
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")


def _read(scene: str, overrides: Sequence[str], key: str, value: str, seconds: float) -> _Meant:
    """Read a scene; what is no refusal in one line is left for the command to meet again."""
    clock = time.process_time()
    digest = refusal = ""
    try:
        with warnings.catch_warnings(), processor_seconds(seconds):
            warnings.simplefilter("error")
            text = scene_file.read(scene, (*overrides, f"{key}={value}")).scene.model_dump_json()
            digest = hashlib.sha256(text.encode()).hexdigest()
    except scene_file.SceneError as error:
        refusal = "" if "\n" in str(error) else str(error)
    except (Exception, TimeUp):  # what the command prints tells more
        digest = ""
    return _Meant(key, value, digest, refusal, time.process_time() - clock)


def counts(cases: Sequence[FuzzEnd]) -> dict[str, dict[str, Any]]:
    """Numbers by scene: keys, values, those that reading refuses, scenes that come out of the others, ends of runs."""
    by_scene = {}
    for scene in dict.fromkeys(case.scene for case in cases):
        ours = [case for case in cases if case.scene == scene]
        accepted = [case for case in ours if case.end != REFUSED and not case.same_as]
        ran = [case for case in accepted if case.end != ACCEPTED]
        by_scene[scene] = {
            "keys": len({case.key for case in ours}),
            "values": len(ours),
            REFUSED: sum(case.end == REFUSED for case in ours),
            "scenes": len(accepted),
            "runs": len(ran),
            "ends": dict(Counter(case.end for case in ran)),
            "slowest": max((case.seconds for case in ran), default=0.0),
        }
    return by_scene


def as_text(cases: Sequence[FuzzEnd]) -> str:
    """A line for each scene, and one for each wrong end."""
    lines = []
    for scene, of in counts(cases).items():
        ends = ", ".join(f"{count} {end}" for end, count in sorted(of["ends"].items(), reverse=True))
        lines.append(
            f"{scene}: {of['keys']} keys, {of['values']} values: {of[REFUSED]} {REFUSED}, the others make "
            f"{of['scenes']} scenes; {of['runs']} of these run: {ends or 'none'}; the slowest {of['slowest']:.1f} s"
        )
    wrong = [case for case in cases if not case.good and not case.same_as]
    lines += [
        f"{case.scene} {case.key}={case.value}: {case.end} after {case.seconds:.1f} s: {case.output[-300:]}"
        for case in wrong
    ]
    return "\n".join(lines)
