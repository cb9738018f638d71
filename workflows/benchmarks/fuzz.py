"""Nasty values for every key of a scene: each run ends well, is refused, or fails with a sentence, and in time.

Every run is the command `tribodyn run` in a process of its own, forked from one that has loaded everything. A limit of
its processor seconds kills what does not end. A value that reading the scene refuses needs no run, and of several that
make the same scene (`1`, `true` for a switch, a value that is the key's default) one is run.
"""

from __future__ import annotations

import os
import resource
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from multiprocessing import connection, get_context
from multiprocessing.process import BaseProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from tribodyn.fem import factor
from tribodyn.workflows.accuracy.time_limit import processor_seconds
from tribodyn.workflows.command.exits import BAD_INPUT, FAILED_SOLVE
from tribodyn.workflows.result import store
from tribodyn.workflows.run import pipeline  # noqa: F401  # loaded once, before the processes are forked
from tribodyn.workflows.scene import scene_file

NASTY = (
    "-1", "0", "1", "1e-300", "1e300", "-1e300", "nan", "inf", "-inf", "3.5", "1000000", "true", '""', '"abc"', "[]",
    "[1]", "[[1]]", "{}", '"1 parsec"', '"-1 mm"', '"1e300 kN"', '"1e-300 s"', '"0 Hz"', '"nan Hz"', '"inf N"',
    '"250 %"', '"1e12 N/um"', '"../x"', "[1, 2, 3, 4, 5, 6, 7]", '["a", "b"]',
)  # fmt: skip
"""TOML values, thirty of them."""

ENDS = {0: "success", BAD_INPUT: "refused", FAILED_SOLVE: "failed"}
GOOD = (*ENDS.values(),)
LATE = 10.0  # times the limit, of the clock, after which a process that sleeps is killed; what compiling may take


@dataclass
class Running:
    """What a process tries; place : its folder; worked : its processor seconds so far; since : when it last worked."""

    key: str
    value: str
    place: Path
    worked: float
    since: float


Active = dict[BaseProcess, Running]


@dataclass(frozen=True)
class Tried:
    """One value of one key.

    end : success, refused or failed (with one sentence), else what is wrong with it; said : the sentence, or what was
    printed; seconds : of the processor; like : another key=value that makes the same scene and was run, empty for a run
    """

    scene: str
    key: str
    value: str
    end: str
    said: str
    seconds: float
    like: str = ""

    @property
    def good(self) -> bool:
        """Whether the run ended as a run may."""
        return self.end in GOOD

    def record(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def keys(scene: str, overrides: Sequence[str] = ()) -> list[str]:
    """Every section and key of a scene, "section.key", those at their defaults included."""
    return sorted(set(_names(scene_file.read(scene, overrides).scene.model_dump(), "")))


def _names(table: dict[str, Any], above: str) -> Iterator[str]:
    for name, value in table.items():
        own = name == "parameters"  # of a part: keys of the table around them
        if not own:
            yield f"{above}{name}"
        if isinstance(value, dict):
            yield from _names(value, above if own else f"{above}{name}.")


def cases(scene: str, overrides: Sequence[str], runs: int | None = None, seed: int = 0) -> list[tuple[str, str]]:
    """Pairs of a key and a value, all of them or `runs` drawn at random."""
    every = [(key, value) for key in keys(scene, overrides) for value in NASTY]
    if runs is None or runs >= len(every):
        return every
    chosen = np.random.default_rng(seed).choice(len(every), runs, replace=False)
    return [every[i] for i in sorted(chosen)]


def fuzz(
    scene: str,
    overrides: Sequence[str] = (),
    runs: int | None = None,
    seed: int = 0,
    seconds: float = 10.0,
    workers: int = 1,
    say: Callable[[str], None] = lambda sentence: None,
    *,
    command: Callable[[list[str]], None],
) -> list[Tried]:
    """Try nasty values of the keys of a scene, one at a time.

    overrides : that make the scene small, so that a run takes a second; runs : how many pairs of key and value, drawn
    with `seed`, all by default; seconds : of the processor that a run may take
    command : what `tribodyn` does with the words of a command line; it leaves by SystemExit
    Raises  SceneError for a scene that cannot be read, ValueError where processes cannot be forked
    """
    if not hasattr(os, "fork"):
        raise ValueError("this system cannot fork processes, as fuzz does")
    factor.pardiso_available()  # loads it
    todo = cases(scene, overrides, runs, seed)
    fork = get_context("fork")
    found: list[Tried] = []
    active: Active = {}
    with TemporaryDirectory() as folder:  # the scene as it is: compiles what is not compiled yet, which takes its time
        unchanged = fork.Process(target=_run, args=(command, scene, tuple(overrides), Path(folder), LATE * seconds))
        unchanged.start()
        unchanged.join(LATE * seconds)
        unchanged.kill()
    first: dict[str, tuple[str, str]] = {}  # by the scene that is meant: who runs it
    same: list[tuple[str, str, tuple[str, str]]] = []
    with TemporaryDirectory() as folder:
        for number, (key, value) in enumerate(todo):
            if number % 1000 == 999:
                wrong = sum(not one.good for one in found)
                say(f"{scene}: {number + 1} of {len(todo)} values, {len(first)} runs, {wrong} wrong ends")
            meant = _read(scene, (*overrides, f"{key}={value}"), seconds)
            if meant.refusal:
                found.append(Tried(scene, key, value, ENDS[BAD_INPUT], f"tribodyn: {meant.refusal}", meant.seconds))
                continue
            if meant.text and first.setdefault(meant.text, (key, value)) != (key, value):
                same.append((key, value, first[meant.text]))
                continue
            while len(active) >= workers:
                found += _ended(scene, active, seconds)
            place = Path(folder) / str(number)
            place.mkdir()
            changed = (*overrides, f"{key}={value}")
            process: BaseProcess = fork.Process(target=_run, args=(command, scene, changed, place, seconds))
            process.start()
            active[process] = Running(key, value, place, 0.0, time.monotonic())
        while active:
            found += _ended(scene, active, seconds)
    run = {(one.key, one.value): one for one in found}
    found += [replace(run[who], key=key, value=value, like="=".join(who)) for key, value, who in same]
    return sorted(found, key=lambda one: (one.key, NASTY.index(one.value)))


@dataclass(frozen=True)
class _Meant:
    """What a scene file with a value means: the scene as text, or the sentence that refuses it; both empty if neither.

    seconds : of the processor
    """

    text: str
    refusal: str
    seconds: float


def _read(scene: str, overrides: tuple[str, ...], seconds: float) -> _Meant:
    """Read a scene; what is no refusal in one line is left for the command to meet again."""
    clock = time.process_time()
    try:
        with warnings.catch_warnings(), processor_seconds(seconds):
            warnings.simplefilter("error")
            text, refusal = scene_file.read(scene, overrides).scene.model_dump_json(), ""
    except scene_file.SceneError as error:
        text, refusal = "", str(error)
    except Exception:  # a traceback of the command tells more
        text = refusal = ""
    return _Meant(text, "" if "\n" in refusal else refusal, time.process_time() - clock)


def _ended(scene: str, active: Active, seconds: float) -> list[Tried]:
    """Wait for a process to end; those that have are taken from `active`, those that sleep too long are killed.

    A busy machine makes a run late, not wrong: only the clock of a process that does not work runs.
    """
    connection.wait([process.sentinel for process in active], timeout=1.0)
    found = []
    for process, running in list(active.items()):
        if (worked := _worked(process.pid)) > running.worked:
            running.worked, running.since = worked, time.monotonic()
        if process.is_alive() and time.monotonic() - running.since > LATE * seconds:
            process.kill()
            process.join()
        if process.is_alive():
            continue
        process.join()
        del active[process]
        place = running.place
        printed = (place / "printed").read_text(errors="replace") if (place / "printed").exists() else ""
        spent = float((place / "spent").read_text()) if (place / "spent").exists() else seconds
        end = _end(process.exitcode, printed, place / "out" / "result.h5")
        lines = [line for line in printed.splitlines() if line.startswith("tribodyn:")] if end in GOOD else [printed]
        found.append(Tried(scene, running.key, running.value, end, "\n".join(lines)[-2000:], spent))
    return found


def _worked(pid: int | None) -> float:
    """Processor seconds of a process, 0 where the system does not tell (Linux does, in /proc)."""
    try:
        told = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(told[11]) + int(told[12])) / os.sysconf("SC_CLK_TCK")


def _end(code: int | None, printed: str, file: Path) -> str:
    if code is not None and code < 0:
        return "too long" if "Fatal" not in printed else f"killed by signal {-code}"
    if "Traceback" in printed or code not in ENDS:
        return "traceback"
    if "Warning" in printed:
        return "a warning of a library"
    if code == 0 and (what := _not_finite(file)):
        return f"not finite: {what}"
    if code and sum(line.startswith("tribodyn:") for line in printed.splitlines()) != 1:
        return "no sentence"
    return ENDS[code]


def _not_finite(file: Path) -> str:
    """A number of the result that is none, or a verdict that states nothing as something."""
    summary = store.load(file).summary()
    for name, value in summary.items():
        numbers = value if isinstance(value, (list, tuple)) else [value]
        if any(isinstance(number, float) and not np.isfinite(number) for number in numbers):
            return name
    for name, said in (summary["verdict"] or {}).items():
        if said["stated"] and said["value"] is None:
            return f"verdict of {name}"
    return ""


def _run(
    command: Callable[[list[str]], None], scene: str, overrides: tuple[str, ...], place: Path, seconds: float
) -> None:
    """The command in this process, which ends with its exit code."""
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (int(np.ceil(seconds)), hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with (place / "printed").open("w") as printed:
        os.dup2(printed.fileno(), 1)
        os.dup2(printed.fileno(), 2)
        sys.stdout = sys.stderr = printed
        words = ["run", scene, "--no-pictures", "--out", str(place / "out")]
        try:
            command([*words, *(word for text in overrides for word in ("--set", text))])
        finally:
            printed.flush()
            (place / "spent").write_text(str(time.process_time()))


def counts(tried: Sequence[Tried]) -> dict[str, dict[str, int]]:
    """How often each end came, by scene."""
    return {scene: dict(Counter(one.end for one in tried if one.scene == scene)) for scene in {t.scene for t in tried}}
