"""The command `tribodyn`: its words, each imported when it is used, its exit code, one sentence where it fails."""

from __future__ import annotations

import errno
import gc
import os
import signal
import sys
import threading
import traceback
from _thread import interrupt_main
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NoReturn

import cyclopts

from tribodyn.output_file import printable
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.version import __version__

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

BAD_INPUT, FAILED_SOLVE, DEFECT, INTERRUPTED = 2, 3, 70, 130
FULL = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC))  # Windows has no quota
READER_LEFT = 128 + 13  # as a shell counts the end by SIGPIPE, which Windows has not
WORDS = {  # word -> where it is, its help on the page of all of them, an example
    "cases": ("cases_word:cases", "List the scenes that come with the program.",
        "cases"),
    "new": ("study_words:new", "Begin a scene from a mesh, a deck or a CAD file.",
        "new part.step --out begun"),
    "run": ("scene_words:run", "Run a scene and leave its result and pictures in a folder.",
        "run beam --set contact.friction=0.3 --out results/low"),
    "inspect": ("study_words:inspect", "Show what a mesh, a deck, a CAD file or a scene holds.",
        "inspect part.step --unit mm"),
    "plan": ("scene_words:plan", "Show what a scene will model, and what it will cost, before running it.",
        "plan beam"),
    "show": ("scene_words:show", "Show what a result holds.",
        "show results/beam --verbose"),
    "draw": ("scene_words:draw", "Draw pictures or films of a result.",
        "draw results/beam --film cycle"),
    "verify": ("study_words:verify", "Check a result against direct time integration.",
        "verify results/beam"),
    "report": ("scene_words:report", "Write one HTML file that shows results.",
        "report results/beam results/low --out report.html"),
    "export": ("scene_words:export", "Write a result in the formats of other programs.",
        "export results/beam --to csv"),
    "curve": ("study_words:curve", "Follow curves: backbone, ring-down."),
    "wheel": ("study_words:wheel", "Wheels: modes, flutter, mistuned blades and patterns of them."),
    "study": ("study_words:study", "Studies: grid, lives, optimise, identify, converge and more."),
}  # fmt: skip

app = cyclopts.App(
    name="tribodyn",
    help="From geometry to worn surface: vibration, friction and fretting wear of jointed parts.",
    help_epilogue="Example: tribodyn run vane",
    version=__version__,
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,
)
for name, (place, meaning, *example) in WORDS.items():
    shown = {"help_epilogue": f"Example: tribodyn {example[0]}"} if example else {}  # a group has its own
    app.command(f"tribodyn.workflows.command.{place}", name=name, help=meaning, **shown)
app.register_install_completion_command(help="Let the shell complete words, options and files.")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command and leave with its exit code, see `guard`."""
    guard(lambda: _run(arguments))


def _run(arguments: Sequence[str] | None) -> None:
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        command, bound, _ = app.parse_args(words, exit_on_error=False, print_error=False)
    except cyclopts.UnknownCommandError as error:
        message = str(error).partition(" Available commands:")[0].rstrip(". ")
        dot = "" if message.endswith("?") else "."
        raise Refusal(f"{message}{dot} Available commands: {', '.join(WORDS)}") from None
    if not gc.isenabled():
        gc.freeze()  # what is imported now is looked through no more
        gc.enable()
    sys.exit(command(*bound.args, **bound.kwargs) or 0)


def guard(command: Callable[[], object]) -> None:
    """Run a command and leave with its exit code: 2 after bad input, 3 after a failed solve, 130 after Ctrl-C.

    Any other exception is a defect of the program: its traceback and 70. A reader that closes the pipe, as head does,
    ends it in silence with 141."""
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
    except (Refusal, OSError) as error:
        full = isinstance(error, OSError) and error.errno in FULL
        _leave(BAD_INPUT, f"the disk is full, or no more may be written to it ({error})" if full else str(error))
    except (SolverFailure, MemoryError) as error:
        _leave(FAILED_SOLVE, str(error) or "the memory of this machine is not enough for this scene")
    except Exception:
        traceback.print_exc()
        _leave(DEFECT, f"this is a defect of tribodyn {__version__}: report it with the lines above and the scene")


def _interrupt_again(lost: UnraisableHookArgs) -> None:
    """Python drops what is raised while it frees an object: a Ctrl-C that came just then comes again a moment later."""
    if isinstance(lost.exc_value, KeyboardInterrupt):
        threading.Timer(0.01, interrupt_main).start()
    else:
        sys.__unraisablehook__(lost)


def _leave(code: int, sentence: str) -> NoReturn:
    one_line = printable(" ".join(sentence.split()).rstrip("."))
    print(f"tribodyn: {one_line}{'' if one_line.endswith('?') else '.'}", file=sys.stderr)
    sys.exit(code)


if __name__ == "__main__":
    main()
