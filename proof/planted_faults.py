"""Faults planted in the sources, one at a time: which tests detect them, and what they change in results.

The list is planted_faults.toml beside this file. A process loads program and tests once (`planting`) and plants each
fault in a forked child of its own: there the tests of its room run, those by hand and those named after its file first,
until the first fails or their processor seconds are spent. Where none fails, every so many of the quick cells of
`extremes` are judged. Small reference runs of the product measure what a fault changes (`reference_runs`)."""

import ast
import json
import os
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from proof.rewriting import Rule, rewritten
from tribodyn.refusal import Refusal, SolverFailure

LIST = Path(__file__).with_suffix(".toml")
ROWS = "rows.jsonl"
JUDGED_CELLS = 30  # every so many of the quick cells of extremes
SECONDS = 20.0  # of the processor, for the tests of one fault, and again for the judge
UNCOMPILED = 3.0  # times these where nothing is compiled
RUN_SECONDS = 90.0  # for the reference runs
SOLVER_FOLDERS = ("hbm/", "reduction/")  # what extremes exercises; it takes the matrices as they are
LARGE = 1e-3  # relative change of a result from which on a fault must be detected


@dataclass(frozen=True)
class Fault:
    """file : from the root of the tree; function : in it, "" for the module; rule : of `rewriting`; room : of tests."""

    file: str
    rule: str
    effect: str
    room: str
    function: str = ""

    def faulty(self, tree: Path) -> ast.Module:
        """The syntax tree of the file with the fault.

        Raises  ValueError where the fault has no place or changes nothing"""
        source = (tree / self.file).read_text(encoding="utf-8")
        try:
            module = rewritten(source, self.function, Rule.parse(self.rule))
        except ValueError as failure:
            raise Refusal(f"{self.file}: {self.effect}: {failure}") from failure
        if ast.dump(module) == ast.dump(ast.parse(source)):
            raise Refusal(f"{self.file}: {self.effect}: nothing changes by {self.rule}")
        return module


@dataclass(frozen=True)
class Room:
    """tests : files, the quick ones first; runs : names of the reference runs that may feel what is changed there."""

    tests: tuple[str, ...]
    runs: tuple[str, ...]


@dataclass(frozen=True)
class Detection:
    """test : the first that fails, "" where none does; cell : of extremes that is wrong, "" where none is or none was
    judged, because a test fails already.

    change : largest relative one of a number of the reference runs; number : which; seconds : of the processor"""

    file: str
    effect: str
    test: str
    cell: str
    change: float
    number: str
    seconds: float

    @property
    def is_detected(self) -> bool:
        """Whether a test fails or a cell is wrong."""
        return bool(self.test or self.cell)


def faults() -> tuple[list[Fault], dict[str, Room]]:
    """The list, and what is run for each room."""
    data = tomllib.loads(LIST.read_text(encoding="utf-8"))
    rooms = {name: Room(tuple(tests), tuple(data["runs"][name])) for name, tests in data["tests"].items()}
    return [Fault(**({"room": row["file"].partition("/")[0]} | row)) for row in data["fault"]], rooms


def run(tree: Path, folder: Path, report: Callable[[str], None], seconds: float = SECONDS) -> list[Detection]:
    """Plant every fault in turn; those that `folder` already has are skipped.

    tree : root of a clone; folder : of the rows; seconds : of the processor for the tests of a fault
    Raises  ValueError where the tree is no clone or a fault has no place; RuntimeError: a planting process failed"""
    planned, _ = faults()
    if not (tree / "tests").is_dir():
        raise Refusal(f"{tree} holds no tests: plant faults from a clone of the repository")
    for fault in planned:
        fault.faulty(tree)
    uses_numba = ["numba" in (tree / fault.file).read_text(encoding="utf-8") for fault in planned]
    for uncompiled in (False, True):
        done = {row.effect for row in rows_in(folder)}
        numbers = [
            number
            for number, fault in enumerate(planned)
            if uses_numba[number] == uncompiled and fault.effect not in done
        ]
        if numbers:
            _plant_in_process(tree, folder, report, seconds * (UNCOMPILED if uncompiled else 1.0), numbers, uncompiled)
    rows = {row.effect: row for row in rows_in(folder)}
    return [rows[fault.effect] for fault in planned]


def _plant_in_process(
    tree: Path, folder: Path, report: Callable[[str], None], seconds: float, numbers: Sequence[int], uncompiled: bool
) -> None:
    """Plant the faults of these numbers in one process, which writes their rows."""
    variables = {"PYTHONPATH": str(tree / "src"), "OMP_NUM_THREADS": "1", "NUMBA_DISABLE_JIT": str(int(uncompiled))}
    variables["TRIBODYN_CACHE"] = "off"  # what was built without a fault would hide it
    words = [sys.executable, "-B", "-m", "proof.planting", str(folder), str(seconds)]
    with subprocess.Popen(
        [*words, *map(str, numbers)], cwd=tree, env=os.environ | variables, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            report(line.strip())
    if process.returncode:
        raise SolverFailure(f"planting ended with exit code {process.returncode}: see {folder / 'printed'}")


def rows_in(folder: Path) -> list[Detection]:
    """The rows that a folder holds, the last one of each fault."""
    path = folder / ROWS
    rows = [Detection(**json.loads(line)) for line in path.read_text().splitlines()] if path.exists() else []
    return list({row.effect: row for row in rows}.values())


def as_markdown(rows: Sequence[Detection]) -> str:
    """Table of the faults and what detects each, with the counts above it."""
    counts = Counter((bool(row.test), bool(row.cell)) for row in rows)
    large = [row for row in rows if row.change > LARGE]
    n_failing = sum(row.change == float("inf") for row in large)
    lines = [
        f"{sum(row.is_detected for row in rows)} of {len(rows)} planted faults are detected: {counts[True, False]} by "
        f"tests, {counts[False, True]} by extremes alone. Of the {len(large)} that change a result of the reference "
        f"runs by more than 0.1 %, {sum(row.is_detected for row in large)} are detected; {n_failing} of these count "
        "because such a run then fails or does not end.",
        "",
        "| file | fault | largest change | of | detected by |",
        "|---|---|---|---|---|",
    ]
    for row in rows:
        detector = row.test.rpartition("/")[2].replace("::", " ").partition("[")[0] or row.cell.partition(": ")[0]
        share = _percent(row.change)
        lines.append(f"| {row.file} | {row.effect} | {share} | {row.number} | {detector or 'nothing'} |")
    return "\n".join(lines) + "\n"


def _percent(change: float) -> str:
    """A relative change in per cent."""
    if change == float("inf"):
        return "fails"
    return "none" if change == 0 else f"{100 * change:.2g} %" if change < 10 else f"x {1 + change:.2g}"
