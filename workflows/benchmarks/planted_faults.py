"""Faults planted in a copy of the sources, one at a time: which tests see them, what extremes sees, what they change.

The list is planted_faults.toml beside this file. The tests are those of the fault's room, those named after its file
first, until the first fails or their processor seconds are spent. Where none fails, the judge of `extremes` is asked on
every so many of its quick cells. Where that sees nothing either, a few small scenes tell how much the fault changes.
"""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

LIST = Path(__file__).with_suffix(".toml")
ROWS = "rows.jsonl"
COPIED = ("fem", "geometry", "hbm", "reduction", "workflows", "src", "tests", "pyproject.toml", "README.md")
JUDGED = 30  # every so many of the quick cells of extremes
SECONDS = 25.0  # of the processor, for the tests of one fault, and again for the judge
COMPILING = 40.0  # seconds more where the file is compiled: what calls it is compiled anew
SOLVED = ("hbm/", "reduction/")  # what extremes looks at; it takes the matrices as they are
PROBED = 6  # times the seconds, for the small scenes
LARGE = 1e-3  # relative change of a result from which on a fault must be seen
PROBES = {
    "beam": (
        "geometry.n_patch=3", "geometry.n_length=4", "geometry.n_height=1", "reduction.modes=4", "response.points=20",
        "wear.max_steps=4",
    ),
    "blade": (
        "geometry.n_span=4", "geometry.n_side=1", "geometry.n_root=1", "reduction.cutoff=6 kHz", "response.points=20",
        "wear.max_steps=2",
    ),
    "leaf_seal": ("geometry.n_column=7", "geometry.pin_column=2", 'response.frequency=["100 Hz", "140 Hz"]'),
}  # fmt: skip
"""Scenes and what makes them small: what an unseen fault changes is told by them."""


@dataclass(frozen=True)
class Fault:
    """file : from the root of the tree; old : stands in it once; new : replaces it; room : whose tests are run."""

    file: str
    old: str
    new: str
    does: str
    room: str


@dataclass(frozen=True)
class Seen:
    """tests : the first test that fails, "" where none does; extremes : a cell that is wrong, "" where none is or none
    was asked, because a test fails already.

    change : largest relative one of the results of PROBES, where neither sees it and it can be told
    """

    file: str
    does: str
    tests: str
    extremes: str
    change: float | None = None

    @property
    def caught(self) -> bool:
        """Whether something sees it."""
        return bool(self.tests or self.extremes)


def faults() -> tuple[list[Fault], dict[str, list[str]]]:
    """The list, and the tests of each room."""
    data = tomllib.loads(LIST.read_text(encoding="utf-8"))
    return [Fault(**({"room": one["file"].partition("/")[0]} | one)) for one in data["fault"]], data["tests"]


def run(
    tree: Path, folder: Path, say: Callable[[str], None], seconds: float = SECONDS, again: bool = False
) -> list[Seen]:
    """Plant every fault in a copy of a tree; those that `folder` holds already are left out.

    tree : root of a clone; folder : of the copy and of the rows; seconds : of the processor for the tests of a fault
    again : plant those once more that nothing has seen, in a new copy of the tree
    Raises  ValueError where the tree is no clone, or a text does not stand once in its file
    """
    listed, tests = faults()
    if not (tree / "tests").is_dir():
        raise ValueError(f"{tree} holds no tests: plant faults from a clone of the repository")
    copy = folder / "tree"
    if again:
        shutil.rmtree(copy, ignore_errors=True)
    if not copy.exists():
        copied(tree, copy)
    for fault in listed:  # a run that was killed leaves its fault
        if (copy / fault.file).read_text(encoding="utf-8") != (original := (tree / fault.file).read_text("utf-8")):
            _replace(copy, fault.file, original)
    done = {(row.file, row.does): row for row in rows_in(folder) if row.caught or not again}
    base: dict[str, float] = {}  # of the copy without a fault, once it is needed
    for number, fault in enumerate(listed, start=1):
        if (fault.file, fault.does) in done:
            continue
        planted(copy, fault, tree)
        try:
            row, now = _seen(copy, fault, tests[fault.room], seconds)
        finally:
            _replace(copy, fault.file, (tree / fault.file).read_text(encoding="utf-8"))
        if now:
            base = base or probed(copy, PROBED * seconds)
            row = replace(row, change=_change(base, now))
        with (folder / ROWS).open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(row)) + "\n")
        done[(fault.file, fault.does)] = row
        told = row.tests or row.extremes or f"unseen, {row.change}"
        say(f"{number} of {len(listed)}: {row.file}, {row.does}: {told}")
    return [done[(fault.file, fault.does)] for fault in listed]


def _seen(copy: Path, fault: Fault, tests: Sequence[str], seconds: float) -> tuple[Seen, dict[str, float]]:
    """What sees a planted fault, and the results of PROBES with it where nothing does."""
    if "numba" in (copy / fault.file).read_text(encoding="utf-8"):
        seconds += COMPILING
    name = Path(fault.file).stem
    by_tests = failing(copy, sorted(tests, key=lambda test: name not in test), seconds)
    asked = not by_tests and fault.file.startswith(SOLVED)
    by_extremes = wrong_cell(copy, seconds) if asked else ""
    now = {} if by_tests or by_extremes else probed(copy, PROBED * seconds)
    return Seen(fault.file, fault.does, by_tests, by_extremes), now


def rows_in(folder: Path) -> list[Seen]:
    """The rows that a folder holds, the last one of each fault."""
    path = folder / ROWS
    rows = [Seen(**json.loads(line)) for line in path.read_text().splitlines()] if path.exists() else []
    return list({(row.file, row.does): row for row in rows}.values())


def copied(tree: Path, copy: Path) -> None:
    """Copy what runs and what tests."""
    copy.mkdir(parents=True)
    for name in COPIED:
        if (tree / name).is_dir():
            unwanted = shutil.ignore_patterns("__pycache__", "results")
            shutil.copytree(tree / name, copy / name, symlinks=True, ignore=unwanted)
        else:
            shutil.copy(tree / name, copy / name)


def planted(copy: Path, fault: Fault, tree: Path) -> None:
    """Put a fault into the copy; raises ValueError where its text does not stand once in its file."""
    text = (tree / fault.file).read_text(encoding="utf-8")
    if text.count(fault.old) != 1:
        raise ValueError(f"{fault.file} does not hold this text exactly once: {fault.old}")
    _replace(copy, fault.file, text.replace(fault.old, fault.new))


def _replace(copy: Path, file: str, text: str) -> None:
    """Write a file of the copy, and forget what holds it compiled: its callers hold the compiled callee."""
    if "numba" in text:
        shutil.rmtree(copy.parent / "compiled", ignore_errors=True)
    (copy / file).write_text(text, encoding="utf-8")


def failing(copy: Path, tests: Sequence[str], seconds: float) -> str:
    """The first test that fails, "" where none does in the seconds."""
    words = ["-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-m", "not slow", *tests]
    code, printed = _python(copy, words, seconds)
    if code in (0, None):
        return ""
    found = re.search(r"^(?:FAILED|ERROR) (\S+)", printed, re.MULTILINE)
    return found.group(1) if found else f"exit code {code}"


def wrong_cell(copy: Path, seconds: float) -> str:
    """A cell of extremes that is wrong, "" where none is."""
    _, printed = _python(copy, ["-m", "tribodyn.workflows.benchmarks.planted_faults", "judge"], seconds)
    lines = [line.removeprefix("wrong: ") for line in printed.splitlines() if line.startswith("wrong: ")]
    return lines[0] if lines else ""


def probed(copy: Path, seconds: float) -> dict[str, float]:
    """Results of PROBES by their names; what fails is left out."""
    _, printed = _python(copy, ["-m", "tribodyn.workflows.benchmarks.planted_faults", "probe"], seconds)
    values: dict[str, float] = {}
    for line in printed.splitlines():
        if line.startswith("probe: "):
            values |= json.loads(line.removeprefix("probe: "))
    return values


def _change(base: dict[str, float], now: dict[str, float]) -> float | None:
    both = [(base[name], now[name]) for name in base.keys() & now.keys()]
    return max((abs(b - a) / max(abs(a), 1e-300) for a, b in both), default=None)


def _python(copy: Path, words: Sequence[str], seconds: float) -> tuple[int | None, str]:
    """Exit code (None where the seconds of the processor are spent) and output of a Python that runs the copy."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 5))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    own = {"PYTHONPATH": str(copy / "src"), "NUMBA_CACHE_DIR": str(copy.parent / "compiled"), "OMP_NUM_THREADS": "1"}
    ended = subprocess.run(
        [sys.executable, *words], cwd=copy, env=os.environ | own, preexec_fn=limit, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    return None if ended.returncode < 0 else ended.returncode, ended.stdout + ended.stderr


def as_markdown(rows: Sequence[Seen]) -> str:
    """What was seen of every fault, as a table, and the counts above it."""
    seen = Counter((bool(row.tests), bool(row.extremes)) for row in rows)
    caught = sum(row.caught for row in rows)
    unseen = [row for row in rows if not row.caught]
    large = sum((row.change or 0.0) > LARGE for row in unseen)
    lines = [
        f"{caught} of {len(rows)} planted faults are seen: {seen[True, True]} by tests and extremes, "
        f"{seen[True, False]} by tests alone, {seen[False, True]} by extremes alone. Of the {len(unseen)} unseen ones "
        f"{large} change a result of the small scenes by more than 0.1 %.",
        "",
        "| file | fault | seen by tests | by extremes | change where unseen |",
        "|---|---|---|---|---|",
    ]
    for row in rows:
        test = row.tests.rpartition("/")[2].replace("::", " ").partition("[")[0]
        cell = row.extremes.partition(": ")[0]
        change = "" if row.caught else "not told" if row.change is None else f"{row.change:.1e}"
        lines.append(f"| {row.file} | {row.does} | {test} | {cell} | {change} |")
    return "\n".join(lines) + "\n"


def _judge() -> None:
    from tribodyn.workflows.benchmarks import extremes

    for position, (model, varied, setting, judge) in enumerate(extremes.cells(quick=True)):
        if position % JUDGED:
            continue
        verdict = extremes.outcome_of(judge)
        if verdict.outcome == extremes.WRONG:
            print(f"wrong: {model}, {varied} {setting}: {verdict.reason}", flush=True)
            return


def _probe() -> None:
    from tribodyn.workflows.run import pipeline
    from tribodyn.workflows.run.progress import Progress
    from tribodyn.workflows.scene import scene_file

    for scene, overrides in PROBES.items():
        try:
            result = pipeline.run(scene_file.read(scene, (*overrides, "verdict.enabled=false")), None, Progress())
        except Exception as failure:  # of a planted fault: it may be anything
            print(f"{scene}: {failure}")
            continue
        values = {
            f"{scene} {name}": float(number)
            for name, value in result.summary().items()
            for number in (value if isinstance(value, (list, tuple)) else [value])
            if isinstance(number, float) and "second" not in name
        }
        print("probe: " + json.dumps(values), flush=True)


if __name__ == "__main__":
    {"judge": _judge, "probe": _probe}[sys.argv[1]]()
