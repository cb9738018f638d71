"""Faults planted in the sources, one at a time: which tests see them, what extremes sees, what they change in results.

The list is planted_faults.toml beside this file. A process loads program and tests once (`planting`) and plants each
fault in a forked child of its own: there the tests of its room run, those by hand and those named after its file first,
until the first fails or their processor seconds are spent. Where none fails, the judge of `extremes` is asked on every
so many of its quick cells. What a fault changes is told by small reference runs of the product (`reference_runs`).
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

LIST = Path(__file__).with_suffix(".toml")
ROWS = "rows.jsonl"
JUDGED = 30  # every so many of the quick cells of extremes
SECONDS = 20.0  # of the processor, for the tests of one fault, and again for the judge
UNCOMPILED = 3.0  # times these where nothing is compiled
PROBED = 90.0  # seconds, for the reference runs
SOLVED = ("hbm/", "reduction/")  # what extremes looks at; it takes the matrices as they are
LARGE = 1e-3  # relative change of a result from which on a fault must be seen


@dataclass(frozen=True)
class Fault:
    """file : from the root of the tree; old : stands in it once; new : replaces it; room : whose tests are run."""

    file: str
    old: str
    new: str
    does: str
    room: str


@dataclass(frozen=True)
class Room:
    """tests : files, the quick ones first; runs : names of the reference runs that may feel what is changed there."""

    tests: tuple[str, ...]
    runs: tuple[str, ...]


@dataclass(frozen=True)
class Seen:
    """tests : the first test that fails, "" where none does; extremes : a cell that is wrong, "" where none is or none
    was asked, because a test fails already.

    change : largest relative one of a number of the reference runs; where : which number; seconds : of the processor
    """

    file: str
    does: str
    tests: str
    extremes: str
    change: float
    where: str
    seconds: float

    @property
    def caught(self) -> bool:
        """Whether something sees it."""
        return bool(self.tests or self.extremes)


def faults() -> tuple[list[Fault], dict[str, Room]]:
    """The list, and what is run for each room."""
    data = tomllib.loads(LIST.read_text(encoding="utf-8"))
    rooms = {name: Room(tuple(tests), tuple(data["runs"][name])) for name, tests in data["tests"].items()}
    return [Fault(**({"room": one["file"].partition("/")[0]} | one)) for one in data["fault"]], rooms


def run(tree: Path, folder: Path, say: Callable[[str], None], seconds: float = SECONDS) -> list[Seen]:
    """Plant every fault in turn; those that `folder` holds already are left out.

    tree : root of a clone; folder : of the rows; seconds : of the processor for the tests of a fault
    Raises  ValueError where the tree is no clone, or a text does not stand once in its file; RuntimeError: a planting
    process ended before its time
    """
    listed, _ = faults()
    if not (tree / "tests").is_dir():
        raise ValueError(f"{tree} holds no tests: plant faults from a clone of the repository")
    compiled = []
    for fault in listed:
        text = (tree / fault.file).read_text(encoding="utf-8")
        if text.count(fault.old) != 1:
            raise ValueError(f"{fault.file} does not hold this text exactly once: {fault.old}")
        compiled.append("numba" in text)
    for uncompiled in (False, True):
        done = {(row.file, row.does) for row in rows_in(folder)}
        numbers = [
            number
            for number, fault in enumerate(listed)
            if compiled[number] == uncompiled and (fault.file, fault.does) not in done
        ]
        if numbers:
            _planted(tree, folder, say, seconds * (UNCOMPILED if uncompiled else 1.0), numbers, uncompiled)
    rows = {(row.file, row.does): row for row in rows_in(folder)}
    return [rows[fault.file, fault.does] for fault in listed]


def _planted(
    tree: Path, folder: Path, say: Callable[[str], None], seconds: float, numbers: Sequence[int], uncompiled: bool
) -> None:
    """Plant the faults of these numbers in one process, which writes their rows."""
    own = {"PYTHONPATH": str(tree / "src"), "OMP_NUM_THREADS": "1", "NUMBA_DISABLE_JIT": str(int(uncompiled))}
    own["TRIBODYN_CACHE"] = "off"  # what was made without a fault would hide it
    words = [sys.executable, "-B", "-m", "proof.planting", str(folder), str(seconds)]
    with subprocess.Popen(
        [*words, *map(str, numbers)], cwd=tree, env=os.environ | own, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            say(line.strip())
    if process.returncode:
        raise RuntimeError(f"planting ended with exit code {process.returncode}: see {folder / 'printed'}")


def rows_in(folder: Path) -> list[Seen]:
    """The rows that a folder holds, the last one of each fault."""
    path = folder / ROWS
    rows = [Seen(**json.loads(line)) for line in path.read_text().splitlines()] if path.exists() else []
    return list({(row.file, row.does): row for row in rows}.values())


def as_markdown(rows: Sequence[Seen]) -> str:
    """What was seen of every fault, as a table, and the counts above it."""
    seen = Counter((bool(row.tests), bool(row.extremes)) for row in rows)
    large = [row for row in rows if row.change > LARGE]
    failing = sum(row.change == float("inf") for row in large)
    lines = [
        f"{sum(row.caught for row in rows)} of {len(rows)} planted faults are seen: {seen[True, False]} by tests, "
        f"{seen[False, True]} by extremes alone. Of the {len(large)} that change a result of the reference runs by "
        f"more than 0.1 %, {sum(row.caught for row in large)} are seen; {failing} of these count because such a run "
        "then fails or does not end.",
        "",
        "| file | fault | largest change | of | seen by |",
        "|---|---|---|---|---|",
    ]
    for row in rows:
        by = row.tests.rpartition("/")[2].replace("::", " ").partition("[")[0] or row.extremes.partition(": ")[0]
        lines.append(f"| {row.file} | {row.does} | {_share(row.change)} | {row.where} | {by or 'nothing'} |")
    return "\n".join(lines) + "\n"


def _share(change: float) -> str:
    """A relative change in per cent, as a reader wants it."""
    if change == float("inf"):
        return "fails"
    return "none" if change == 0 else f"{100 * change:.2g} %" if change < 10 else f"x {1 + change:.2g}"
