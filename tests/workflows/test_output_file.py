"""Files are whole or not there; no text of a file is a command to a terminal or a spreadsheet."""

import errno
from pathlib import Path

import numpy as np
import pytest

from tribodyn.output_file import cell, printable, write_text
from tribodyn.workflows.result.number_format import write_columns


@pytest.mark.parametrize(
    "value",
    ["=1+1", "@SUM(A1)", "+1+cmd|' /C calc'!A0", "-2+3+cmd|' /C calc'!A0", "-A1", "+A1", "\t=1", "\r=1", "-(1)"],
)
def test_a_formula_is_a_text_in_a_table(tmp_path: Path, value: str) -> None:
    assert cell(value) == f"'{value}"
    write_columns({value: np.array([value, "b"], dtype=object)}, tmp_path / "x.csv")
    assert not any(line.strip('"').startswith(value[0]) for line in (tmp_path / "x.csv").read_text().split("\n"))


@pytest.mark.parametrize("value", [-1.5, "-1.5", "+1e-3 mm", "-z", "5 %", "-5 %", "-0.5 kN/um", "beam", ""])
def test_numbers_and_directions_stay_as_they_are(value: object) -> None:
    assert cell(value) == value


def test_a_terminal_gets_no_command() -> None:
    assert printable("a\x1b[31m\x9b2J\x07\tb\n") == "a\ufffd[31m\ufffd2J\ufffd\tb\n"


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_text(tmp_path / "report.html", "old")

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "no space left")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OSError, match="no space"):
        write_text(path, "new")
    assert [file.name for file in tmp_path.iterdir()] == ["report.html"]
    assert path.read_bytes() == b"old"
