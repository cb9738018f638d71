"""The command, run within the test's own process."""

from __future__ import annotations

from collections.abc import Callable

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
