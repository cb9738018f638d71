"""Pages of README and site, followed as a user does: files written, commands run as printed in a shell, Python pasted.

In a page, a fence
    ```sh              is run by bash in a folder that is fresh for the page
    ```python          is run by itself, as if pasted into a new session
    ```toml name.toml  is a file of that name (so are geo and python with a name)
    ```sh long         is run where slow tests are asked for
    ```sh check        names the check, which is not run by itself
Other fences are shown only. Commands and Python begin in a process that has its packages loaded (tests.helpers.warm).
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.helpers import warm

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
FENCE = re.compile(r"^( *)```([a-z]+)(?: ([\w.]+))?\n(.*?)^ *```", re.M | re.S)
SHOWN = {"toml", "geo", "python", "json", "text", "yaml", "tree"}

PROGRAM = f"""#!/bin/sh
export OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1
export VTK_DEFAULT_OPENGL_WINDOW="${{VTK_DEFAULT_OPENGL_WINDOW:-vtkEGLRenderWindow}}"
PYTHONPATH="{ROOT / "src"}" exec "{sys.executable}" -m tribodyn "$@"
"""


@dataclass(frozen=True)
class Fence:
    """A fence of a page: its language, the word behind it, its text."""

    language: str
    word: str
    text: str


def pages() -> list[Path]:
    """README and every page of the site."""
    site = sorted((ROOT / "docs").rglob("*.md"))
    return [README, *(page for page in site if not {"generated", "_build"} & set(page.parts))]


def fences(page: Path) -> Iterator[Fence]:
    """The fences of a page in their order; the indentation of a list is taken off."""
    for indent, language, word, text in FENCE.findall(page.read_text(encoding="utf-8")):
        yield Fence(language, word, "".join(line.removeprefix(indent) for line in text.splitlines(keepends=True)))


def runs(fence: Fence) -> bool:
    """Whether a fence is run in every check."""
    return (fence.language == "sh" and not fence.word) or (fence.language == "python" and not fence.word)


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def environment(folder: Path) -> dict[str, str]:
    """What a user has: the folder with the start script, and no Python of ours on the path."""
    expected = ("HOME", "LANG", "NUMBA_CACHE_DIR", "TMPDIR", "TRIBODYN_CACHE")
    saved = {key: os.environ[key] for key in expected if key in os.environ}
    return saved | {"PATH": f"{folder}:/usr/bin:/bin", "MPLBACKEND": "agg"}


def prepare(folder: Path, program: str = PROGRAM) -> Path:
    """Put a start script into the folder that starts the program of this tree, by default in a new interpreter."""
    script = folder / "tribodyn"
    script.write_text(program)
    script.chmod(0o755)
    return folder


def shell(text: str, folder: Path) -> str:
    """Run the text of a fence as printed, and what it prints; the first command that fails ends it."""
    done = subprocess.run(
        ["bash", "-e", "-c", text], cwd=folder, env=environment(folder), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{text}\n{done.stderr}"
    return done.stdout


def python(text: str, folder: Path) -> None:
    """Run Python as pasted."""
    done = subprocess.run(
        [folder / "tribodyn", "-c", text],
        cwd=folder, env=environment(folder), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{text}\n{done.stderr}"


def follow(page: Path, folder: Path, long: bool = False) -> str:
    """Do what a page says, in its order; what its commands print."""
    prepare(folder, warm.program())
    printed = ""
    for fence in fences(page):
        if fence.word and fence.language in SHOWN:
            (folder / fence.word).write_text(fence.text)
        elif fence.language == "sh" and (fence.word == "long") == long and fence.word in ("", "long"):
            printed += shell(fence.text, folder)
        elif fence.language == "python" and not fence.word and not long:
            python(fence.text, folder)
    return printed
