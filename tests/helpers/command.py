"""The command, run within the test's own process."""

import json
from collections.abc import Callable
from typing import Any

import pytest

from tribodyn.workflows.command import main as cli


def leave(
    arguments: list[str], capsys: pytest.CaptureFixture[str], main: Callable[[list[str]], None] = cli.main
) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of the command."""
    code = 0
    try:
        main(arguments)
    except SystemExit as stop:
        code = int(stop.code or 0)
    out, err = capsys.readouterr()
    return code, out, err


def printed_text(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Standard output of a command that succeeds."""
    code, out, err = leave(arguments, capsys)
    assert code == 0, err
    return out


def printed_record(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> Any:
    """What a command that succeeds prints with --json."""
    return json.loads(printed_text(arguments, capsys))


def refusal(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one sentence with which a command refuses what it is given."""
    code, _, err = leave(arguments, capsys)
    assert code == 2
    assert err.count("\n") == 1, err
    return err
