"""What a result depends on beyond the words of its scene: contents of the files that are named, code that computes."""

import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

TREE = Path(__file__).parents[2]  # of the rooms, in the repository as in an installed package
COMPUTES = ("geometry", "fem", "reduction", "hbm", "workflows/run", "workflows/scene", "workflows/cases")
LENGTH = 16  # hexadecimal digits of a digest that are kept


def files_named(table: Any, folder: Path) -> dict[str, Path]:
    """Files that texts in nested tables and lists name, such as a mesh, a height map or a law of one's own."""
    paths = {}
    for value in _texts(table):
        if len(value) < 256 and "\n" not in value and "\0" not in value and (folder / value).is_file():
            paths[value] = folder / value
    return dict(sorted(paths.items()))


def digests(table: Any, folder: Path) -> dict[str, str]:
    """Digest of the contents of every file that is named, by its name."""
    named = files_named(table, folder)
    return {name: digest(path, path.stat().st_mtime_ns)[:LENGTH] for name, path in named.items()}


@cache
def digest(path: Path, changed: int) -> str:
    """Digest of a file; changed : when it was, so that it is read once."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def code() -> str:
    """Digest of the sources that make numbers of a scene."""
    content = hashlib.sha256()
    for room in COMPUTES:
        for path in sorted((TREE / room).rglob("*.py")):
            content.update(path.relative_to(TREE).as_posix().encode())
            content.update(path.read_bytes())
    return content.hexdigest()[:LENGTH]


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
        yield f"{value}.py"  # a law or part of one's own
    elif isinstance(value, dict):
        yield from _texts(list(value.values()))
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from _texts(item)
