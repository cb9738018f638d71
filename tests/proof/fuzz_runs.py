"""Runs of fuzzed scenes: each is the command `tribodyn run` in a process of its own, and how it ended.

The processes are forked from one that has run the scene as it is, with all packages and compiled kernels in its memory.
A limit of its processor seconds kills a run that does not end.
"""

from __future__ import annotations

import os
import resource
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from multiprocessing import connection, get_context
from multiprocessing.process import BaseProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.proof import fuzz_result
from tribodyn.workflows.command.exits import BAD_INPUT, FAILED_SOLVE

ENDS = {0: "success", BAD_INPUT: "refused", FAILED_SOLVE: "failed"}
REFUSED, ACCEPTED = "refused when read", "accepted when read"  # without a run
WARNED = "a warning of a library"
GOOD = (*ENDS.values(), REFUSED, ACCEPTED)
LATE = 10.0  # times the limit, of the clock, after which a process that sleeps is killed; what compiling may take
PRINTED, SPENT, RESULT = "printed", "spent", "out/result.h5"  # in the folder of a run

Case = tuple[str, str]  # key and value
Command = Callable[[list[str]], None]


@dataclass(frozen=True)
class Tried:
    """One value of one key.

    end : success, refused or failed (with one sentence), else what is wrong with it; without a run how reading ended
    said : the sentence, or what was printed; seconds : of the processor
    like : another key=value that makes the same scene and stands for it, empty where it is the one
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


@dataclass
class _Running:
    """What a process tries; place : its folder; worked : its processor seconds so far; since : when it last worked."""

    key: str
    value: str
    place: Path
    worked: float
    since: float


_Active = dict[BaseProcess, _Running]


@dataclass(frozen=True)
class Runs:
    """Of a scene with its own changes; seconds : of the processor that a run may take; workers : runs at a time.

    command : what `tribodyn` does with the words of a command line; it leaves by SystemExit
    """

    scene: str
    overrides: tuple[str, ...]
    seconds: float
    workers: int
    command: Command

    def of(self, todo: Sequence[Case]) -> Iterator[Tried]:
        """Run cases; they come as they end.

        Raises  RuntimeError where the scene as it is does not end well
        """
        fork = get_context("fork")
        told, tells = fork.Pipe(duplex=False)
        warm = fork.Process(target=self._warm, args=(tells, todo))
        warm.start()
        tells.close()
        try:
            while True:
                one = told.recv()
                if isinstance(one, str):
                    raise RuntimeError(f"{self.scene} as it is does not end well: {one}; try it with tribodyn run")
                yield one
        except EOFError:
            warm.join()
        finally:
            warm.terminate()
        if warm.exitcode:
            raise RuntimeError(f"{self.scene} as it is does not end within {LATE * self.seconds:g} s of the processor")

    def _warm(self, tells: connection.Connection, todo: Sequence[Case]) -> None:
        """Run the scene as it is in this process, then fork one for each case."""
        with TemporaryDirectory() as name:
            folder = Path(name)
            before = resource.getrlimit(resource.RLIMIT_CPU)
            code = self._run(self.overrides, folder, LATE * self.seconds)  # compiles what is not compiled yet
            resource.setrlimit(resource.RLIMIT_CPU, before)
            if (end := _end(code, folder)) not in GOOD:
                tells.send(end)
                return
            shutil.rmtree(folder / "out", ignore_errors=True)
            for one in self._forked(folder, todo):
                tells.send(one)

    def _forked(self, folder: Path, todo: Sequence[Case]) -> Iterator[Tried]:
        active: _Active = {}
        for number, (key, value) in enumerate(todo):
            while len(active) >= self.workers:
                yield from self._ended(active)
            place = folder / str(number)
            place.mkdir()
            changed = (*self.overrides, f"{key}={value}")
            process: BaseProcess = get_context("fork").Process(target=self._leave, args=(changed, place))
            process.start()
            active[process] = _Running(key, value, place, 0.0, time.monotonic())
        while active:
            yield from self._ended(active)

    def _ended(self, active: _Active) -> list[Tried]:
        """Wait for a process to end; those that have are taken from `active`, those that sleep too long are killed.

        A busy machine makes a run late, not wrong: only the clock of a process that does not work runs.
        """
        connection.wait([process.sentinel for process in active], timeout=1.0)
        found = []
        for process, running in list(active.items()):
            if (worked := _worked(process.pid)) > running.worked:
                running.worked, running.since = worked, time.monotonic()
            if process.is_alive() and time.monotonic() - running.since > LATE * self.seconds:
                process.kill()
                process.join()
            if process.is_alive():
                continue
            process.join()
            del active[process]
            place = running.place
            end, printed = _end(process.exitcode, place), _told(place)
            spent = float((place / SPENT).read_text()) if (place / SPENT).exists() else self.seconds
            mark = "tribodyn:" if end in GOOD else "Warning" if end == WARNED else ""
            lines = [line for line in printed.splitlines() if mark in line]
            found.append(Tried(self.scene, running.key, running.value, end, "\n".join(lines)[-2000:], spent))
            shutil.rmtree(place)
        return found

    def _leave(self, overrides: tuple[str, ...], place: Path) -> None:
        """The command as what this process is: it ends with its exit code."""
        sys.exit(self._run(overrides, place, self.seconds))

    def _run(self, overrides: tuple[str, ...], place: Path, seconds: float) -> Any:
        """The command in this process, which is killed after so many seconds of the processor; its exit code."""
        _, hard = resource.getrlimit(resource.RLIMIT_CPU)
        resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time() + seconds) + 1, hard))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        words = ["run", self.scene, "--no-pictures", "--out", str(place / "out")]
        began = time.process_time()
        with _printing(place / PRINTED):
            try:
                self.command([*words, *(word for text in overrides for word in ("--set", text))])
            except SystemExit as left:
                return left.code
            except BaseException:  # as the interpreter shows it
                sys.excepthook(*sys.exc_info())
                return 1
            finally:
                (place / SPENT).write_text(str(time.process_time() - began))
        return 0


@contextmanager
def _printing(file: Path) -> Iterator[None]:
    """Into a file goes what this process prints, libraries in C included."""
    streams = sys.stdout, sys.stderr
    for stream in streams:
        stream.flush()
    kept = os.dup(1), os.dup(2)
    with file.open("w") as printed:
        os.dup2(printed.fileno(), 1)
        os.dup2(printed.fileno(), 2)
        sys.stdout = sys.stderr = printed
        try:
            yield
        finally:
            printed.flush()
            sys.stdout, sys.stderr = streams
            for number, own in zip((1, 2), kept, strict=True):
                os.dup2(own, number)
                os.close(own)


def _told(place: Path) -> str:
    file = place / PRINTED
    return file.read_text(errors="replace") if file.exists() else ""


def _worked(pid: int | None) -> float:
    """Processor seconds of a process, 0 where the system does not tell (Linux does, in /proc)."""
    try:
        told = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(told[11]) + int(told[12])) / os.sysconf("SC_CLK_TCK")


def _end(code: int | None, place: Path) -> str:
    """How a run ended that left an exit code and a folder."""
    printed = _told(place)
    if code is not None and code < 0:
        return "too long" if "Fatal" not in printed else f"killed by signal {-code}"
    if "Traceback" in printed or code not in ENDS:
        return "traceback"
    if "Warning" in printed:
        return WARNED
    if code == 0 and (what := fuzz_result.wrong(place / RESULT)):
        return what
    if code and sum(line.startswith("tribodyn:") for line in printed.splitlines()) != 1:
        return "no sentence"
    return ENDS[code]
