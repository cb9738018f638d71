"""Runs of fuzzed input: each is a command of `tribodyn` in a process of its own, and how it ended.

The processes are forked from one that has run the input as it is, with all packages and compiled kernels in its memory.
A limit of its processor seconds kills a run that does not end, and another one a run that says nothing."""

import os
import resource
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import chdir, contextmanager
from dataclasses import dataclass, field
from multiprocessing import connection, get_context
from multiprocessing.process import BaseProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from proof.fuzzing import fuzz_result
from tribodyn.workflows.command.main import BAD_INPUT, FAILED_SOLVE
from tribodyn.workflows.run import progress
from tribodyn.workflows.studies.many import pool

ENDS = {0: "success", BAD_INPUT: "refused", FAILED_SOLVE: "failed"}
WARNED, LONG = "a warning of a library", "too long"
GOING, SILENT = "ended by us as it went on", "no word of progress"
GOOD = (*ENDS.values(), GOING)
LATE = 10.0  # times the limit, of the clock, after which a process that sleeps is killed; what compiling may take
PRINTED, SPENT, RESULT = "printed", "spent", "out/result.h5"  # in the folder of a run
RUN = ("--no-pictures", "--out", "out")
WORD_EVERY = 1.0  # seconds between words of progress where there is no terminal: what a bar shows at once

Command = Callable[[list[str]], None]


@dataclass(frozen=True)
class FuzzEnd:
    """One case.

    end : success, refused or failed (with one sentence), else what is wrong with it
    output : the sentence, or what was printed; seconds : of the processor
    silent : the longest time without a word of progress, of its processor seconds"""

    scene: str
    key: str
    end: str
    output: str
    seconds: float
    silent: float = 0.0

    @property
    def good(self) -> bool:
        """Whether the run ended as a run may."""
        return self.end in GOOD


@dataclass(frozen=True)
class Job:
    """A command line, and what its folder holds.

    scene, key : what is run, and what is changed in it; files : contents by name"""

    scene: str
    key: str
    words: tuple[str, ...]
    files: Mapping[str, bytes] = field(default_factory=dict)


@dataclass
class _Running:
    """What a process tries; place : its folder; worked : its processor seconds so far; since : when it last worked.

    output : bytes that it has printed; at : its seconds then; silent : longest time between such"""

    job: Job
    place: Path
    since: float
    worked: float = 0.0
    output: int = 0
    at: float = 0.0
    silent: float = 0.0

    def look(self, pid: int | None) -> None:
        """How far the process is by now."""
        if (worked := _worked(pid)) > self.worked:
            self.worked, self.since = worked, time.monotonic()
        file = self.place / PRINTED
        if file.exists() and (size := file.stat().st_size) > self.output:
            self.output, self.at = size, self.worked
        self.silent = max(self.silent, self.worked - self.at)


_Active = dict[BaseProcess, _Running]


@dataclass(frozen=True)
class Runs:
    """Of commands; seconds : of the processor that a run may take without a word; workers : runs at a time.

    first : what each process has run as it is
    command : what `tribodyn` does with the words of a command line; it leaves by SystemExit
    longest : of the processor seconds that a run may take in all, the same by default"""

    first: tuple[Job, ...]
    seconds: float
    workers: int
    command: Command
    longest: float | None = None

    def of(self, todo: Sequence[Job]) -> Iterator[FuzzEnd]:
        """Run jobs; they come as they end.

        Raises  RuntimeError where an input as it is does not end well"""
        fork = get_context("fork")
        receiver, tells = fork.Pipe(duplex=False)
        warm = fork.Process(target=self._warm, args=(tells, todo))
        warm.start()
        tells.close()
        try:
            while True:
                message = receiver.recv()
                if isinstance(message, str):
                    raise RuntimeError(f"{message}; try it with tribodyn")
                yield message
        except EOFError:
            warm.join()
        finally:
            warm.terminate()
        if warm.exitcode:
            raise RuntimeError(f"what is run first does not end within {LATE * self.seconds:g} s of the processor each")

    def _warm(self, tells: connection.Connection, todo: Sequence[Job]) -> None:
        """Run the inputs as they are in this process, then fork one for each job."""
        progress.NOTE_EVERY = WORD_EVERY
        pool.finished = lambda tasks, workers, solve: map(solve, tasks)  # runs of a study in the job's own process
        with TemporaryDirectory() as name:
            folder = Path(name)
            os.environ["TRIBODYN_CACHE"] = str(folder / "kept")
            before = resource.getrlimit(resource.RLIMIT_CPU)
            for number, job in enumerate(self.first):
                place = folder / f"first {number}"
                place.mkdir()
                code = self._run(job, place, LATE * self.seconds)  # compiles what is not compiled yet
                resource.setrlimit(resource.RLIMIT_CPU, before)
                if (end := _end(code, place)) not in GOOD:
                    tells.send(f"{job.scene} as it is does not end well: {end}")
                    return
            for message in self._forked(folder, todo):
                tells.send(message)

    def _forked(self, folder: Path, todo: Sequence[Job]) -> Iterator[FuzzEnd]:
        active: _Active = {}
        for number, job in enumerate(todo):
            while len(active) >= self.workers:
                yield from self._ended(active)
            place = folder / str(number)
            place.mkdir()
            process: BaseProcess = get_context("fork").Process(target=self._leave, args=(job, place))
            process.start()
            active[process] = _Running(job, place, time.monotonic())
        while active:
            yield from self._ended(active)

    def _ended(self, active: _Active) -> list[FuzzEnd]:
        """Wait for a process to end; those that have are taken from `active`, those that sleep too long are killed.

        A busy machine makes a run late, not wrong: only the clock of a process that does not work runs."""
        connection.wait([process.sentinel for process in active], timeout=1.0)
        ends = []
        for process, running in list(active.items()):
            running.look(process.pid)
            mute = self.longest is not None and running.silent > self.seconds
            if process.is_alive() and (mute or time.monotonic() - running.since > LATE * self.seconds):
                process.kill()
                process.join()
            if process.is_alive():
                continue
            process.join()
            del active[process]
            ends.append(self._end_of(running, process.exitcode, mute))
            shutil.rmtree(running.place)
        return ends

    def _end_of(self, running: _Running, code: int | None, mute: bool) -> FuzzEnd:
        job, place = running.job, running.place
        end, printed = _end(code, place), _printed(place)
        if end == LONG and self.longest is not None:
            end = SILENT if mute or not running.output else GOING
        spent = float((place / SPENT).read_text()) if (place / SPENT).exists() else running.worked
        mark = "tribodyn:" if end in GOOD else "Warning" if end == WARNED else ""
        lines = [line for line in printed.splitlines() if mark in line]
        silent = max(running.silent, spent - running.at)
        return FuzzEnd(job.scene, job.key, end, "\n".join(lines)[-2000:], spent, silent=silent)

    def _leave(self, job: Job, place: Path) -> None:
        """The command as what this process is: it ends with its exit code."""
        sys.exit(self._run(job, place, self.longest or self.seconds))

    def _run(self, job: Job, place: Path, seconds: float) -> Any:
        """The command in this process, which is killed after so many seconds of the processor; its exit code."""
        _, hard = resource.getrlimit(resource.RLIMIT_CPU)
        resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time() + seconds) + 1, hard))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        for name, content in job.files.items():
            (place / name).write_bytes(content)
        began = time.process_time()
        with chdir(place), _printing(place / PRINTED):
            try:
                self.command([*job.words])
            except SystemExit as leaving:
                return leaving.code
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
    copies = os.dup(1), os.dup(2)
    with file.open("w") as printed:
        os.dup2(printed.fileno(), 1)
        os.dup2(printed.fileno(), 2)
        sys.stdout = sys.stderr = printed
        try:
            yield
        finally:
            printed.flush()
            sys.stdout, sys.stderr = streams
            for number, copy in zip((1, 2), copies, strict=True):
                os.dup2(copy, number)
                os.close(copy)


def _printed(place: Path) -> str:
    file = place / PRINTED
    return file.read_text(errors="replace") if file.exists() else ""


def _worked(pid: int | None) -> float:
    """Processor seconds of a process, 0 where the system does not tell (Linux does, in /proc)."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _end(code: int | None, place: Path) -> str:
    """How a run ended that left an exit code and a folder."""
    printed = _printed(place)
    if code is not None and code < 0:
        return LONG if "Fatal" not in printed else f"killed by signal {-code}"
    if "Traceback" in printed or code not in ENDS:
        return "traceback"
    if "Warning" in printed:
        return WARNED
    if code == 0 and (place / RESULT).exists() and (trouble := fuzz_result.wrong(place / RESULT)):
        return trouble
    if code and sum(line.startswith("tribodyn:") for line in printed.splitlines()) != 1:
        return "no sentence"
    return ENDS[code]
