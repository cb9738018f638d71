"""Progress of a run for its user, with the time left on long work."""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress as Bar, TaskProgressColumn, TextColumn

from tribodyn.output_file import printable
from tribodyn.refusal import Refusal

Advance = Callable[..., None]  # called with the share of long work that is done, a note, and the point it has come to
NOTE_EVERY = 10.0  # seconds between lines where there is no terminal to draw a bar on
FORESEEN = 0.02  # share of the work from which on the time left is given: the first steps compile


class Progress:
    """Reports stages and long work on a console, and in a log file; without both it reports nothing."""

    def __init__(self, console: Console | None = None, log: Path | None = None, details: bool = True):
        self._console, self._log, self._details = console, log, details
        self._last_line = 0.0

    @property
    def silent(self) -> bool:
        """Whether nothing of it is read."""
        return self._console is None and self._log is None

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """A stage of unknown length."""
        start = time.perf_counter()
        with self._lines_while_silent(name, start):
            yield
        self.detail(f"{name}: {time.perf_counter() - start:.1f} s")

    @contextmanager
    def _lines_while_silent(self, name: str, start: float) -> Iterator[None]:
        """Where there is no terminal, a line after each NOTE_EVERY in which nothing else was printed."""
        if self._console is None or self._console.is_terminal:
            yield
            return
        done = threading.Event()

        def print_line() -> None:
            while not done.wait(max(NOTE_EVERY, 0.1)):
                if time.perf_counter() - self._last_line >= 0.9 * NOTE_EVERY:
                    self.say(f"{name}: {time.perf_counter() - start:.0f} s so far")

        self._last_line = start
        thread = threading.Thread(target=print_line, daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()

    @contextmanager
    def track(self, name: str) -> Iterator[Advance]:
        """Long work: yields a function to call with the share that is done and a note."""
        start = time.perf_counter()
        if self._console is None:
            yield self._lines(name, start) if self._log else lambda *_: None
        elif self._console.is_terminal:
            columns = (TextColumn("{task.description}"), BarColumn(12), TaskProgressColumn())
            remaining, before = TextColumn("{task.fields[left]}{task.fields[note]}"), compiled()
            with Bar(*columns, remaining, console=self._console, transient=True) as bar:
                task = bar.add_task(name, total=1.0, left="", note="")
                log = self._lines(name, start, on_console=False) if self._log else None

                def advance(share: float, note: str, *_: object) -> None:
                    remaining = time_left(share, start, compiled() - before)
                    gap = "; " if remaining and note else ""
                    bar.update(task, completed=min(share, 1.0), left=remaining, note=gap + note)
                    if log is not None:
                        log(share, note)

                yield advance
        else:
            with self._lines_while_silent(name, start):
                yield self._lines(name, start)
        self.detail(f"{name}: {time.perf_counter() - start:.1f} s")

    def _lines(self, name: str, start: float, on_console: bool = True) -> Advance:
        """Lines from time to time; on_console : whether they go there too."""
        last, before = start, compiled()

        def advance(share: float, note: str, *_: object) -> None:
            nonlocal last
            now, compiling = time.perf_counter(), compiled() - before
            if now - last >= NOTE_EVERY and share > 0:
                last = now
                remaining = time_left(share, start, compiling)
                done = f"{share:.0%}" if share <= 1.0 else "longer than estimated"
                line = f"{name}: {done}{', ' if remaining else ''}{remaining}; {note}".rstrip("; ")
                (self.say if on_console else self._write)(line)

        return advance

    def say(self, text: str) -> None:
        """One line."""
        text, self._last_line = printable(text), time.perf_counter()
        if self._console is not None:
            self._console.print(text, highlight=False, soft_wrap=True, markup=False)
        if self._log is not None:
            self._write(text)

    def detail(self, text: str) -> None:
        """One line for who wants all of them; a log has it always."""
        if self._details:
            self.say(text)
        elif self._log is not None:
            self._write(text)

    def _write(self, text: str) -> None:
        assert self._log is not None
        with self._log.open("a", encoding="utf-8") as file:
            file.write(f"{datetime.now().astimezone().isoformat(timespec='seconds')} {text}\n")


def time_left(share: float, start: float, compiling: float) -> str:
    """Seconds left when a share of the work is done, compiling apart, since it happens once.

    start : of the work, as of time.perf_counter; compiling : seconds spent on it since then"""
    steady = max(time.perf_counter() - start - compiling, 0.0)
    remaining = f"{steady * (1 / share - 1):.0f} s left" if FORESEEN <= share <= 1.0 else ""
    compilation = f"(compiled for {compiling:.0f} s, once)" if compiling >= 1 else ""
    return " ".join(filter(None, [remaining, compilation]))


Callback = Callable[[str, float | None], None]
"""Called with a sentence or the name of a stage, and with the share of the stage that is done, None for a sentence."""


class CallbackProgress(Progress):
    """Reports to a function instead of a console."""

    def __init__(self, callback: Callback):
        super().__init__()
        self._callback = callback

    @contextmanager
    def track(self, name: str) -> Iterator[Advance]:
        """Long work: every advance goes to the callback as it comes."""
        start = time.perf_counter()
        yield lambda share, note, *_: self._callback(f"{name}: {note}" if note else name, min(share, 1.0))
        self.say(f"{name}: {time.perf_counter() - start:.1f} s")

    def say(self, text: str) -> None:
        self._callback(text, None)


Report = Progress | Callback | None
"""Who is informed of what goes on: a function (text, share done or None), a Progress, or nobody."""


def reporter(progress: Report) -> Progress:
    """A Progress of what a caller gives."""
    if progress is None:
        return Progress()
    return progress if isinstance(progress, Progress) else CallbackProgress(progress)


def compiled() -> float:
    """Seconds that numba has compiled in this process since this was first asked, 0 where numba is not in use."""
    global _timer
    if "numba" not in sys.modules:
        return 0.0
    if _timer is None:
        from numba.core import event

        _timer = event.TimingListener()
        event.register("numba:compile", _timer)
    return float(_timer.duration) if _timer.done else 0.0


_timer: Any = None


def console_progress(quiet: bool = False, log: Path | None = None, details: bool = True) -> Progress:
    """Progress on standard output, none of it where quiet; standard error is kept for what goes wrong.

    details : with sizes and the seconds of each stage
    log : file to add every line to; raises ValueError where it cannot be written"""
    if log is not None:
        try:
            log.parent.mkdir(parents=True, exist_ok=True)
            log.open("a").close()
        except OSError as error:
            raise Refusal(f"--log {log}: cannot be written, {str(error.strerror).lower()}") from None
    return Progress(None if quiet else Console(), log, details)
