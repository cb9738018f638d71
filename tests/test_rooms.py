"""The rooms of the tests: no test module imports another one, and every room is one of the product's."""

from __future__ import annotations

import ast
from pathlib import Path

from tests.conftest import PROCESSES, ROOMS

TESTS = Path(__file__).resolve().parent


def test_no_test_imports_another_test_module() -> None:
    """What two of them need is a helper."""
    for path in TESTS.rglob("test_*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                assert not (name.startswith("tests.") and ".test_" in name), f"{path.name} imports {name}"


def test_every_room_has_its_place_in_the_order() -> None:
    rooms = {path.name for path in TESTS.iterdir() if path.is_dir() and any(path.rglob("test_*.py"))}
    assert rooms <= set(ROOMS)


def test_what_starts_processes_imports_what_says_so() -> None:
    """`os.system` and such would not be seen by the order."""
    for path in TESTS.rglob("test_*.py"):
        text = path.read_text(encoding="utf-8")
        if path == Path(__file__).resolve():
            continue  # it holds the words that it looks for
        assert "os.system(" not in text, path.name
        if "Popen(" in text or "get_context(" in text:
            assert any(f"import {name}" in text or f"from {name}" in text for name in PROCESSES), path.name
