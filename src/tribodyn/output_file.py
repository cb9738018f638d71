"""What the program writes: files that are whole or not there, texts that neither a terminal nor a spreadsheet obeys."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tribodyn.text_file import CONTROL

_FORMULA = re.compile(r"[=@\t\r]|[+-](?!(\d[\d.]*(e[+-]?\d+)?( ?[\w/%*^]+)?|[a-z])$)", re.IGNORECASE)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path next to `path` to write to; it takes the place of `path` at the end, and is removed where writing fails.

    The operating system renames at once or not at all."""
    temporary = path.with_name(f"{path.name}.{os.getpid()}.new")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> Path:
    """Write a text as a whole or not at all; its path."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def printable(text: object) -> str:
    """A text in which control characters, which a terminal obeys, are replaced."""
    return CONTROL.sub("\ufffd", str(text))


def cell(value: Any) -> Any:
    """A value of a table; a text that a spreadsheet would take for a formula begins with an apostrophe, which it hides.

    Source  OWASP, CSV injection"""
    text = printable(value) if isinstance(value, str) else ""
    return f"'{text}" if _FORMULA.match(text) else text or value


def set_aside(path: Path) -> Path | None:
    """Keep a file that is about to be replaced as NAME.previous; returns where it is now, None if there was none."""
    if not path.exists():
        return None
    previous = path.with_name(f"{path.stem}.previous{path.suffix}")
    os.replace(path, previous)
    return previous
