"""Telling a user what is going on, with the time left on long work."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

NOTE_EVERY = 15.0  # seconds between lines where there is no terminal to draw a bar on
FORESEEN = 0.02  # share of the work from which on the time left is told: the first steps compile


class Progress:
    """Reports stages and long work on a console; a quiet one reports nothing."""

    def __init__(self, console: Console | None = None):
        self._console = console

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """A stage of unknown length."""
        start = time.perf_counter()
        yield
        self.say(f"{name}: {time.perf_counter() - start:.1f} s")

    @contextmanager
    def track(self, name: str) -> Iterator[Callable[[float, str], None]]:
        """Long work: yields a function to call with the share that is done and a note."""
        start = time.perf_counter()
        if self._console is None:
            yield lambda share, note: None
        elif self._console.is_terminal:
            columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
            left = (TextColumn("left"), TimeRemainingColumn(), TextColumn("{task.fields[note]}"))
            with Bar(*columns, *left, console=self._console, transient=True) as bar:
                task = bar.add_task(name, total=1.0, note="")
                yield lambda share, note: bar.update(task, completed=min(share, 1.0), note=note)
        else:
            yield self._lines(name, start)
        self.say(f"{name}: {time.perf_counter() - start:.1f} s")

    def _lines(self, name: str, start: float) -> Callable[[float, str], None]:
        last = start

        def advance(share: float, note: str) -> None:
            nonlocal last
            now = time.perf_counter()
            if now - last >= NOTE_EVERY and share > 0:
                last = now
                left = f", {(now - start) * (1 / min(share, 1.0) - 1):.0f} s left" if share >= FORESEEN else ""
                self.say(f"{name}: {min(share, 1.0):.0%}{left}; {note}".rstrip("; "))

        return advance

    def say(self, text: str) -> None:
        """One line."""
        if self._console is not None:
            self._console.print(text, highlight=False)


Callback = Callable[[str, float | None], None]
"""Called with a sentence or the name of a stage, and with the share of the stage that is done, None for a sentence."""


class CallbackProgress(Progress):
    """Reports to a function instead of a console."""

    def __init__(self, callback: Callback):
        super().__init__()
        self._callback = callback

    @contextmanager
    def track(self, name: str) -> Iterator[Callable[[float, str], None]]:
        """Long work: every advance goes to the callback as it comes."""
        start = time.perf_counter()
        yield lambda share, note: self._callback(f"{name}: {note}" if note else name, min(share, 1.0))
        self.say(f"{name}: {time.perf_counter() - start:.1f} s")

    def say(self, text: str) -> None:
        """A sentence."""
        self._callback(text, None)


def console_progress() -> Progress:
    """Progress on standard output; standard error is kept for what goes wrong."""
    return Progress(Console())
