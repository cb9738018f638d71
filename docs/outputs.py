"""What the commands of a tutorial print: they are run when the site is built, and their output stands below each.

A page is followed as a reader does: named fences are files, Python is run, commands of tribodyn in this process.
A command that the tests of the same check run too is not run again where they have left what it printed and wrote.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from filelock import FileLock

FOLLOWED = (
    "tutorials/first_run", "tutorials/own_law", "tutorials/own_part", "tutorials/own_matrices",
    "tutorials/does_it_break", "howto/deck", "howto/step", "howto/inspect",
)  # fmt: skip
FENCE = re.compile(r"^```([a-z]+)(?: ([\w.]+))?\n(.*?)^```\n", re.M | re.S)
FIRST = "./tribodyn run vane"
OWN_PART = "./tribodyn run arm.toml --set verdict.enabled=false"
SHARED = {FIRST: "first", OWN_PART: "own_part"}  # commands that tests run, and the folders of what they leave
LINE_LIMIT = 30  # lines of an output


def add(_: Any, name: str, source: list[str]) -> None:
    """Put the output below each command of a page, for Sphinx's event source-read."""
    if name in FOLLOWED:
        source[0] = "".join(_followed(source[0]))


def _followed(text: str) -> Iterator[str]:
    back, at = Path.cwd(), 0
    with TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for fence in FENCE.finditer(text):
                language, word, code = fence.groups()
                yield text[at : fence.end()]
                at = fence.end()
                if word and language != "sh":
                    Path(word).write_text(code, encoding="utf-8")
                elif language == "sh" and not word:
                    output = "".join(map(_output_of, filter(None, code.splitlines())))
                    shown = output.splitlines()
                    ellipsis = ["..."] if len(shown) > LINE_LIMIT else []
                    yield "\n".join(["", "```text", *shown[:LINE_LIMIT], *ellipsis, "```", ""])
                elif language == "python":
                    with contextlib.redirect_stdout(io.StringIO()):
                        exec(compile(code, "page", "exec"), {"__name__": "__main__"})
            yield text[at:]
        finally:
            os.chdir(back)


def _output_of(command: str) -> str:
    """What a command prints; raises RuntimeError where it fails."""
    from tribodyn.workflows.command.main import main

    words = shlex.split(command, comments=True)
    if not words:
        return ""
    if words[0] != "./tribodyn":
        raise RuntimeError(f"the build follows commands of tribodyn alone: {command}")
    if command in SHARED and "TRIBODYN_SHARED" in os.environ:
        test_output = Path(os.environ["TRIBODYN_SHARED"], SHARED[command])
        with FileLock(f"{test_output}.lock"):  # which the tests hold while they run it
            if test_output.is_dir():
                shutil.copytree(test_output / "results", "results", dirs_exist_ok=True)
                return (test_output / "printed").read_text(encoding="utf-8")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        try:
            main(words[1:])
        except SystemExit as end:
            if end.code:
                raise RuntimeError(f"{command} ended with {end.code}") from None
    return printed.getvalue()
