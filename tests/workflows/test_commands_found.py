"""A word of the command is one file with COMMANDS, in the command's folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from tribodyn.workflows import command as room
from tribodyn.workflows.command import found

WORD = 'def {0}() -> None:\n    """Said by {0}."""\n\n\nCOMMANDS = ({0},)\n'


def test_the_words_that_come_along_are_found() -> None:
    names = [command.__name__ for command in found.commands()]
    assert {"trade", "track", "backbone"} <= set(names)
    assert len(names) == len(set(names))


def test_a_new_file_is_a_new_word(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "hello.py").write_text(WORD.format("hello"))
    (tmp_path / "silent.py").write_text("")
    monkeypatch.setattr(room, "__path__", [*room.__path__, str(tmp_path)])
    names = [command.__name__ for command in found.commands()]
    assert {"hello", "trade"} <= set(names)
