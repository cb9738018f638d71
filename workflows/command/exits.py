"""How the command ends: its exit code, and one sentence where something was wrong."""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Callable
from typing import TYPE_CHECKING, NoReturn

import cyclopts

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

BAD_INPUT, FAILED_SOLVE, INTERRUPTED = 2, 3, 130
FULL = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC))  # Windows has no quota
READER_LEFT = 128 + 13  # as a shell counts the end by SIGPIPE, which Windows has not


def guard(command: Callable[[], object]) -> None:
    """Run a command and leave with its exit code: 2 after bad input, 3 after a failed solve, 130 after Ctrl-C.

    In silence where who reads the output has seen enough, as head has, with 141
    """
    # a shell without job control starts background jobs with Ctrl-C ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.unraisablehook = _interrupt_again
    try:
        try:
            command()
        finally:
            if sys.stdout is not None:  # as it is where the shell has closed it
                sys.stdout.flush()
    except BrokenPipeError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for stream in (sys.stdout, sys.stderr):  # what is left in them is flushed when the interpreter ends
            os.dup2(nowhere, stream.fileno())
        sys.exit(READER_LEFT)
    except KeyboardInterrupt as stop:
        _leave(INTERRUPTED, str(stop) or "stopped")
    except cyclopts.CycloptsError as error:
        _leave(BAD_INPUT, " ".join(str(error).split()))
    except (ValueError, OSError) as error:
        full = isinstance(error, OSError) and error.errno in FULL
        _leave(BAD_INPUT, f"the disk is full, or no more may be written to it ({error})" if full else str(error))
    except (RuntimeError, MemoryError) as error:
        _leave(FAILED_SOLVE, str(error) or "the memory of this machine is not enough for this scene")


def _interrupt_again(lost: UnraisableHookArgs) -> None:
    """Python drops what is raised while it frees an object: a Ctrl-C that came just then comes again a moment later."""
    if isinstance(lost.exc_value, KeyboardInterrupt):
        threading.Timer(0.01, interrupt_main).start()
    else:
        sys.__unraisablehook__(lost)


def _leave(code: int, sentence: str) -> NoReturn:
    one_line = " ".join(sentence.split()).rstrip(".")
    print(f"tribodyn: {one_line}{'' if one_line.endswith('?') else '.'}", file=sys.stderr)
    sys.exit(code)
