"""A limit of processor seconds on work that nobody needs at any price."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

COMPILERS = ("numba", "llvmlite")
# processor seconds after which TimeUp is raised again where the body continues: longer than any clearing up
REPEAT_SECONDS = 0.2


class TimeUp(BaseException):
    """The processor seconds are used up; no Exception, of which many readers and solvers try another way."""


@contextmanager
def processor_seconds(limit: float) -> Iterator[None]:
    """Raise TimeUp in the body once this process has spent `limit` seconds of the processor in it.

    The timer of a process belongs to its main thread: in another one, and on systems without it, nothing is limited.
    A compiler is not interrupted: a function that is compiled by half could not be called in this process any more.
    TimeUp comes again a moment later where the body goes on: Python drops what is raised while it frees an object or
    in a callback, and a library may catch whatever comes.
    Raises  TimeUp, also at once where `limit` is not above 0, and in place of what a library makes of it: ctypes tells
        an exception in the conversion of an argument as an error of the argument"""
    if limit <= 0:
        raise TimeUp(f"{limit:g} s are left")
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    end = TimeUp(f"{limit:g} s are used up")
    raised = False

    def up(number: int, frame: FrameType | None) -> None:
        nonlocal raised
        if not _compiles(frame):
            raised = True
            raise end

    def lost(unraisable: UnraisableHookArgs) -> None:
        if unraisable.exc_value is not end:
            hook(unraisable)

    hook, sys.unraisablehook = sys.unraisablehook, lost
    before = signal.signal(signal.SIGPROF, up)
    signal.setitimer(signal.ITIMER_PROF, limit, REPEAT_SECONDS)
    try:
        yield
    except Exception as made_of_it:
        if raised:
            raise end from made_of_it
        raise
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
        sys.unraisablehook = hook


def _compiles(frame: FrameType | None) -> bool:
    """Whether a compiler is at work in a frame or in one that has called it."""
    while frame is not None:
        if str(frame.f_globals.get("__name__", "")).partition(".")[0] in COMPILERS:
            return True
        frame = frame.f_back
    return False
